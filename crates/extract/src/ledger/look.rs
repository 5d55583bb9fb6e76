//! A ledger as others see it.

use std::fs::File;
use std::path::Path;

use corsmal_files::outcome::Outcome;

use super::error::LedgerError;
use super::header::Header;
use super::lines::{Lines, Next};
use super::record::Record;

/// Which run a ledger belongs to, and what became of the inputs that are done: those of the records that
/// hold, whatever follows. Nothing is locked or changed.
///
/// # Errors
/// [`LedgerError::Io`]; [`LedgerError::Header`] where the file is no ledger.
pub fn look(path: &Path) -> Result<(Header, Vec<Outcome>), LedgerError> {
    let io = |source| LedgerError::Io { path: path.into(), source };
    let refuse = |reason: String| LedgerError::Header { path: path.into(), reason };
    let file = File::open(path).map_err(io)?;
    let mut lines = Lines::new(&file);
    let header = match lines.next().map_err(io)? {
        Next::Line(text) => serde_json::from_slice(text).map_err(|e| refuse(e.to_string()))?,
        Next::End => return Err(refuse("it ends before its header does".into())),
        Next::Wrong(_) => {
            return Err(refuse("the checksum of its first line does not match".into()));
        }
    };
    let mut outcomes = Vec::new();
    while let Next::Line(text) = lines.next().map_err(io)? {
        let Ok(record) = serde_json::from_slice::<Record>(text) else { break };
        outcomes.push(record.outcome);
    }
    Ok((header, outcomes))
}
