//! The `.npy` header: numpy's format versions 1.0, 2.0 and 3.0.
//!
//! Layout: `\x93NUMPY`, major, minor, header length (u16 in version 1, u32 after), then a Python
//! dictionary literal with the keys `descr`, `fortran_order` and `shape`, padded with spaces and a
//! newline to a multiple of 64 bytes (numpy.lib.format, numpy 2.x).

use std::fmt;
use std::io::Read;

use thiserror::Error;

mod decode;
mod file;
mod literal;

pub(crate) use decode::{Endian, array, components};
pub use file::NpyFile;

const MAGIC: &[u8; 6] = b"\x93NUMPY";
const ALIGNMENT: usize = 64;
/// Longest header text that is read; numpy's own default limit is 10,000.
const MAX_HEADER: usize = 65_536;
/// numpy's limit on the number of axes.
const MAX_AXES: usize = 64;
/// Longest axes, multiplied, of an array without data.
const MAX_EMPTY: u64 = 1 << 20;
/// Longest fixed-width string read, in bytes.
const MAX_STRING: usize = 1 << 26;

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
    #[error("holds Python objects (pickle), which are never read; save it as numbers")]
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

/// Kind of array element.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `b`: one byte, 0 or 1.
    Bool,
    /// `i`: two's complement.
    Int,
    /// `u`: unsigned.
    UInt,
    /// `f`: IEEE 754.
    Float,
    /// `c`: real and imaginary part.
    Complex,
    /// `U`: UTF-32 text of fixed width, padded with zeros.
    Text,
    /// `S`: bytes of fixed width, padded with zeros.
    Bytes,
}

/// Element type of an array.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct DType {
    /// Kind of element.
    pub kind: Kind,
    /// Bytes per element.
    pub itemsize: usize,
    /// Whether elements are stored most significant byte first.
    pub big_endian: bool,
}

impl DType {
    /// 32-bit floating point in this machine's byte order.
    pub const F32: Self = Self::native(Kind::Float, 4);
    /// 64-bit floating point in this machine's byte order.
    pub const F64: Self = Self::native(Kind::Float, 8);
    /// Complex of two 32-bit floats in this machine's byte order.
    pub const C64: Self = Self::native(Kind::Complex, 8);
    /// Bytes.
    pub const U8: Self = Self::native(Kind::UInt, 1);

    /// UTF-32 text of `width` characters, least significant byte first.
    pub const fn text(width: usize) -> Self {
        Self { kind: Kind::Text, itemsize: 4 * width, big_endian: false }
    }

    const fn native(kind: Kind, itemsize: usize) -> Self {
        Self { kind, itemsize, big_endian: cfg!(target_endian = "big") }
    }

    /// Reads numpy's type string, as `<f4`.
    ///
    /// # Errors
    /// [`NpyError::DType`] for types outside the list of [`Kind`], [`NpyError::Pickled`] for objects.
    pub fn parse(descr: &str) -> Result<Self, NpyError> {
        let unknown = || NpyError::DType { descr: descr.chars().take(40).collect() };
        let mut rest = descr.chars();
        let order = rest.next().ok_or_else(unknown)?;
        let kind = rest.next().ok_or_else(unknown)?;
        if kind == 'O' {
            return Err(NpyError::Pickled);
        }
        let size: usize = rest.as_str().parse().map_err(|_| unknown())?;
        let big_endian = match order {
            '<' | '|' => false,
            '>' => true,
            '=' => cfg!(target_endian = "big"),
            _ => return Err(unknown()),
        };
        let (kind, itemsize) = match (kind, size) {
            ('b', 1) => (Kind::Bool, 1),
            ('i', 1 | 2 | 4 | 8) => (Kind::Int, size),
            ('u', 1 | 2 | 4 | 8) => (Kind::UInt, size),
            ('f', 2 | 4 | 8) => (Kind::Float, size),
            ('c', 8 | 16) => (Kind::Complex, size),
            ('U', 0..=MAX_STRING) => (Kind::Text, 4 * size),
            ('S', 0..=MAX_STRING) => (Kind::Bytes, size),
            _ => return Err(unknown()),
        };
        Ok(Self { kind, itemsize, big_endian })
    }
}

impl fmt::Display for DType {
    /// numpy's type string, as `<f4`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let order = match (self.kind, self.itemsize, self.big_endian) {
            (Kind::Bool | Kind::Int | Kind::UInt, 1, _) | (Kind::Bytes, ..) => '|',
            (_, _, true) => '>',
            (_, _, false) => '<',
        };
        let (kind, size) = match self.kind {
            Kind::Bool => ('b', self.itemsize),
            Kind::Int => ('i', self.itemsize),
            Kind::UInt => ('u', self.itemsize),
            Kind::Float => ('f', self.itemsize),
            Kind::Complex => ('c', self.itemsize),
            Kind::Text => ('U', self.itemsize / 4),
            Kind::Bytes => ('S', self.itemsize),
        };
        write!(f, "{order}{kind}{size}")
    }
}

/// Order of the elements of an array in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Last axis fastest.
    C,
    /// First axis fastest.
    Fortran,
}

/// Everything that a `.npy` header says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Header {
    /// Element type.
    pub dtype: DType,
    /// Order of the elements.
    pub order: Order,
    /// Length of each axis; empty for a single number.
    pub shape: Vec<u64>,
}

impl Header {
    /// A header for elements of `dtype` in C order.
    pub fn new(dtype: DType, shape: &[usize]) -> Self {
        Self { dtype, order: Order::C, shape: shape.iter().map(|&n| n as u64).collect() }
    }

    /// The same array in Fortran order.
    pub fn fortran(self) -> Self {
        Self { order: Order::Fortran, ..self }
    }

    /// Number of elements.
    ///
    /// # Errors
    /// [`NpyError::TooLarge`] when elements or bytes overflow 63 bits.
    pub fn elements(&self) -> Result<u64, NpyError> {
        let product = self.shape.iter().try_fold(1u64, |total, &n| total.checked_mul(n));
        product
            .filter(|n| n.checked_mul(self.dtype.itemsize as u64).is_some_and(|b| b >> 63 == 0))
            .ok_or_else(|| NpyError::TooLarge {
                shape: self.shape.clone(),
                itemsize: self.dtype.itemsize,
            })
    }

    /// Bytes of the data behind the header.
    ///
    /// # Errors
    /// As [`Header::elements`].
    pub fn data_len(&self) -> Result<u64, NpyError> {
        Ok(self.elements()? * self.dtype.itemsize as u64)
    }

    /// The bytes before the data: as `numpy.save` writes them, a multiple of 64 long.
    pub fn encode(&self) -> Vec<u8> {
        let axes: Vec<String> = self.shape.iter().map(u64::to_string).collect();
        let shape = match axes.as_slice() {
            [one] => format!("({one},)"),
            several => format!("({})", several.join(", ")),
        };
        let order = if self.order == Order::Fortran { "True" } else { "False" };
        let mut text =
            format!("{{'descr': '{}', 'fortran_order': {order}, 'shape': {shape}, }}", self.dtype);
        // 64 axes of 20 digits stay far below the 65,535 bytes of version 1.0.
        let unpadded = MAGIC.len() + 4 + text.len() + 1;
        text.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(ALIGNMENT) - unpadded));
        text.push('\n');
        let mut bytes = MAGIC.to_vec();
        bytes.extend([1, 0]);
        bytes.extend((text.len() as u16).to_le_bytes());
        bytes.extend(text.as_bytes());
        bytes
    }

    /// Reads the header at the front of a stream and returns it with its length in bytes.
    ///
    /// # Errors
    /// [`NpyError`] names the byte, what was expected and what was found.
    pub fn read(reader: &mut impl Read) -> Result<(Self, u64), NpyError> {
        let mut front = [0u8; 8];
        read_exact(reader, &mut front, 0)?;
        if &front[..6] != MAGIC {
            return Err(malformed(
                0,
                "the magic bytes \\x93NUMPY",
                format!("{:02x?}", &front[..6]),
            ));
        }
        let length_bytes = match front[6] {
            1 => 2,
            2 | 3 => 4,
            other => return Err(malformed(6, "format version 1, 2 or 3", other)),
        };
        let mut length = [0u8; 4];
        read_exact(reader, &mut length[..length_bytes], 8)?;
        let length = u32::from_le_bytes(length) as usize;
        if length > MAX_HEADER {
            return Err(malformed(8, format!("at most {MAX_HEADER} bytes of header"), length));
        }
        let start = 8 + length_bytes as u64;
        let mut text = vec![0u8; length];
        read_exact(reader, &mut text, start)?;
        let header = literal::header(&text, start)?;
        // Without bytes behind it, a length is no more than the header's word.
        let axes = header.shape.iter().try_fold(1u64, |n, &axis| n.checked_mul(axis.max(1)));
        if header.data_len()? == 0 && axes.is_none_or(|n| n > MAX_EMPTY) {
            let (shape, itemsize) = (header.shape, header.dtype.itemsize);
            return Err(NpyError::TooLarge { shape, itemsize });
        }
        Ok((header, start + length as u64))
    }
}

fn malformed(offset: u64, expected: impl Into<String>, actual: impl fmt::Display) -> NpyError {
    NpyError::Malformed { offset, expected: expected.into(), actual: actual.to_string() }
}

fn read_exact(reader: &mut impl Read, buffer: &mut [u8], offset: u64) -> Result<(), NpyError> {
    reader.read_exact(buffer).map_err(|error| match error.kind() {
        std::io::ErrorKind::UnexpectedEof => {
            malformed(offset, format!("{} more bytes", buffer.len()), "the end")
        }
        _ => NpyError::Io(error),
    })
}

#[cfg(test)]
mod tests;
