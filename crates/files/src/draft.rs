//! Files that appear under their name only when they are whole.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// A file under another name in the same folder, until it is whole. Errors name the file it is to
/// become.
pub struct Draft {
    path: PathBuf,
    file: NamedTempFile,
}

impl Draft {
    /// Begins the file that is to be called `path`.
    ///
    /// # Errors
    /// Its folder cannot be written.
    pub fn create(path: &Path) -> io::Result<Self> {
        #[cfg_attr(not(unix), expect(unused_mut, reason = "nothing is set there"))]
        let mut builder = tempfile::Builder::new();
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new file: the process's umask applies, where temporary files are private.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let path = destination(path);
        let file = builder.tempfile_in(folder(&path)).map_err(|e| named(&path, &e))?;
        Ok(Self { path, file })
    }

    /// Another handle on the file.
    ///
    /// # Errors
    /// No more files can be opened.
    pub fn handle(&self) -> io::Result<File> {
        self.file.as_file().try_clone().map_err(|e| named(&self.path, &e))
    }

    /// Gives the file its name.
    ///
    /// # Errors
    /// The disk is full, or the name cannot be taken.
    pub fn publish(self) -> io::Result<()> {
        let Self { path, file } = self;
        file.as_file().sync_all().map_err(|e| named(&path, &e))?;
        file.persist(&path).map_err(|e| named(&path, &e.error))?;
        Ok(())
    }
}

impl Write for Draft {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.as_file_mut().write(bytes).map_err(|e| named(&self.path, &e))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.as_file_mut().flush().map_err(|e| named(&self.path, &e))
    }
}

/// Writes a file, whole or not at all.
///
/// # Errors
/// As those of [`Draft`].
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut draft = Draft::create(path)?;
    draft.write_all(bytes)?;
    draft.publish()
}

/// Where a file is written that is called `path`: what a symbolic link leads to, there or not, so
/// that the link stays.
pub fn destination(path: &Path) -> PathBuf {
    // As many links as Linux follows.
    let mut path = path.to_path_buf();
    for _ in 0..40 {
        match std::fs::read_link(&path) {
            Ok(target) => path = folder(&path).join(target),
            Err(_) => break,
        }
    }
    path
}

/// The folder that a file is in.
pub fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Whether two names lead to one existing file.
pub fn same(a: &Path, b: &Path) -> bool {
    matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

fn named(path: &Path, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_is_there_when_it_is_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out");
        let entries = || std::fs::read_dir(folder.path()).unwrap().count();
        let mut draft = Draft::create(&path).unwrap();
        draft.write_all(b"part").unwrap();
        assert!(!path.exists());
        drop(draft);
        assert_eq!(entries(), 0, "an abandoned draft leaves nothing");
        write(&path, b"all").unwrap();
        assert_eq!((entries(), std::fs::read(&path).unwrap()), (1, b"all".to_vec()));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let plain = folder.path().join("plain");
            std::fs::write(&plain, b"").unwrap();
            let mode = |p: &Path| std::fs::metadata(p).unwrap().permissions().mode();
            assert_eq!(mode(&path), mode(&plain), "readable by whom any new file is");
        }
        #[cfg(unix)]
        for target in ["there", "not yet"] {
            let link = folder.path().join(format!("link to {target}"));
            std::os::unix::fs::symlink(target, &link).unwrap();
            std::fs::write(folder.path().join("there"), b"old").unwrap();
            write(&link, b"new").unwrap();
            assert_eq!(std::fs::read(folder.path().join(target)).unwrap(), b"new");
            assert!(link.is_symlink(), "the link stays");
        }
        let error = write(&folder.path().join("absent/out"), b"").unwrap_err();
        assert!(error.to_string().contains("absent/out: "), "{error}");
    }
}
