//! Why a file cannot be shown, as text or JSON.

use std::path::Path;
use std::process::ExitCode;

use serde::Serialize;

use crate::failure::{FAILED_FILES, Failure};

/// The JSON form of a refusal.
#[derive(Serialize)]
pub(super) struct Refusal<'a> {
    pub(super) path: &'a str,
    pub(super) status: &'static str,
    pub(super) byte: Option<u64>,
    pub(super) reason: &'a str,
}

impl Refusal<'_> {
    /// Says why a file cannot be shown.
    pub(super) fn print(&self, json: bool) -> Result<ExitCode, Failure> {
        if json {
            print!("{}", to_json(self)?);
        } else {
            let reason = self.reason.strip_prefix(&format!("{}: ", self.path));
            eprintln!("{}: {}", self.path, reason.unwrap_or(self.reason));
        }
        Ok(ExitCode::from(FAILED_FILES))
    }
}

/// Says that the content of a file is not what its kind asks for.
pub(super) fn corrupt(
    path: &Path,
    reason: &impl ToString,
    json: bool,
) -> Result<ExitCode, Failure> {
    let (path, reason) = (path.display().to_string(), reason.to_string());
    Refusal { path: &path, status: "corrupt", byte: None, reason: &reason }.print(json)
}

/// Indented JSON with a line's end.
pub(super) fn to_json(value: &impl Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}
