//! What a ledger can refuse.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// What a ledger can refuse.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LedgerError {
    /// The operating system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// Another run holds the lock.
    #[error("{path}: another run is writing this output")]
    Locked {
        /// The ledger or the partial output.
        path: PathBuf,
    },
    /// A file of the run is gone or another one.
    #[error(
        "{path} was removed or replaced while the run was writing; nothing was published, start \
         the run again"
    )]
    Lost {
        /// The ledger or the partial output.
        path: PathBuf,
    },
    /// The ledger belongs to a different run.
    #[error(
        "{path}: the interrupted run had {field} {found}, this one has {expected}; \
         finish it with the same settings or start again"
    )]
    Differs {
        /// The ledger.
        path: PathBuf,
        /// Which field of the header differs.
        field: &'static str,
        /// Value of the interrupted run.
        found: String,
        /// Value of this run.
        expected: String,
    },
    /// The first line is not a ledger header.
    #[error("{path}: not a ledger of this tool: {reason}; remove the file to start again")]
    Header {
        /// The ledger.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}
