//! What is wrong with a `.npy` stream.

use std::fmt;

use thiserror::Error;

/// What is wrong with a `.npy` stream.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NpyError {
    /// The bytes contradict the format.
    #[error("byte {offset}: expected {expected}, found {actual}")]
    Malformed {
        /// Byte within the `.npy` stream.
        offset: u64,
        /// What the format asks for.
        expected: String,
        /// What is there.
        actual: String,
    },
    /// Python objects: only unpickling could read them, which runs code.
    #[error("holds Python objects (pickle), which are never read; save the array as numbers")]
    Pickled,
    /// The elements are not what was asked for.
    #[error("expected {expected}, found {actual}")]
    Kind {
        /// What was asked for.
        expected: &'static str,
        /// Type and shape that are there.
        actual: String,
    },
    /// The element type is not one that is read here.
    #[error(
        "element type {descr:?} is not read; expected one of b1, i1-i8, u1-u8, f2-f8, c8, c16, U, S"
    )]
    DType {
        /// The `descr` of the header.
        descr: String,
    },
    /// The shape multiplies to more bytes than can be addressed.
    #[error("shape {shape:?} of {itemsize}-byte elements is too large")]
    TooLarge {
        /// The shape of the header.
        shape: Vec<u64>,
        /// Bytes per element.
        itemsize: usize,
    },
    /// Reading failed.
    #[error("cannot read: {0}")]
    Io(#[from] std::io::Error),
}

pub(super) fn malformed(
    offset: u64,
    expected: impl Into<String>,
    actual: impl fmt::Display,
) -> NpyError {
    NpyError::Malformed { offset, expected: expected.into(), actual: actual.to_string() }
}
