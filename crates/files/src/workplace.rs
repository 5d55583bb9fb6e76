//! Hidden folders in which results wait until they are whole.

use std::fs::File;
use std::io;
use std::path::Path;

use tempfile::TempDir;

use crate::draft::is_left;

/// A hidden folder, removed when it is dropped. A process that is killed leaves it; the next one that makes such a
/// folder there removes it, and tells those of living processes by their locks.
#[derive(Debug)]
pub struct Workplace {
    folder: TempDir,
    // Where a file system knows no locks, others cannot lock it either and leave it alone.
    _lock: Option<File>,
}

impl Workplace {
    /// Makes one in the folder `within`, with a name that begins with `prefix`.
    ///
    /// # Errors
    /// No folder can be made there.
    pub fn create(within: &Path, prefix: &str) -> io::Result<Self> {
        remove_left(within, prefix);
        let folder = tempfile::Builder::new().prefix(prefix).tempdir_in(within)?;
        let lock = File::open(folder.path()).ok();
        lock.iter().for_each(|lock| drop(lock.try_lock()));
        Ok(Self { folder, _lock: lock })
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes what killed processes have left of such folders in the folder `within`.
pub fn remove_left(within: &Path, prefix: &str) {
    // What cannot be looked at cannot be tidied; whoever writes there will hear of it.
    for entry in std::fs::read_dir(within).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let random = name.as_encoded_bytes().strip_prefix(prefix.as_bytes());
        let is_ours =
            random.is_some_and(|r| r.len() == 6 && r.iter().all(u8::is_ascii_alphanumeric));
        if is_ours && entry.path().is_dir() && is_left(&entry.path()) {
            let _ = std::fs::remove_dir_all(entry.path());
        }
    }
}

#[cfg(unix)]
#[cfg(test)]
mod tests {
    use std::time::{Duration, SystemTime};

    use super::*;

    /// Makes a folder look an hour old.
    fn age(path: &Path) -> File {
        let folder = File::open(path).unwrap();
        folder.set_modified(SystemTime::now() - Duration::from_secs(3600)).unwrap();
        folder
    }

    #[test]
    fn what_killed_processes_left_is_removed_and_nothing_else() {
        let within = tempfile::tempdir().unwrap();
        let at = |name: &str| within.path().join(name);
        for name in [".x-killed", ".x-living", ".x-newest", ".x-mine", ".y-others"] {
            std::fs::create_dir(at(name)).unwrap();
            std::fs::write(at(name).join("part"), b"part").unwrap();
        }
        let living = age(&at(".x-living"));
        living.lock().unwrap();
        [".x-killed", ".x-mine", ".y-others"].iter().for_each(|name| drop(age(&at(name))));
        let made = Workplace::create(within.path(), ".x-").unwrap();
        assert!(!at(".x-killed").exists());
        let others = [".x-living", ".x-newest", ".x-mine", ".y-others"];
        assert!(others.iter().all(|name| at(name).is_dir()));
        let path = made.path().to_path_buf();
        drop(age(&path));
        remove_left(within.path(), ".x-");
        assert!(path.is_dir(), "its own lock holds");
        drop(made);
        assert!(!path.exists());
    }
}
