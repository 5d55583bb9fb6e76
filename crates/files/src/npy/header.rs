//! What a header says, and its bytes.

use super::dtype::DType;
use super::error::NpyError;

pub(super) const MAGIC: &[u8; 6] = b"\x93NUMPY";

const ALIGNMENT: usize = 64;

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

    /// Bytes of the data after the header.
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
}
