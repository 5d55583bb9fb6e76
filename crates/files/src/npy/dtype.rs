//! Types of array elements.

use std::fmt;

use super::error::NpyError;

/// Longest fixed-width string read, in bytes.
const MAX_STRING: usize = 1 << 26;

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
