//! Files that are held in memory whole.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

/// Reads a file, pipe or device of at most `most` bytes, regardless of the size that the system
/// reports: devices have none, and files grow.
///
/// # Errors
/// [`io::ErrorKind::FileTooLarge`], and whatever opening and reading report.
pub fn read(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let size = file.metadata()?.len();
    if size > most {
        return Err(too_large(format!("{size} bytes; at most {most} are read")));
    }
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(size as usize)?;
    file.take(most + 1).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > most {
        true => Err(too_large(format!("it does not end within the {most} bytes that are read"))),
        false => Ok(bytes),
    }
}

/// As [`read`], of UTF-8.
///
/// # Errors
/// As [`read`], and [`io::ErrorKind::InvalidData`].
pub fn read_text(path: &Path, most: u64) -> io::Result<String> {
    let bytes = read(path, most)?;
    String::from_utf8(bytes).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e.utf8_error()))
}

fn too_large(reason: String) -> io::Error {
    io::Error::new(io::ErrorKind::FileTooLarge, reason)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_more_is_read_than_the_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        std::fs::write(&path, "four").unwrap();
        assert_eq!(read(&path, 4).unwrap(), b"four");
        assert_eq!(read_text(&path, 9).unwrap(), "four");
        let large = read(&path, 3).unwrap_err();
        assert_eq!(large.kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(large.to_string(), "4 bytes; at most 3 are read");
        std::fs::write(&path, [0xff]).unwrap();
        assert_eq!(read_text(&path, 9).unwrap_err().kind(), io::ErrorKind::InvalidData);
        assert!(read(&folder.path().join("b"), 9).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn endless_devices_end() {
        let endless = read(Path::new("/dev/zero"), 1 << 20).unwrap_err();
        assert_eq!(endless.to_string(), "it does not end within the 1048576 bytes that are read");
    }
}
