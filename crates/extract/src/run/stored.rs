//! Outputs in stores: made in a file first, then put there whole.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::draft::Draft;
use corsmal_files::format::OutputFormat;
use corsmal_files::npz::Compression;

use super::error::RunError;
use crate::inputs::stored::{self, Purpose};
use crate::inputs::{InputError, Object, is_stored, object, shown};

/// Hexadecimal digits that keep the files of outputs with one name apart.
const DIGITS: usize = 12;

/// An output in a store, and the file that it is made in.
#[derive(Debug, Clone)]
pub struct StoredOutput {
    object: Object,
    /// The file, `NAME-HASH.EXT` in the work folder.
    pub file: PathBuf,
}

impl StoredOutput {
    /// The output that `out` names, where that is in a store. It is made in `work`, by default the current
    /// folder.
    ///
    /// # Errors
    /// [`RunError::Name`], [`RunError::Store`]: a name that no output can have.
    pub fn of(
        out: &Path,
        work: Option<&Path>,
        partition_by: Option<&str>,
    ) -> Result<Option<Self>, RunError> {
        let Some(name) = out.to_str().filter(|name| is_stored(name)) else { return Ok(None) };
        if partition_by.is_some() {
            let reason = "a partitioned output is a folder on a disk: write it here, then copy it";
            return Err(RunError::Store { name: shown(name), reason: reason.into() });
        }
        // Without the query of a web address, which is in no message.
        let out = &PathBuf::from(shown(name));
        OutputFormat::of_name(out, Compression::Stored)?;
        let refused = |reason: String| RunError::Store { name: shown(name), reason };
        let object = object(name).map_err(|error| match error {
            InputError::Store { name, reason } => RunError::Store { name, reason },
            other => refused(other.to_string()),
        })?;
        if stored::is_web(&object) {
            return Err(RunError::Store {
                name: object.to_string(),
                reason: "is on a web server, and outputs cannot be written there".into(),
            });
        }
        let (stem, extension) = (out.file_stem(), out.extension());
        let text = |part: Option<&std::ffi::OsStr>| {
            part.map(|part| part.to_string_lossy().into_owned()).unwrap_or_default()
        };
        let hash = blake3::hash(name.as_bytes()).to_hex();
        let file = format!("{}-{}.{}", text(stem), &hash[..DIGITS], text(extension));
        let work = work.unwrap_or(Path::new(""));
        Ok(Some(Self { object, file: work.join(file) }))
    }

    /// The same, made in a file that no other kind of work writes.
    pub(crate) fn kept_apart(mut self, by: &str) -> Self {
        let text = |part: Option<&std::ffi::OsStr>| {
            part.unwrap_or_default().to_string_lossy().into_owned()
        };
        let (stem, extension) = (text(self.file.file_stem()), text(self.file.extension()));
        self.file.set_file_name(format!("{stem}-{by}.{extension}"));
        self
    }

    /// The name of the object.
    pub fn name(&self) -> String {
        self.object.to_string()
    }

    /// Whether the object is there.
    ///
    /// # Errors
    /// [`RunError::Store`], [`RunError::Interrupted`].
    pub(crate) fn is_there(&self, stop: &AtomicBool) -> Result<bool, RunError> {
        let found = stored::look(&self.object, stop).map_err(|reason| self.failed(reason, stop))?;
        Ok(found.is_some())
    }

    /// A copy of the object as it is now, which is gone when it is dropped; `None` where there is none.
    ///
    /// # Errors
    /// [`RunError::Store`], [`RunError::Interrupted`], [`RunError::Folder`].
    pub(crate) fn present(&self, stop: &Arc<AtomicBool>) -> Result<Option<Draft>, RunError> {
        let found = stored::look(&self.object, stop).map_err(|reason| self.failed(reason, stop))?;
        let Some(object) = found else { return Ok(None) };
        let mut copy = Draft::create(&self.file).map_err(RunError::Folder)?;
        fetch(&object, &mut copy, stop).map_err(|error| self.failed(error.to_string(), stop))?;
        Ok(Some(copy))
    }

    /// Puts the finished file into the store and removes it here.
    ///
    /// # Errors
    /// [`RunError::Unsent`], [`RunError::Interrupted`]: the file stays.
    pub fn publish(&self, overwrite: bool, stop: &Arc<AtomicBool>) -> Result<(), RunError> {
        stored::upload(&self.file, &self.object, overwrite, stop).map_err(|reason| {
            match stop.load(Ordering::Relaxed) {
                true => RunError::Interrupted,
                false => RunError::Unsent { name: self.name(), file: self.file.clone(), reason },
            }
        })?;
        self.forget()
    }

    /// Removes the file of a run whose output is in the store.
    ///
    /// # Errors
    /// [`RunError::Folder`].
    pub(crate) fn forget(&self) -> Result<(), RunError> {
        match std::fs::remove_file(&self.file) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => {
                let told = format!("{}: {error}", self.file.display());
                Err(RunError::Folder(io::Error::new(error.kind(), told)))
            }
            _ => Ok(()),
        }
    }

    fn failed(&self, reason: String, stop: &AtomicBool) -> RunError {
        match stop.load(Ordering::Relaxed) {
            true => RunError::Interrupted,
            false => RunError::Store { name: self.name(), reason },
        }
    }
}

/// Copies the object of this name into a new file.
///
/// # Errors
/// [`RunError::Store`], [`RunError::Interrupted`].
pub fn fetch_to(name: &str, file: &Path, stop: &Arc<AtomicBool>) -> Result<(), RunError> {
    let failed = |reason: String| match stop.load(Ordering::Relaxed) {
        true => RunError::Interrupted,
        false => RunError::Store { name: shown(name), reason },
    };
    let object = object(name).map_err(|error| match error {
        InputError::Store { name, reason } => RunError::Store { name, reason },
        other => failed(other.to_string()),
    })?;
    let mut copy = File::create(file).map_err(|e| failed(e.to_string()))?;
    fetch(&object, &mut copy, stop).map(drop).map_err(|e| failed(e.to_string()))
}

/// Copies an object, all of it of one version. Waiting ends when `stop` is set.
///
/// # Errors
/// Whatever reading or writing reports.
fn fetch(object: &Object, to: &mut impl Write, stop: &Arc<AtomicBool>) -> io::Result<u64> {
    let pin = stored::pin_to_listed(object);
    let mut bytes = stored::open(object, None, Purpose::Content, (&pin, stop))?;
    io::copy(&mut bytes, to)
}
