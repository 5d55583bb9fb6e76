//! What kind of file to write, and what kind a file is.

use std::fmt;
use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::npz::Compression;

/// A name that no output can have.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("{path}: must end in {allowed}")]
pub struct FormatError {
    /// The name.
    pub path: PathBuf,
    /// The extensions that are allowed.
    pub allowed: &'static str,
}

/// Refuses a name for an `.npz` that does not say so.
///
/// # Errors
/// [`FormatError`].
pub fn require_npz(path: &Path) -> Result<(), FormatError> {
    match path.extension() {
        Some(e) if e.eq_ignore_ascii_case("npz") => Ok(()),
        _ => Err(FormatError { path: path.into(), allowed: ".npz" }),
    }
}

/// The formats that a run writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OutputFormat {
    /// A numpy archive.
    Npz(Compression),
    /// A Parquet table of summaries or of frames.
    Parquet,
}

impl OutputFormat {
    /// The format of the output that is to be called `path`; members of an `.npz` are compressed as
    /// `compression` says.
    ///
    /// # Errors
    /// [`FormatError`] for any other extension.
    pub fn of_name(path: &Path, compression: Compression) -> Result<Self, FormatError> {
        match path.extension() {
            Some(e) if e.eq_ignore_ascii_case("parquet") => Ok(Self::Parquet),
            _ if require_npz(path).is_ok() => Ok(Self::Npz(compression)),
            _ => Err(FormatError { path: path.into(), allowed: ".npz or .parquet" }),
        }
    }
}

impl fmt::Display for OutputFormat {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Npz(Compression::Stored) => "npz stored",
            Self::Npz(Compression::Deflated) => "npz deflated",
            Self::Parquet => "parquet",
        })
    }
}

/// What a file holds, by its first bytes and whatever its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content {
    /// A zip archive, as `.npz` files are.
    Npz,
    /// One numpy array.
    Npy,
    /// A Parquet table.
    Parquet,
    /// Anything else.
    Other,
}

impl Content {
    /// Looks at the first bytes of a file.
    ///
    /// # Errors
    /// Whatever opening and reading reports.
    pub fn of(path: &Path) -> io::Result<Self> {
        let mut start = Vec::new();
        File::open(path)?.take(6).read_to_end(&mut start)?;
        Ok(match start.as_slice() {
            [b'P', b'K', 3, 4, ..] | [b'P', b'K', 5, 6, ..] => Self::Npz,
            [b'P', b'A', b'R', b'1', ..] => Self::Parquet,
            b"\x93NUMPY" => Self::Npy,
            _ => Self::Other,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_decide_what_is_written_and_bytes_what_is_read() {
        let of = |name: &str| OutputFormat::of_name(Path::new(name), Compression::Deflated);
        assert_eq!(of("a.NPZ").unwrap(), OutputFormat::Npz(Compression::Deflated));
        assert_eq!(of("a.parquet").unwrap(), OutputFormat::Parquet);
        let error = of("a.npz.gz").unwrap_err().to_string();
        assert_eq!(error, "a.npz.gz: must end in .npz or .parquet");
        assert!(require_npz(Path::new("a.NPZ")).is_ok());
        let error = require_npz(Path::new("a.parquet")).unwrap_err().to_string();
        assert_eq!(error, "a.parquet: must end in .npz");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.npz");
        for (bytes, content) in [
            (&b"PK\x03\x04rest"[..], Content::Npz),
            (b"PK\x05\x06", Content::Npz),
            (b"PAR1", Content::Parquet),
            (b"\x93NUMPY\x01\x00", Content::Npy),
            (b"RIFF", Content::Other),
            (b"", Content::Other),
        ] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(Content::of(&path).unwrap(), content);
        }
    }
}
