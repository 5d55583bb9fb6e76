//! Expands globs. The `glob` crate understands the patterns; its own walk panics on names that are
//! not UTF-8.

use std::io;
use std::path::{Component, Path, PathBuf};

use glob::{MatchOptions, Pattern};
use walkdir::WalkDir;

use super::error::InputError;
use super::folder::{is_hidden, unless_harmless};

const OPTIONS: MatchOptions = MatchOptions {
    case_sensitive: true,
    require_literal_separator: true,
    require_literal_leading_dot: true,
};

/// Whether a name may be a glob.
pub(super) fn is_glob(name: &str) -> bool {
    name.contains(['*', '?', '['])
}

/// The part of a glob before its first wildcard.
pub(super) fn root(pattern: &str) -> PathBuf {
    let literal = |part: &Component<'_>| !is_glob(&part.as_os_str().to_string_lossy());
    Path::new(pattern).components().take_while(literal).collect()
}

/// Files and folders that a glob matches. `**` stands for any number of folders.
///
/// # Errors
/// [`InputError::Glob`] names the pattern, [`InputError::Io`] a folder that cannot be read.
pub(super) fn expand(pattern: &str) -> Result<Vec<PathBuf>, InputError> {
    let not_a_glob =
        |e: glob::PatternError| InputError::Glob { pattern: pattern.into(), reason: e.to_string() };
    // As a whole first, for the position in the message.
    Pattern::new(pattern).map_err(not_a_glob)?;
    let root = root(pattern);
    let parts: Vec<_> = Path::new(pattern).components().skip(root.components().count()).collect();
    let mut found = vec![root];
    for part in parts {
        let text = part.as_os_str().to_string_lossy();
        let mut next = Vec::new();
        if text == "**" {
            found.iter().try_for_each(|path| folders(path, &mut next))?;
        } else if is_glob(&text) {
            let part = Pattern::new(&text).map_err(not_a_glob)?;
            found.iter().try_for_each(|path| entries(path, &part, &mut next))?;
        } else {
            let there = found.iter().map(|path| path.join(part)).filter(|path| path.exists());
            next.extend(there);
        }
        found = next;
    }
    // `**` matches the current folder, too: all others lie in it.
    if found.iter().any(|path| path.as_os_str().is_empty()) {
        found = vec![PathBuf::from(".")];
    }
    Ok(found)
}

/// A glob of keys of objects.
pub(super) struct Keys(Pattern);

impl Keys {
    /// # Errors
    /// [`InputError::Glob`] names the pattern.
    pub(super) fn new(pattern: &str) -> Result<Self, InputError> {
        let compiled = Pattern::new(pattern)
            .map_err(|e| InputError::Glob { pattern: pattern.into(), reason: e.to_string() })?;
        Ok(Self(compiled))
    }

    /// Whether it matches the key.
    pub(super) fn matches(&self, key: &str) -> bool {
        self.0.matches_with(key, OPTIONS)
    }

    /// Whether it matches a folder that the object lies in.
    pub(super) fn matches_above(&self, key: &str) -> bool {
        key.match_indices('/').any(|(end, _)| self.matches(&key[..end]))
    }
}

/// The entries of a folder that match.
fn entries(folder: &Path, part: &Pattern, found: &mut Vec<PathBuf>) -> Result<(), InputError> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    if !here.is_dir() {
        return Ok(());
    }
    let failed = |e: io::Error| InputError::io(here, e);
    for entry in here.read_dir().map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        if part.matches_with(&name.to_string_lossy(), OPTIONS) {
            found.push(folder.join(name));
        }
    }
    Ok(())
}

/// A folder and all folders below it that are not hidden.
fn folders(folder: &Path, found: &mut Vec<PathBuf>) -> Result<(), InputError> {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let visible = |entry: &walkdir::DirEntry| !is_hidden(entry);
    for entry in WalkDir::new(here).follow_links(true).into_iter().filter_entry(visible) {
        match entry {
            Ok(entry) if entry.file_type().is_dir() => {
                let below = entry.path().strip_prefix(here).unwrap_or(entry.path());
                found.push(folder.join(below));
            }
            Ok(_) => {}
            Err(error) => unless_harmless(folder, error)?,
        }
    }
    Ok(())
}
