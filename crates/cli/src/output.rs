//! Where tables go: standard output, a device, or a file that appears when it is whole.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use corsmal_files::draft::{self, Draft};

use crate::failure::Failure;

/// Names of standard output beside `-`.
const STDOUT: [&str; 3] = ["/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];

/// Whether a path stands for standard output.
pub fn is_stdout(path: &Path) -> bool {
    path == Path::new("-") || (cfg!(unix) && STDOUT.iter().any(|name| path == Path::new(name)))
}

/// Writes a table.
pub fn write(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if is_stdout(path) {
        print!("{}", String::from_utf8_lossy(bytes));
        return Ok(());
    }
    draft::write(path, bytes)
}

/// Whether what is written there is delivered at once, and not when all of it is there.
pub fn is_delivered(path: &Path) -> bool {
    is_stdout(path) || draft::is_device(path)
}

/// Where lines go that are written as they come.
pub enum Output {
    /// Standard output.
    Stdout(io::Stdout),
    /// A device.
    Device(PathBuf, File),
    /// A file.
    File(Draft),
}

impl Output {
    /// Begins it.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        if is_stdout(path) {
            Ok(Self::Stdout(io::stdout()))
        } else if draft::is_device(path) {
            Ok(Self::Device(path.into(), draft::open_device(path)?))
        } else {
            Ok(Self::File(Draft::create(path)?))
        }
    }

    /// Gives a file its name.
    pub fn publish(self) -> io::Result<()> {
        match self {
            Self::Stdout(_) | Self::Device(..) => Ok(()),
            Self::File(draft) => draft.publish(),
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Stdout(out) => out.write(bytes).map_err(|e| of("standard output", &e)),
            Self::Device(path, device) => {
                device.write(bytes).map_err(|e| of(&path.display().to_string(), &e))
            }
            Self::File(draft) => draft.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Stdout(out) => out.flush().map_err(|e| of("standard output", &e)),
            // A device has them already; a file is read when it has its name.
            Self::Device(..) | Self::File(_) => Ok(()),
        }
    }
}

/// An error with the place where it came from.
fn of(place: &str, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{place}: {error}"))
}
