//! The `.npy` header: numpy's format versions 1.0, 2.0 and 3.0.
//!
//! Layout: `\x93NUMPY`, major, minor, header length (u16 in version 1, u32 after), then a Python
//! dictionary literal with the keys `descr`, `fortran_order` and `shape`, padded with spaces and a
//! newline to a multiple of 64 bytes (numpy.lib.format, numpy 2.x).

mod decode;
mod dtype;
mod error;
mod file;
mod header;
mod literal;
mod read;

pub(crate) use decode::{Endian, array, components};
pub use dtype::{DType, Kind};
pub use error::NpyError;
pub use file::NpyFile;
pub use header::{Header, Order};

#[cfg(test)]
mod tests;
