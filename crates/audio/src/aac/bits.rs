//! Bits of a packet, the first one in the highest place.

/// Reads numbers of a few bits.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bits<'a> {
    bytes: &'a [u8],
    /// The bit that comes next.
    at: usize,
}

impl<'a> Bits<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes, at: 0 }
    }

    /// The same bytes from bit `at` on.
    pub(super) fn from(bytes: &'a [u8], at: usize) -> Self {
        Self { bytes, at }
    }

    /// The next `n` bits, 32 at most; `None` where there are fewer.
    pub(super) fn take(&mut self, n: usize) -> Option<u32> {
        let mut value = 0u32;
        for at in self.at..self.at + n {
            let byte = self.bytes.get(at / 8)?;
            value = value << 1 | u32::from(byte >> (7 - at % 8) & 1);
        }
        self.at += n;
        Some(value)
    }
}
