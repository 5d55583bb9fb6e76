//! The recordings that a command is given.

use std::ffi::OsStr;

use corsmal_extract::inputs::{self, Input, InputError};

use crate::failure::Failure;

/// The recordings that `names` stand for, at least one. `warn` is told what was passed over.
pub fn named<S: AsRef<OsStr>>(names: &[S], warn: impl FnOnce(&str)) -> Result<Vec<Input>, Failure> {
    let collected = match inputs::collect_until(names, crate::interrupt::flag()) {
        Err(error @ InputError::Stopped) => return Err(Failure::interrupted(error.to_string())),
        collected => collected?,
    };
    if let Some(warning) = collected.warning() {
        warn(&warning);
    }
    if collected.inputs.is_empty() {
        let names: Vec<_> = names.iter().map(|name| name.as_ref().to_string_lossy()).collect();
        return Err(Failure::new(format!("{}: no recordings found", names.join(" "))));
    }
    Ok(collected.inputs)
}

/// Says a warning of [`named`] on standard error.
pub fn warn(warning: &str) {
    eprintln!("warning: {warning}");
}
