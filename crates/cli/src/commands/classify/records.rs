//! The lines that are written, and how writing ends.

use std::io::ErrorKind;

use corsmal_extract::inputs::{Input, InputSource};
use corsmal_models::predictions::RecordWriter;

use crate::failure::Failure;
use crate::output::Output;

/// The writer of this command.
pub(super) type Records = RecordWriter<Output>;

/// How the work ended.
pub(super) enum End {
    Done,
    Interrupted,
    /// Whoever reads standard output has seen enough.
    Unread,
}

/// The path of a recording as given.
pub(super) fn path_of(input: &Input) -> &str {
    match &input.source {
        InputSource::File(path) | InputSource::Pipe(path) => path.to_str().unwrap_or(&input.id),
        InputSource::Member(member) => member.path.to_str().unwrap_or(&input.id),
        InputSource::Object(object) => object.name(),
        InputSource::Memory(_) => &input.id,
        InputSource::Stdin => "-",
    }
}

/// Whether a write went through; `false` where nobody reads any more.
pub(super) fn delivered(written: std::io::Result<()>) -> Result<bool, Failure> {
    match written {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(e) => Err(e.into()),
    }
}
