//! The headers of Vorbis (Vorbis I specification, section 4.2): what the length of a packet depends
//! on, which decoder fits, and limits.

/// Packet types of the headers.
const IDENTIFICATION: &[u8] = b"\x01vorbis";
const SETUP: &[u8] = b"\x05vorbis";

/// What the identification packet says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Identification {
    pub(super) channels: u8,
    pub(super) sample_rate: u32,
    /// Samples of a short and of a long block.
    pub(super) blocks: [u32; 2],
}

impl Identification {
    /// `None` where it is none.
    pub(super) fn parse(packet: &[u8]) -> Option<Self> {
        let body = packet.strip_prefix(IDENTIFICATION)?;
        let &[_, _, _, _, channels, r0, r1, r2, r3] = body.first_chunk::<9>()?;
        let exponents = *body.get(21)?;
        let blocks = [exponents & 15, exponents >> 4].map(|e| 1 << e);
        Some(Self { channels, sample_rate: u32::from_le_bytes([r0, r1, r2, r3]), blocks })
    }
}

/// Values that all codebooks may have together: a hundred times what encoders use.
const MAX_VALUES: u64 = 1 << 22;

/// What the setup packet says.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Setup {
    /// Whether packets of each mode are long blocks.
    pub(super) modes: Vec<bool>,
    /// Whether symphonia 0.6.1 decodes it rightly. With more than two channels it undoes coupling in
    /// the wrong order (specification, 4.3.5); with more than one and residues of type 0 or 1 it
    /// overwrites classes of the next channel (8.6.2).
    pub(super) is_simple: bool,
}

impl Setup {
    /// `None` where the packet is broken or asks for more memory than any encoder does.
    pub(super) fn parse(packet: &[u8], channels: u8) -> Option<Self> {
        if !packet.starts_with(SETUP) || channels == 0 {
            return None;
        }
        let mut bits = Bits { bytes: packet, at: 8 * SETUP.len() };
        let mut values = 0;
        for _ in 0..=bits.take(8)? {
            values += codebook(&mut bits)?;
            if values > MAX_VALUES {
                return None;
            }
        }
        for _ in 0..=bits.take(6)? {
            bits.skip(16)?;
        }
        for _ in 0..=bits.take(6)? {
            floor(&mut bits)?;
        }
        let mut residues = Vec::new();
        for _ in 0..=bits.take(6)? {
            residues.push(residue(&mut bits)?);
        }
        let mut is_simple = channels <= 2;
        for _ in 0..=bits.take(6)? {
            let kinds = mapping(&mut bits, channels, &residues)?;
            is_simple &= channels == 1 || kinds == [2];
        }
        let mut modes = Vec::new();
        for _ in 0..=bits.take(6)? {
            modes.push(bits.take(1)? == 1);
            bits.skip(16 + 16 + 8)?;
        }
        Some(Self { modes, is_simple })
    }
}

/// Section 3.2.1; how many values it holds when unpacked.
fn codebook(bits: &mut Bits<'_>) -> Option<u64> {
    if bits.take(24)? != 0x56_4342 {
        return None;
    }
    let dimensions = bits.take(16)?;
    let entries = bits.take(24)?;
    let is_ordered = bits.take(1)? == 1;
    if is_ordered {
        bits.skip(5)?;
        let mut entry = 0;
        while entry < entries {
            entry += bits.take(width(entries - entry))?;
        }
    } else if bits.take(1)? == 1 {
        for _ in 0..entries {
            if bits.take(1)? == 1 {
                bits.skip(5)?;
            }
        }
    } else {
        bits.skip(5 * entries as usize)?;
    }
    let unpacked = u64::from(entries) * u64::from(dimensions.max(1));
    let lookup = bits.take(4)?;
    if lookup == 0 {
        return Some(entries.into());
    }
    bits.skip(64)?;
    let value_bits = bits.take(4)? as usize + 1;
    bits.skip(1)?;
    let values = match lookup {
        1 => root(entries, dimensions),
        2 => unpacked,
        _ => return None,
    };
    bits.skip(usize::try_from(values).ok()?.checked_mul(value_bits)?)?;
    Some(unpacked)
}

/// The largest whole number whose power `dimensions` is not above `entries`.
fn root(entries: u32, dimensions: u32) -> u64 {
    let fits = |n: u64| n.checked_pow(dimensions).is_some_and(|p| p <= u64::from(entries));
    let (mut low, mut high) = (0, u64::from(entries) + 1);
    if dimensions == 0 {
        return 0;
    }
    while high - low > 1 {
        let middle = low.midpoint(high);
        if fits(middle) { low = middle } else { high = middle }
    }
    low
}

/// Sections 6.2.1 and 7.2.2.
fn floor(bits: &mut Bits<'_>) -> Option<()> {
    if bits.take(16)? == 0 {
        bits.skip(8 + 16 + 16 + 6 + 8)?;
        let books = bits.take(4)? as usize + 1;
        return bits.skip(8 * books);
    }
    let partitions = bits.take(5)?;
    let mut classes = Vec::new();
    for _ in 0..partitions {
        classes.push(bits.take(4)? as usize);
    }
    let mut dimensions = Vec::new();
    let count = classes.iter().max().map_or(0, |most| most + 1);
    for _ in 0..count {
        dimensions.push(bits.take(3)? as usize + 1);
        let subclasses = bits.take(2)?;
        if subclasses > 0 {
            bits.skip(8)?;
        }
        bits.skip(8 << subclasses)?;
    }
    bits.skip(2)?;
    let range = bits.take(4)? as usize;
    bits.skip(range * classes.iter().map(|c| dimensions[*c]).sum::<usize>())
}

/// Section 8.6.1; the type.
fn residue(bits: &mut Bits<'_>) -> Option<u32> {
    let kind = bits.take(16)?;
    bits.skip(24 + 24 + 24)?;
    let classes = bits.take(6)? + 1;
    bits.skip(8)?;
    let mut books = 0;
    for _ in 0..classes {
        let low = bits.take(3)?;
        let high = if bits.take(1)? == 1 { bits.take(5)? } else { 0 };
        books += (low.count_ones() + high.count_ones()) as usize;
    }
    bits.skip(8 * books)?;
    Some(kind)
}

/// Section 4.2.4; the types of the residues of its submaps.
fn mapping(bits: &mut Bits<'_>, channels: u8, residues: &[u32]) -> Option<Vec<u32>> {
    bits.skip(16)?;
    let submaps = if bits.take(1)? == 1 { bits.take(4)? + 1 } else { 1 };
    if bits.take(1)? == 1 {
        let steps = bits.take(8)? as usize + 1;
        bits.skip(steps * 2 * width(u32::from(channels) - 1))?;
    }
    bits.skip(2)?;
    if submaps > 1 {
        bits.skip(4 * usize::from(channels))?;
    }
    let mut kinds = Vec::new();
    for _ in 0..submaps {
        bits.skip(16)?;
        kinds.push(*residues.get(bits.take(8)? as usize)?);
    }
    Some(kinds)
}

/// Whether a packet is a long block; `None` where it is none of audio.
pub(super) fn is_long(packet: &[u8], modes: &[bool]) -> Option<bool> {
    let first = *packet.first().filter(|byte| *byte & 1 == 0)?;
    let mode = usize::from(first >> 1) & ((1 << mode_bits(modes)) - 1);
    modes.get(mode).copied()
}

fn mode_bits(modes: &[bool]) -> usize {
    width(modes.len().saturating_sub(1) as u32)
}

/// Writes into a long block whether the blocks before and after are long, where that is known.
pub(super) fn set_neighbours(
    packet: &mut [u8],
    modes: &[bool],
    before: Option<bool>,
    after: Option<bool>,
) {
    if is_long(packet, modes) != Some(true) {
        return;
    }
    let at = 1 + mode_bits(modes);
    for (bit, value) in [(at, before), (at + 1, after)] {
        if let (Some(value), Some(byte)) = (value, packet.get_mut(bit / 8)) {
            *byte = *byte & !(1 << (bit % 8)) | u8::from(value) << (bit % 8);
        }
    }
}

/// Bits that hold `n`; none for 0.
fn width(n: u32) -> usize {
    (u32::BITS - n.leading_zeros()) as usize
}

/// Bits of a packet, the lowest of each byte first.
struct Bits<'a> {
    bytes: &'a [u8],
    /// Bits from the start.
    at: usize,
}

impl Bits<'_> {
    /// The next `n` bits, up to 32, as a number.
    fn take(&mut self, n: usize) -> Option<u32> {
        let first = self.at;
        self.skip(n)?;
        let bit = |i: usize| u32::from(self.bytes[(first + i) / 8] >> ((first + i) % 8) & 1) << i;
        Some((0..n).map(bit).sum())
    }

    fn skip(&mut self, n: usize) -> Option<()> {
        let end = self.at.checked_add(n).filter(|end| *end <= 8 * self.bytes.len())?;
        self.at = end;
        Some(())
    }
}
