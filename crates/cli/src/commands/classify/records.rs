//! The lines that are written, and how writing ends.

use std::io::ErrorKind;

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

/// Whether a write went through; `false` where nobody reads any more.
pub(super) fn delivered(written: std::io::Result<()>) -> Result<bool, Failure> {
    match written {
        Ok(()) => Ok(true),
        Err(e) if e.kind() == ErrorKind::BrokenPipe => Ok(false),
        Err(e) => Err(e.into()),
    }
}
