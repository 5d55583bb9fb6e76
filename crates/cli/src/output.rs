//! Where lines go that are written as they come.

use std::io::{self, Write};
use std::path::Path;

use corsmal_files::draft::Draft;

use crate::failure::Failure;

/// Standard output, line by line, or a file that appears when it is whole.
pub enum Output {
    /// Standard output.
    Stdout(io::Stdout),
    /// A file.
    File(Draft),
}

impl Output {
    /// `-` is standard output.
    pub fn open(path: &Path) -> Result<Self, Failure> {
        if path == Path::new("-") {
            Ok(Self::Stdout(io::stdout()))
        } else {
            Ok(Self::File(Draft::create(path)?))
        }
    }

    /// Gives a file its name.
    pub fn publish(self) -> io::Result<()> {
        match self {
            Self::Stdout(_) => Ok(()),
            Self::File(draft) => draft.publish(),
        }
    }
}

impl Write for Output {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self {
            Self::Stdout(out) => out.write(bytes),
            Self::File(draft) => draft.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Stdout(out) => out.flush(),
            // A file is read when it has its name.
            Self::File(_) => Ok(()),
        }
    }
}
