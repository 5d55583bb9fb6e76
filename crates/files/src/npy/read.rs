//! Reading a header that anyone may have written.

use std::io::Read;

use super::error::{NpyError, malformed};
use super::header::{Header, MAGIC};
use super::literal;

/// Longest header text that is read; numpy's own default limit is 10,000.
const MAX_HEADER: usize = 65_536;

/// Longest axes, multiplied, of an array without data.
const MAX_EMPTY: u64 = 1 << 20;

impl Header {
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
        // Without bytes after it, a length is no more than the header's word.
        let axes = header.shape.iter().try_fold(1u64, |n, &axis| n.checked_mul(axis.max(1)));
        if header.data_len()? == 0 && axes.is_none_or(|n| n > MAX_EMPTY) {
            let (shape, itemsize) = (header.shape, header.dtype.itemsize);
            return Err(NpyError::TooLarge { shape, itemsize });
        }
        Ok((header, start + length as u64))
    }
}

fn read_exact(reader: &mut impl Read, buffer: &mut [u8], offset: u64) -> Result<(), NpyError> {
    reader.read_exact(buffer).map_err(|error| match error.kind() {
        std::io::ErrorKind::UnexpectedEof => {
            malformed(offset, format!("{} more bytes", buffer.len()), "the end")
        }
        _ => NpyError::Io(error),
    })
}
