//! Headers of MPEG audio frames (ISO 11172-3, 13818-3 and the 2.5 extension).

/// Bytes of a frame header.
pub(crate) const HEADER: usize = 4;
/// Largest frame: layer 2 with 384 kbit/s at 32 kHz, or layer 3 with 160 kbit/s at 8 kHz.
pub(crate) const MAX_FRAME: usize = 2881;

const KBITS: [[u16; 15]; 5] = [
    // MPEG 1, layers 1, 2, 3; MPEG 2 and 2.5, layers 1, 2 and 3.
    [0, 32, 64, 96, 128, 160, 192, 224, 256, 288, 320, 352, 384, 416, 448],
    [0, 32, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320, 384],
    [0, 32, 40, 48, 56, 64, 80, 96, 112, 128, 160, 192, 224, 256, 320],
    [0, 32, 48, 56, 64, 80, 96, 112, 128, 144, 160, 176, 192, 224, 256],
    [0, 8, 16, 24, 32, 40, 48, 56, 64, 80, 96, 112, 128, 144, 160],
];

/// What a frame header says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Header {
    /// 1, 2 or 3.
    pub(crate) layer: u8,
    /// MPEG 1, with its larger frames; otherwise 2 or 2.5.
    pub(crate) mpeg1: bool,
    pub(crate) sample_rate: u32,
    pub(crate) channels: u16,
    /// Free format: the header does not tell the size of the frame, [`Header::sized`] does.
    pub(crate) is_free: bool,
    /// Bits per second; 0 where the size is not known.
    pub(crate) bit_rate: u32,
    /// Bytes of the frame with its header; 0 where it is not known.
    pub(crate) size: usize,
    /// Bytes of padding in it.
    padding: usize,
    /// Samples per channel.
    pub(crate) samples: usize,
}

impl Header {
    /// Reads a header from the start of `bytes`; `None` where there is none.
    pub(crate) fn parse(bytes: &[u8]) -> Option<Self> {
        let &[sync, b1, b2, b3] = bytes.first_chunk::<HEADER>()?;
        if sync != 0xff || b1 & 0xe0 != 0xe0 {
            return None;
        }
        // Rates of MPEG 1 are halved for 2 and halved again for 2.5.
        let halvings = match b1 >> 3 & 3 {
            0 => 2,
            2 => 1,
            3 => 0,
            _ => return None,
        };
        let layer = match b1 >> 1 & 3 {
            0 => return None,
            code => 4 - code,
        };
        let mpeg1 = halvings == 0;
        let row = row(mpeg1, layer);
        let bit_rate = 1000 * u32::from(*KBITS[row].get(usize::from(b2 >> 4))?);
        let sample_rate = [44_100, 48_000, 32_000].get(usize::from(b2 >> 2 & 3))? >> halvings;
        let padding = usize::from(b2 >> 1 & 1);
        let samples = match layer {
            1 => 384,
            3 if !mpeg1 => 576,
            _ => 1152,
        };
        let slot = if layer == 1 { 4 } else { 1 };
        let size = slots(samples, slot, bit_rate, sample_rate) + padding * slot;
        Some(Self {
            layer,
            mpeg1,
            sample_rate,
            channels: if b3 >> 6 == 3 { 1 } else { 2 },
            is_free: bit_rate == 0,
            bit_rate,
            size: if bit_rate == 0 { 0 } else { size },
            padding: padding * slot,
            samples,
        })
    }

    /// The header with the size that a frame of free format has: `plain` bytes without padding, 0
    /// where it is not known.
    pub(crate) fn sized(mut self, plain: usize) -> Self {
        if self.is_free && plain > 0 {
            self.size = plain + self.padding;
            let bits = plain as u64 * 8 * u64::from(self.sample_rate);
            self.bit_rate = (bits / self.samples as u64) as u32;
        }
        self
    }

    /// Bytes of the largest frame without padding that has a bit rate of the standard.
    pub(crate) fn largest_size(&self) -> usize {
        let kbits = KBITS[row(self.mpeg1, self.layer)][14];
        slots(self.samples, self.slot(), 1000 * u32::from(kbits), self.sample_rate)
    }

    /// Bytes of a frame of the same bit rate without padding.
    pub(crate) fn plain_size(&self) -> usize {
        self.size - self.padding
    }

    /// Bytes of padding, where there is some.
    fn slot(&self) -> usize {
        if self.layer == 1 { 4 } else { 1 }
    }

    /// The sizes that a frame of this recording can have.
    pub(crate) fn sizes(self) -> impl Iterator<Item = usize> {
        let slot = self.slot();
        let rates = KBITS[row(self.mpeg1, self.layer)].iter().skip(1);
        let plain = move |kbits: &u16| {
            slots(self.samples, slot, 1000 * u32::from(*kbits), self.sample_rate)
        };
        let own = self.is_free.then(|| self.plain_size());
        own.into_iter().chain(rates.map(plain)).flat_map(move |size| [size, size + slot])
    }

    /// Whether frames with these headers can follow each other in one recording.
    pub(crate) fn continues(&self, other: &Self) -> bool {
        self.is_alike(other) && self.is_free == other.is_free
    }

    /// Whether frames with these headers sound alike, of free format or not.
    pub(crate) fn is_alike(&self, other: &Self) -> bool {
        self.layer == other.layer
            && self.mpeg1 == other.mpeg1
            && self.sample_rate == other.sample_rate
            && self.channels == other.channels
    }

    /// Bytes of side information after the header of layer 3.
    pub(crate) fn side_info(&self) -> usize {
        match (self.mpeg1, self.channels) {
            (true, 1) | (false, 2) => 17,
            (true, _) => 32,
            (false, _) => 9,
        }
    }
}

/// The row of [`KBITS`].
fn row(mpeg1: bool, layer: u8) -> usize {
    match (mpeg1, layer) {
        (true, layer) => usize::from(layer) - 1,
        (false, 1) => 3,
        (false, _) => 4,
    }
}

/// Bytes of a frame without padding: a whole number of slots.
fn slots(samples: usize, slot: usize, bit_rate: u32, sample_rate: u32) -> usize {
    samples / 8 / slot * bit_rate as usize / sample_rate as usize * slot
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_and_rates_are_those_of_the_standard() {
        let header = |bytes: [u8; 4]| Header::parse(&bytes).unwrap();
        let h = header([0xff, 0xfb, 0x90, 0x64]);
        assert_eq!((h.layer, h.sample_rate, h.channels), (3, 44_100, 2));
        assert_eq!((h.bit_rate, h.size, h.samples, h.side_info()), (128_000, 417, 1152, 32));
        assert_eq!(header([0xff, 0xfb, 0x92, 0x64]).size, 418);
        // MPEG 2.5, layer 3, 8 kHz mono.
        let h = header([0xff, 0xe3, 0x18, 0xc4]);
        assert_eq!((h.sample_rate, h.channels, h.size, h.samples), (8000, 1, 72, 576));
        assert_eq!(h.side_info(), 9);
        let h = header([0xff, 0xff, 0x10, 0x00]);
        assert_eq!((h.layer, h.size, h.samples), (1, 32, 384));
        assert_eq!(header([0xff, 0xfb, 0x00, 0x64]).size, 0);
    }

    #[test]
    fn reserved_values_are_no_header() {
        for bytes in [[0xff, 0xeb, 0x90, 0], [0xff, 0xf9, 0x90, 0], [0xff, 0xfb, 0xf0, 0]] {
            assert_eq!(Header::parse(&bytes), None);
        }
        assert_eq!(Header::parse(&[0xff, 0xfb, 0x9c, 0]), None);
        assert_eq!(Header::parse(&[0xff, 0xfb, 0x90]), None);
    }

    #[test]
    fn no_frame_is_larger_than_the_largest() {
        let all = (0..=u16::MAX).filter_map(|n| Header::parse(&[0xff, (n >> 8) as u8, n as u8, 0]));
        assert_eq!(all.map(|h| h.size).max(), Some(MAX_FRAME));
    }
}
