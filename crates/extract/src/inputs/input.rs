//! A recording of a run.

use std::fmt;
use std::fs::Metadata;
use std::io::{self, Cursor};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_audio::{AudioError, BlockSource};
use corsmal_files::identity;

use super::member::{Member, Place};
use super::stored::{self, Object, Pin, Purpose};

/// Where the bytes of a recording come from.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum InputSource {
    /// A file.
    File(PathBuf),
    /// A pipe or device, whose bytes come once.
    Pipe(PathBuf),
    /// An object of a store, or a file on a web server.
    Object(Arc<Object>),
    /// A member of a tar archive.
    Member(Box<Member>),
    /// Bytes in memory.
    Memory(Arc<[u8]>),
    /// Standard input.
    Stdin,
}

impl fmt::Display for InputSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(path) | Self::Pipe(path) => path.display().fmt(f),
            Self::Object(object) => object.fmt(f),
            Self::Member(member) => member.path.display().fmt(f),
            // What tells them apart.
            Self::Memory(bytes) => f.write_str(&identity::of_bytes(bytes)),
            Self::Stdin => f.write_str("-"),
        }
    }
}

impl InputSource {
    /// The file, pipe or device at a path.
    pub fn at(path: PathBuf) -> Self {
        let is_pipe = |meta: Metadata| !meta.is_file() && !meta.is_dir();
        match std::fs::metadata(&path).is_ok_and(is_pipe) {
            true => Self::Pipe(path),
            false => Self::File(path),
        }
    }

    /// Whether its bytes come once: what has looked at them has taken them.
    pub fn comes_once(&self) -> bool {
        matches!(self, Self::Pipe(_) | Self::Stdin)
    }

    /// The file that holds the bytes, where there is one.
    pub fn file(&self) -> Option<&Path> {
        match self {
            Self::File(path) => Some(path),
            Self::Member(member) => match &member.archive {
                Place::File(path) => Some(path),
                Place::Object(_) => None,
            },
            Self::Object(_) | Self::Pipe(_) | Self::Memory(_) | Self::Stdin => None,
        }
    }

    /// The archive that holds it, where there is one.
    pub(super) fn archive(&self) -> Option<PathBuf> {
        match self {
            Self::Member(member) => Some(member.archive.path()),
            _ => None,
        }
    }

    /// The object that holds the bytes, where there is one.
    pub(crate) fn object(&self) -> Option<&Object> {
        match self {
            Self::Object(object) => Some(object),
            Self::Member(member) => match &member.archive {
                Place::Object(object) => Some(object),
                Place::File(_) => None,
            },
            Self::File(_) | Self::Pipe(_) | Self::Memory(_) | Self::Stdin => None,
        }
    }

    /// Whether reading it may be waiting for bytes to come.
    pub(crate) fn waits(&self) -> bool {
        self.comes_once() || self.is_stored()
    }

    /// Whether the bytes come from a store, which takes time and can be called off.
    pub(crate) fn is_stored(&self) -> bool {
        match self {
            Self::Object(_) => true,
            Self::Member(member) => matches!(member.archive, Place::Object(_)),
            Self::File(_) | Self::Pipe(_) | Self::Memory(_) | Self::Stdin => false,
        }
    }

    /// Keeps all that is read from now on to one version, where the bytes come from a store.
    pub(crate) fn pin(&self) -> Option<Pin> {
        match self {
            Self::Object(_) => Some(Pin::default()),
            Self::Member(member) => match &member.archive {
                // Members lie there in the version whose headers were read.
                Place::Object(object) => Some(stored::pin_to_listed(object)),
                Place::File(_) => None,
            },
            Self::File(_) | Self::Pipe(_) | Self::Memory(_) | Self::Stdin => None,
        }
    }

    /// Opens the recording.
    ///
    /// # Errors
    /// As [`corsmal_audio::open`].
    pub fn open(&self) -> Result<Box<dyn BlockSource>, AudioError> {
        self.open_until(&Arc::default())
    }

    /// Opens the recording for a look at its header. Waiting for a store ends when `stop` is set.
    ///
    /// # Errors
    /// As [`corsmal_audio::open`].
    pub fn open_header(&self, stop: &Arc<AtomicBool>) -> Result<Box<dyn BlockSource>, AudioError> {
        let pin = self.pin().unwrap_or_default();
        self.open_for(Purpose::Header, (&pin, stop))
    }

    /// As [`InputSource::open`]; waiting for a store ends when `stop` is set.
    ///
    /// # Errors
    /// As [`corsmal_audio::open`].
    pub(crate) fn open_until(
        &self,
        stop: &Arc<AtomicBool>,
    ) -> Result<Box<dyn BlockSource>, AudioError> {
        let pin = self.pin().unwrap_or_default();
        self.open_for(Purpose::Content, (&pin, stop))
    }

    /// Opens the recording. From a store, all bytes are of the version that the pin keeps, and waiting
    /// ends when the flag is set.
    ///
    /// # Errors
    /// As [`corsmal_audio::open`].
    pub(crate) fn open_for(
        &self,
        purpose: Purpose,
        with: (&Pin, &Arc<AtomicBool>),
    ) -> Result<Box<dyn BlockSource>, AudioError> {
        match self {
            Self::File(path) | Self::Pipe(path) => corsmal_audio::open(path),
            Self::Object(object) => {
                let failed = |source| AudioError::Open { path: object.to_string().into(), source };
                let blocks = stored::open(object, None, purpose, with).map_err(failed)?;
                corsmal_audio::from_seekable(blocks)
            }
            Self::Member(member) => member.open(purpose, with),
            Self::Memory(bytes) => corsmal_audio::from_seekable(Cursor::new(bytes.clone())),
            Self::Stdin => corsmal_audio::from_reader(io::stdin()),
        }
    }

    /// What its bytes are known by; empty where they cannot be read.
    pub fn identity(&self) -> String {
        self.identity_until(&AtomicBool::new(false))
    }

    /// As [`InputSource::identity`]; waiting for a store ends when `stop` is set.
    pub(crate) fn identity_until(&self, stop: &AtomicBool) -> String {
        match self {
            Self::File(path) => identity::of_file(path).unwrap_or_default(),
            Self::Object(object) => stored::identity_now(object, stop),
            Self::Member(member) => member.identity(stop).unwrap_or_default(),
            Self::Memory(bytes) => identity::of_bytes(bytes),
            Self::Pipe(_) | Self::Stdin => identity::STREAM.to_string(),
        }
    }
}

/// One recording, or a stretch of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Input {
    /// Unique in the run.
    pub id: String,
    /// Where its bytes come from.
    pub source: InputSource,
    /// Start of the stretch in seconds.
    pub start: Option<f64>,
    /// End of the stretch in seconds.
    pub end: Option<f64>,
    /// Label columns as (name, value); every input of a run has the same names in the same order.
    pub labels: Vec<(String, String)>,
}

/// BLAKE3 (hex) over ids, paths, stretches and labels of all inputs: equal for equal lists only.
pub fn list_hash(inputs: &[Input]) -> String {
    let mut hasher = blake3::Hasher::new();
    let mut put = |text: &str| {
        hasher.update(&(text.len() as u64).to_le_bytes());
        hasher.update(text.as_bytes());
    };
    for input in inputs {
        put(&input.id);
        put(&input.source.to_string());
        for time in [input.start, input.end] {
            put(&time.map(|t| t.to_string()).unwrap_or_default());
        }
        put(&input.labels.len().to_string());
        for (column, value) in &input.labels {
            put(column);
            put(value);
        }
    }
    hasher.finalize().to_hex().to_string()
}
