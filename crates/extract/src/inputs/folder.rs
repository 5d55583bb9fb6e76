//! The recordings in a folder.

use std::fs::File;
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use walkdir::WalkDir;

use super::error::InputError;

/// Extension of tar archives.
pub(super) const ARCHIVE: &str = "tar";

/// Appends the audio files at or below `path`, to `skipped` those whose formats are not read, and to
/// `archives` the tars below it.
pub(super) fn walk(
    path: &Path,
    files: &mut Vec<PathBuf>,
    (skipped, archives): (&mut Vec<PathBuf>, &mut Vec<PathBuf>),
) -> Result<(), InputError> {
    let is_audio = |path: &Path| has_extension(path, &corsmal_audio::EXTENSIONS);
    let visible = |entry: &walkdir::DirEntry| !is_hidden(entry);
    for entry in WalkDir::new(path).follow_links(true).into_iter().filter_entry(visible) {
        match entry {
            Ok(entry) if entry.file_type().is_file() && is_audio(entry.path()) => {
                files.push(entry.into_path());
            }
            Ok(entry) => {
                let is_other = has_extension(entry.path(), &corsmal_audio::OTHER_EXTENSIONS);
                match entry.file_type().is_file() {
                    true if is_other => skipped.push(entry.into_path()),
                    true if has_extension(entry.path(), &[ARCHIVE]) => {
                        archives.push(entry.into_path())
                    }
                    _ => {}
                }
            }
            Err(error) => {
                let at = error.path().map(Path::to_path_buf);
                let is_loop = error.loop_ancestor().is_some();
                let below = error.depth() > 0;
                match unless_harmless(path, error) {
                    // A dangling link to a recording, which will fail on its own.
                    Ok(()) => files.extend(at.filter(|at| !is_loop && is_audio(at))),
                    // So will a folder that cannot be read: the others do not have to wait for it.
                    Err(_) if below => files.extend(at),
                    Err(error) => return Err(error),
                }
            }
        }
    }
    Ok(())
}

/// Whether an entry below a folder that was named is skipped.
pub(super) fn is_hidden(entry: &walkdir::DirEntry) -> bool {
    entry.depth() > 0 && entry.file_name().as_encoded_bytes().starts_with(b".")
}

/// Whether a file holds what macOS puts beside another one, `._x.wav` beside `x.wav`: by name and by
/// content, since a recording may have such a name, too.
pub(super) fn is_apple_double(path: &Path) -> bool {
    let is_named = path.file_name().is_some_and(|n| n.as_encoded_bytes().starts_with(b"._"));
    let mut mark = [0; 4];
    is_named
        && File::open(path).and_then(|mut file| file.read_exact(&mut mark)).is_ok()
        && mark == *b"\0\x05\x16\x07"
}

/// Passes over links back to a folder that is being searched, and links to nothing.
pub(super) fn unless_harmless(folder: &Path, error: walkdir::Error) -> Result<(), InputError> {
    let at = error.path().unwrap_or(folder).to_path_buf();
    let is_loop = error.loop_ancestor().is_some();
    match io::Error::from(error) {
        _ if is_loop => Ok(()),
        error if error.kind() == io::ErrorKind::NotFound => Ok(()),
        error => Err(InputError::io(&at, error)),
    }
}

/// Whether a file has one of these extensions, in capital letters or not.
pub(super) fn has_extension(path: &Path, extensions: &[&str]) -> bool {
    path.extension().is_some_and(|e| extensions.iter().any(|x| e.eq_ignore_ascii_case(x)))
}
