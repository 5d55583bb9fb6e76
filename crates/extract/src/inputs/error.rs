//! What can be wrong with the inputs of a run.

use std::io;
use std::path::{Path, PathBuf};

use corsmal_files::quote::printable_line;
use thiserror::Error;

/// What can be wrong with the inputs of a run.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum InputError {
    /// Nothing has this name.
    #[error("{}: no such file or folder", line(path))]
    Missing {
        /// The name given.
        path: PathBuf,
    },
    /// The operating system refused.
    #[error("{}: {source}", line(path))]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// Its reason.
        source: io::Error,
    },
    /// An object of a store.
    #[error("{name}: {reason}")]
    Store {
        /// The URI given.
        name: String,
        /// What is wrong with it, or with the store.
        reason: String,
    },
    /// A folder or glob without recordings.
    #[error("{}: no file with an audio extension ({extensions}){skipped}", line(path))]
    NoAudio {
        /// The folder or glob.
        path: PathBuf,
        /// The extensions looked for.
        extensions: String,
        /// What is there instead and is not read, if anything.
        skipped: String,
    },
    /// A glob that cannot be understood.
    #[error("{pattern}: not a glob: {reason}")]
    Glob {
        /// The glob.
        pattern: String,
        /// What is wrong with it.
        reason: String,
    },
    /// A row of a manifest that cannot be used.
    #[error("{}, line {line}: {reason}", self::line(path))]
    Manifest {
        /// The manifest.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// What is wrong, and what is allowed.
        reason: String,
    },
    /// An archive that cannot be used.
    #[error("{}: {reason}", line(path))]
    Archive {
        /// The archive.
        path: PathBuf,
        /// What is wrong, and where.
        reason: String,
    },
    /// The caller asked to stop.
    #[error("interrupted")]
    Stopped,
    /// The manifests together have too many labels, or one that cannot be called so.
    #[error("{reason}")]
    Labels {
        /// How many, and how many are allowed; or which, and why not.
        reason: String,
    },
    /// A recording that cannot be cut into windows.
    #[error("{id}: {reason}")]
    Window {
        /// Its id, or that of a window.
        id: String,
        /// Why.
        reason: String,
    },
    /// A tar has a member twice.
    #[error(
        "{}: the archive is named twice, or has this member twice, as after `tar -r` or `tar -u`; name the \
         archive once, or extract it and pack it again",
        line(path)
    )]
    MemberTwice {
        /// The member, in the archive.
        path: PathBuf,
    },
    /// Two inputs cannot be told apart.
    #[error(
        "{first} and {second} both have the id {id:?}; name each once, or give ids in a manifest"
    )]
    Duplicate {
        /// The id.
        id: String,
        /// One input.
        first: String,
        /// The other.
        second: String,
    },
}

impl InputError {
    pub(crate) fn io(path: &Path, source: io::Error) -> Self {
        Self::Io { path: path.into(), source }
    }
}

/// A path on one line.
fn line(path: &Path) -> String {
    printable_line(&path.display().to_string())
}
