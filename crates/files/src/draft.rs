//! Files that appear under their name only when they are whole.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;

use tempfile::NamedTempFile;

/// What the name of a draft begins with after the name of the file that it is to become.
const SUFFIX: &str = ".unfinished-";
/// Longest name that stands whole in that of a draft: names of up to 255 bytes are allowed.
const NAMED: usize = 200;
/// How long a file or folder without a lock may be about to be locked.
const YOUNG: Duration = Duration::from_secs(10);

/// A file under another name in the same folder, `.NAME.unfinished-XXXXXX`, until it is whole. Errors
/// name the file it is to become.
///
/// A process that is killed leaves its draft. The next one that writes to the folder removes it; it
/// tells drafts of living processes by their locks.
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
        let path = destination(path);
        remove_left(folder(&path));
        let prefix = hidden(&path, SUFFIX);
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // As any new file: the process's umask applies, where temporary files are private.
            builder.permissions(std::fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder(&path)).map_err(|e| refused(&path, &e))?;
        // Where a file system knows no locks, others cannot lock it either and leave it alone.
        let _ = file.as_file().try_lock();
        Ok(Self { path, file })
    }

    /// Another handle on the file.
    ///
    /// # Errors
    /// No more files can be opened.
    pub fn handle(&self) -> io::Result<File> {
        self.file.as_file().try_clone().map_err(|e| named(&self.path, &e))
    }

    /// Where the file is until it has its name.
    pub fn place(&self) -> &Path {
        self.file.path()
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

/// Removes the drafts that killed processes have left in a folder; looks at each folder once.
fn remove_left(folder: &Path) {
    static SEEN: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    if !SEEN.lock().unwrap_or_else(|e| e.into_inner()).insert(folder.into()) {
        return;
    }
    // What cannot be looked at cannot be tidied; whoever writes there will hear of it.
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        let name = name.to_string_lossy();
        let hidden = name.strip_prefix('.').and_then(|name| name.rsplit_once(SUFFIX));
        let Some((_, random)) = hidden else { continue };
        let ours = random.len() == 6 && random.bytes().all(|byte| byte.is_ascii_alphanumeric());
        if ours && is_left(&entry.path()) {
            let _ = std::fs::remove_file(entry.path());
        }
    }
}

/// Whether no living process holds the lock of a file or folder.
pub(crate) fn is_left(path: &Path) -> bool {
    let left = |file: File| {
        let modified = file.metadata().and_then(|meta| meta.modified());
        let age = modified.map(|modified| modified.elapsed().unwrap_or_default());
        age.is_ok_and(|age| age > YOUNG) && file.try_lock().is_ok()
    };
    File::open(path).is_ok_and(left)
}

/// Whether a path leads to a device that takes a stream of bytes, such as `/dev/null`: nothing is made beside it,
/// and nothing replaces it.
pub fn is_device(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        std::fs::metadata(path).is_ok_and(|found| found.file_type().is_char_device())
    }
    #[cfg(not(unix))]
    {
        let _ = path;
        false
    }
}

/// Opens such a device.
///
/// # Errors
/// It cannot be written; the error names it.
pub fn open_device(path: &Path) -> io::Result<File> {
    File::options().write(true).open(path).map_err(|e| named(path, &e))
}

/// Writes a file, whole or not at all; a device takes the bytes as they are.
///
/// # Errors
/// As those of [`Draft`].
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if is_device(path) {
        return open_device(path)?.write_all(bytes).map_err(|e| named(path, &e));
    }
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

/// What the name of something begins with that is beside a file for some time: `.NAME` and a suffix. Of a long name
/// it has the beginning and a hash of the whole.
pub fn hidden(path: &Path, suffix: &str) -> OsString {
    let name = path.file_name().unwrap_or_default();
    let mut prefix = OsString::from(".");
    match name.len() > NAMED {
        true => {
            let whole = crc32fast::hash(name.as_encoded_bytes());
            let name = name.to_string_lossy();
            prefix.push(format!("{}~{whole:08x}", &name[..name.floor_char_boundary(NAMED)]));
        }
        false => prefix.push(name),
    }
    prefix.push(suffix);
    prefix
}

/// Refuses the name of a folder, a name that the system does not allow, and a path in whose folder no file can be
/// made. What it makes to find out is gone again.
///
/// # Errors
/// The path and the reason.
pub fn check_place(path: &Path) -> io::Result<()> {
    if path.as_os_str().to_string_lossy().ends_with(std::path::is_separator) {
        let reason = "ends in a separator, but the output is a file";
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            format!("{}: {reason}", path.display()),
        ));
    }
    tempfile::tempfile_in(folder(path)).map(drop).map_err(|error| refused(path, &error))?;
    match path.symlink_metadata() {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(named(path, &error)),
        _ => Ok(()),
    }
}

/// Why a file cannot be made, without the name of its draft.
fn refused(path: &Path, error: &io::Error) -> io::Error {
    let folder = folder(path);
    let cause = error.get_ref().and_then(|wrapped| wrapped.source());
    let why = match error.kind() {
        io::ErrorKind::PermissionDenied => {
            format!("no permission to write into {}", folder.display())
        }
        io::ErrorKind::NotFound if !folder.is_dir() => {
            format!("there is no folder {}", folder.display())
        }
        _ => cause.map_or_else(|| error.to_string(), ToString::to_string),
    };
    io::Error::new(error.kind(), format!("{}: {why}", path.display()))
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

    /// Makes a file an hour old.
    fn age(path: &Path) -> File {
        let file = File::options().write(true).open(path).unwrap();
        file.set_modified(std::time::SystemTime::now() - Duration::from_secs(3600)).unwrap();
        file
    }

    #[test]
    fn a_folder_that_takes_no_file_is_named_and_its_draft_is_not() {
        let folder = tempfile::tempdir().unwrap();
        check_place(&folder.path().join("a.npz")).unwrap();
        let error = check_place(&folder.path().join("a.npz/")).unwrap_err().to_string();
        assert!(
            error.ends_with("a.npz/: ends in a separator, but the output is a file"),
            "{error}"
        );
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let gone = folder.path().join("gone");
        let path = gone.join("a.npz");
        for error in [check_place(&path).unwrap_err(), Draft::create(&path).map(drop).unwrap_err()]
        {
            let expected = format!("{}: there is no folder {}", path.display(), gone.display());
            assert_eq!(error.to_string(), expected);
        }
    }

    /// The draft's name was too long, which showed when all the work was done.
    #[test]
    fn names_of_any_length_that_the_system_allows_are_written() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["n".repeat(251) + ".npz", "\u{e9}".repeat(125) + ".npz"] {
            let path = folder.path().join(&name);
            check_place(&path).unwrap();
            write(&path, b"all").unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), b"all");
        }
        #[cfg(unix)]
        {
            let longer = folder.path().join("n".repeat(256));
            assert!(check_place(&longer).unwrap_err().to_string().contains("too long"));
        }
        let prefix = |end: &str| hidden(Path::new(&("n".repeat(210) + end)), SUFFIX);
        assert_ne!(prefix("a"), prefix("b"), "one is not taken for what the other has left");
    }

    #[test]
    fn what_killed_processes_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in
            [".a.model.unfinished-Ab3xY9", ".a.model.unfinished-notes", "a.unfinished-Ab3xY9"]
        {
            std::fs::write(at(name), b"part").unwrap();
            age(&at(name));
        }
        // Just begun by another process.
        std::fs::write(at(".a.unfinished-Ab3xY9"), b"part").unwrap();
        // Of a process that lives.
        std::fs::write(at(".b.unfinished-Ab3xY9"), b"part").unwrap();
        let alive = age(&at(".b.unfinished-Ab3xY9"));
        alive.lock().unwrap();
        let draft = Draft::create(&at("c.npz")).unwrap();
        let names = || {
            let entries = std::fs::read_dir(folder.path()).unwrap();
            let mut names: Vec<_> =
                entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
            names.sort();
            names
        };
        let now = names();
        let others = [".a.model.unfinished-notes", ".a.unfinished-Ab3xY9", ".b.unfinished-Ab3xY9"];
        assert_eq!(now[..3], others);
        assert!(now[3].starts_with(".c.npz.unfinished-"), "{now:?}");
        assert_eq!((&now[4], now.len()), (&"a.unfinished-Ab3xY9".to_string(), 5));
        draft.publish().unwrap();
        assert!(names().contains(&"c.npz".to_string()));
    }

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
