//! One spelling for each path.

use std::path::{Component, Path, PathBuf};

/// The path without `.` and without folders that `..` leaves again, so that `a/../a/x` and `a/x` are
/// one. Nothing is looked up: links count as folders. Addresses such as `s3://bucket/x` stay.
pub fn plain(path: &str) -> String {
    if path.contains("://") {
        return path.into();
    }
    plain_path(Path::new(path)).to_string_lossy().into_owned()
}

/// As [`plain`], of a path that is no address.
pub fn plain_path(path: &Path) -> PathBuf {
    let mut plain = PathBuf::new();
    for part in path.components() {
        match part {
            Component::CurDir => {}
            Component::ParentDir if plain.file_name().is_some() => {
                plain.pop();
            }
            part => plain.push(part),
        }
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings_of_one_path_are_one() {
        for (path, expected) in [
            ("a/x.wav", "a/x.wav"),
            ("./a/./x.wav", "a/x.wav"),
            ("a/../a//x.wav", "a/x.wav"),
            ("../a/x.wav", "../a/x.wav"),
            ("a/../../x.wav", "../x.wav"),
            ("s3://lab/a/../x.wav", "s3://lab/a/../x.wav"),
            ("-", "-"),
        ] {
            assert_eq!(plain(path), expected, "{path}");
        }
    }
}
