//! Names in the folder of a partitioned output.

use std::fs::DirEntry;
use std::io;
use std::path::{Path, PathBuf};

/// Name of the file in each subfolder.
pub const FILE: &str = "part.parquet";
/// The value that stands for none, as Hive has it.
pub(super) const NONE: &str = "__HIVE_DEFAULT_PARTITION__";
/// Files that file managers and engines put beside parts.
const BESIDE: [&str; 6] =
    [".DS_Store", "Thumbs.db", "desktop.ini", "_SUCCESS", "_metadata", "_common_metadata"];

/// Name of the subfolder of a value.
pub fn folder(label: &str, value: &str) -> String {
    let value = if value.is_empty() { NONE.into() } else { encoded(value) };
    format!("{}={value}", encoded(label))
}

/// Percent encoding of all but letters, digits and `-._~`; readers of Hive folders decode it.
fn encoded(text: &str) -> String {
    let mut name = String::new();
    for byte in text.bytes() {
        match byte {
            b'0'..=b'9' | b'a'..=b'z' | b'A'..=b'Z' | b'-' | b'.' | b'_' | b'~' => {
                name.push(char::from(byte));
            }
            _ => name.push_str(&format!("%{byte:02X}")),
        }
    }
    name
}

/// What is in a folder, but for [`BESIDE`].
fn entries(path: &Path) -> io::Result<Vec<DirEntry>> {
    let is_beside = |entry: &DirEntry| {
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        is_file && entry.file_name().to_str().is_some_and(|name| BESIDE.contains(&name))
    };
    path.read_dir()?.filter(|entry| !entry.as_ref().is_ok_and(is_beside)).collect()
}

/// The files of a folder, sorted by name, where it is a partitioned output and nothing else.
pub(super) fn files(path: &Path) -> io::Result<Option<Vec<PathBuf>>> {
    let mut files = Vec::new();
    for entry in entries(path)? {
        let file = entry.path().join(FILE);
        let is_part = entry.file_name().to_str().is_some_and(|name| name.contains('='));
        if !is_part || !file.is_file() || entries(&entry.path())?.len() != 1 {
            return Ok(None);
        }
        files.push(file);
    }
    files.sort_unstable();
    Ok((!files.is_empty()).then_some(files))
}

/// Whether a path is the folder of a partitioned output, by the names in it.
pub fn is_partitioned(path: &Path) -> bool {
    path.is_dir() && files(path).is_ok_and(|files| files.is_some())
}
