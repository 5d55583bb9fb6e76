//! Feature files of either kind, opened by their content.

use std::path::{Path, PathBuf};

use thiserror::Error;

use crate::format::{Content, OutputFormat};
use crate::layout::{self, LayoutError};
use crate::npy::NpyFile;
use crate::npz::{NpzError, NpzFile};
use crate::parquet::{ParquetFile, ParquetTableError};
use crate::partition::names::is_partitioned;
use crate::provenance::Provenance;
use crate::table::Table;

/// Why a feature file cannot be read.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FeatureFileError {
    /// The operating system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// A folder, probably of recordings.
    #[error(
        "{path} is a folder, but a feature file is expected: corsmal-feat extract {path} -o \
         table.npz --preset mfcc-zcr makes one with a row of statistics for each recording in it"
    )]
    Folder {
        /// The folder.
        path: PathBuf,
    },
    /// The folder of a partitioned output.
    #[error(
        "{path} is a folder of parts, which `extract --partition-by` wrote, but a single file is \
         expected: extract without --partition-by"
    )]
    Parts {
        /// The folder.
        path: PathBuf,
    },
    /// A pipe or a device, whose bytes come once.
    #[error(
        "{path} is a pipe or device, which gives its bytes once, but a feature file is read in \
         several places: give a file"
    )]
    Pipe {
        /// The pipe.
        path: PathBuf,
    },
    /// An object in a store. What follows may hold secrets.
    #[error(
        "{scheme}://...: feature files are read from a disk, not from an address: copy it to one first"
    )]
    Address {
        /// What the address begins with.
        scheme: String,
    },
    /// The first bytes are of no format that is read.
    #[error("{path}: expected {expected}, found another kind of file")]
    Content {
        /// The file.
        path: PathBuf,
        /// What is read.
        expected: &'static str,
    },
    /// Another program wrote it.
    #[error("{path}: expected an output of `extract`, found a file from another program")]
    Foreign {
        /// The file.
        path: PathBuf,
    },
    /// The archive cannot be read.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The members of the archive contradict each other.
    #[error(transparent)]
    Layout(#[from] LayoutError),
    /// The Parquet file cannot be read.
    #[error(transparent)]
    Parquet(#[from] ParquetTableError),
    /// The `.npy` file cannot be read.
    #[error("{path}: {source}")]
    Npy {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        source: crate::npy::NpyError,
    },
}

/// An open file of arrays or a table, ours or not.
#[derive(Debug)]
pub enum FeatureFile {
    /// A numpy archive.
    Npz(NpzFile),
    /// One numpy array.
    Npy(NpyFile),
    /// A Parquet table.
    Parquet(ParquetFile),
}

impl FeatureFile {
    /// Opens a file by its content, whatever its name.
    ///
    /// # Errors
    /// [`FeatureFileError`].
    pub fn open(path: &Path) -> Result<Self, FeatureFileError> {
        if is_partitioned(path) {
            return Err(FeatureFileError::Parts { path: path.into() });
        }
        if path.is_dir() {
            return Err(FeatureFileError::Folder { path: path.into() });
        }
        let address = path.to_str().and_then(|name| name.split_once("://"));
        match (path.metadata(), address) {
            (Ok(metadata), _) if !metadata.is_file() => {
                return Err(FeatureFileError::Pipe { path: path.into() });
            }
            (Err(_), Some((scheme, _))) => {
                return Err(FeatureFileError::Address { scheme: scheme.into() });
            }
            _ => {}
        }
        let content = Content::of(path)
            .map_err(|source| FeatureFileError::Io { path: path.into(), source })?;
        match content {
            Content::Npz => Ok(Self::Npz(NpzFile::open(path)?)),
            Content::Parquet => Ok(Self::Parquet(ParquetFile::open(path)?)),
            Content::Npy => NpyFile::open(path)
                .map(Self::Npy)
                .map_err(|source| FeatureFileError::Npy { path: path.into(), source }),
            Content::Other => Err(FeatureFileError::Content {
                path: path.into(),
                expected: "a .npz archive, a .npy array or a Parquet table",
            }),
        }
    }

    /// The file that was opened.
    pub fn path(&self) -> &Path {
        match self {
            Self::Npz(npz) => npz.path(),
            Self::Npy(npy) => npy.path(),
            Self::Parquet(parquet) => parquet.path(),
        }
    }

    /// Whether this tool wrote it.
    pub fn is_ours(&self) -> bool {
        match self {
            Self::Npz(npz) => layout::is_ours(npz),
            Self::Npy(_) => false,
            Self::Parquet(parquet) => parquet.is_ours(),
        }
    }

    /// How an output of ours was made, without its table.
    ///
    /// # Errors
    /// As [`FeatureFile::table`].
    pub fn provenance(&mut self) -> Result<Provenance, FeatureFileError> {
        match self {
            Self::Npz(npz) if layout::is_ours(npz) => Ok(layout::read_provenance(npz)?),
            Self::Parquet(parquet) if parquet.is_ours() => Ok(parquet.provenance()?),
            _ => Err(FeatureFileError::Foreign { path: self.path().into() }),
        }
    }

    /// The table of an output of ours, and how it was made.
    ///
    /// # Errors
    /// [`FeatureFileError`]; [`FeatureFileError::Foreign`] where another program wrote it.
    pub fn table(&mut self) -> Result<FeatureTable, FeatureFileError> {
        let path = self.path().to_path_buf();
        if !self.is_ours() {
            return Err(FeatureFileError::Foreign { path });
        }
        let (table, provenance, format) = match self {
            Self::Npz(npz) => {
                let (table, provenance) = layout::read_table(npz)?;
                (table, provenance, OutputFormat::Npz(layout::compression(npz)?))
            }
            Self::Parquet(parquet) => {
                let (table, provenance) = parquet.table()?;
                (table, provenance, OutputFormat::Parquet)
            }
            Self::Npy(_) => return Err(FeatureFileError::Foreign { path }),
        };
        Ok(FeatureTable { path, table, provenance, format })
    }
}

/// The table of an output: one outcome per input, and a row of statistics for each that has some.
#[derive(Debug)]
pub struct FeatureTable {
    /// The file.
    pub path: PathBuf,
    /// Ids, labels, summary rows and outcomes.
    pub table: Table,
    /// How they were made.
    pub provenance: Provenance,
    /// Format of the file.
    pub format: OutputFormat,
}

impl FeatureTable {
    /// Reads the table of an output of ours, `.npz` or Parquet by its content.
    ///
    /// # Errors
    /// [`FeatureFileError`]; [`FeatureFileError::Foreign`] where another program wrote it.
    pub fn open(path: &Path) -> Result<Self, FeatureFileError> {
        FeatureFile::open(path)?.table()
    }
}
