//! Files that appear under their name only when they are whole.

use std::io::Write;
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::failure::Failure;

/// Refuses a name that is taken, unless it may be replaced, and a folder that is not there.
pub fn check(path: &Path, overwrite: bool) -> Result<(), Failure> {
    if path.exists() && !overwrite {
        return Err(Failure::new(format!("{} exists; --overwrite replaces it", path.display())));
    }
    if folder(path).is_dir() {
        return Ok(());
    }
    Err(Failure::new(format!("{}: there is no folder {}", path.display(), folder(path).display())))
}

/// Writes under another name in the same folder, then renames.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let mut draft = Draft::create(path)?;
    draft.write_all(bytes).map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
    draft.publish()
}

/// A file under another name in the same folder, until it is whole.
pub struct Draft {
    path: PathBuf,
    file: NamedTempFile,
}

impl Draft {
    /// Begins the file that is to be called `path`.
    pub fn create(path: &Path) -> Result<Self, Failure> {
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new file: the process's umask applies, where temporary files are private.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder(path));
        let file = file.map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
        Ok(Self { path: path.into(), file })
    }

    /// Gives the file its name.
    pub fn publish(self) -> Result<(), Failure> {
        let Self { path, file } = self;
        let fault = |e: std::io::Error| Failure::new(format!("{}: {e}", path.display()));
        file.as_file().sync_all().map_err(fault)?;
        file.persist(&path).map_err(|e| fault(e.error))?;
        Ok(())
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.flush()
    }
}

/// The folder that a file is in.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}
