//! Walks over Thrift's compact protocol without reading anything into memory, so that what the
//! parquet crate is given to decode is known to end where it says.
//!
//! The crate (60.1) believes the lengths of lists and maps: four thousand bytes keep it busy for
//! hours. Here every element takes at least one byte, so the walk takes as long as the bytes. Lists and
//! maps of truth values, which Parquet's metadata do not have, are refused: the crate takes no bytes for
//! them, and what follows for something else than the walk does.

/// Structures in structures.
const DEPTH: usize = 32;

/// What a walk found.
pub(super) struct Walked {
    /// Bytes of the structure.
    pub length: usize,
    /// Its whole numbers of 32 bits, by field.
    pub numbers: Vec<(i16, i32)>,
}

/// Why a walk ended.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Fault {
    /// The bytes end inside of the structure.
    Short,
    /// They are not of this protocol.
    Malformed,
}

/// Walks over the structure that `bytes` begin with.
pub(super) fn structure(bytes: &[u8]) -> Result<Walked, Fault> {
    let mut walk = Walk { bytes, at: 0 };
    let mut numbers = Vec::new();
    walk.structure(DEPTH, Some(&mut numbers))?;
    Ok(Walked { length: walk.at, numbers })
}

struct Walk<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Walk<'_> {
    fn byte(&mut self) -> Result<u8, Fault> {
        let byte = *self.bytes.get(self.at).ok_or(Fault::Short)?;
        self.at += 1;
        Ok(byte)
    }

    fn skip(&mut self, length: u64) -> Result<(), Fault> {
        let end = usize::try_from(length).ok().and_then(|length| self.at.checked_add(length));
        match end {
            Some(end) if end <= self.bytes.len() => {
                self.at = end;
                Ok(())
            }
            _ => Err(Fault::Short),
        }
    }

    fn varint(&mut self) -> Result<u64, Fault> {
        let mut value = 0;
        for shift in (0..70).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f).checked_shl(shift).unwrap_or(0);
            if byte < 0x80 {
                return Ok(value);
            }
        }
        Err(Fault::Malformed)
    }

    fn number(&mut self) -> Result<i64, Fault> {
        let value = self.varint()?;
        Ok((value >> 1) as i64 ^ -((value & 1) as i64))
    }

    fn structure(
        &mut self,
        depth: usize,
        mut numbers: Option<&mut Vec<(i16, i32)>>,
    ) -> Result<(), Fault> {
        let mut field = 0i16;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Ok(());
            }
            field = match head >> 4 {
                0 => self.number()? as i16,
                delta => field.wrapping_add(i16::from(delta)),
            };
            match head & 15 {
                // In a structure, truth values are in their type.
                1 | 2 => {}
                5 => {
                    let value = self.number()? as i32;
                    if let Some(numbers) = &mut numbers {
                        numbers.push((field, value));
                    }
                }
                kind => self.value(kind, depth)?,
            }
        }
    }

    /// A value in a list or a map.
    fn element(&mut self, kind: u8, depth: usize) -> Result<(), Fault> {
        match kind {
            1 | 2 => Err(Fault::Malformed),
            kind => self.value(kind, depth),
        }
    }

    fn value(&mut self, kind: u8, depth: usize) -> Result<(), Fault> {
        let depth = depth.checked_sub(1).ok_or(Fault::Malformed)?;
        match kind {
            3 => self.skip(1),
            4..=6 => self.varint().map(drop),
            7 => self.skip(8),
            8 => {
                let length = self.varint()?;
                self.skip(length)
            }
            9 | 10 => {
                let head = self.byte()?;
                let count = match head >> 4 {
                    15 => self.varint()?,
                    count => u64::from(count),
                };
                (0..count).try_for_each(|_| self.element(head & 15, depth))
            }
            11 => {
                let count = self.varint()?;
                let kinds = if count > 0 { self.byte()? } else { 0 };
                (0..count).try_for_each(|_| {
                    self.element(kinds >> 4, depth)?;
                    self.element(kinds & 15, depth)
                })
            }
            12 => self.structure(depth, None),
            13 => self.skip(16),
            _ => Err(Fault::Malformed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn structures_end_where_they_say() {
        // Field 1: i32 -3; field 2: text "ab"; field 4: a list of two bytes; the end.
        let bytes = [0x15, 5, 0x18, 2, b'a', b'b', 0x29, 0x23, 1, 2, 0, 0xff];
        let walked = structure(&bytes).unwrap();
        assert_eq!((walked.length, walked.numbers), (11, vec![(1, -3)]));
        for end in 0..11 {
            assert_eq!(structure(&bytes[..end]).err(), Some(Fault::Short), "{end}");
        }
    }

    #[test]
    fn lengths_that_nothing_stands_behind_end_the_walk() {
        // A map of 2^34 bytes, a list of 2^60 structures, a text of 2^63 bytes.
        let map = [0x1b, 0x80, 0x80, 0x80, 0x80, 0x40, 0x33, 1, 1];
        assert_eq!(structure(&map).err(), Some(Fault::Short));
        let list = [0x19, 0xfc, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x10, 0, 0];
        assert_eq!(structure(&list).err(), Some(Fault::Short));
        let text = [0x18, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 0x80, 1, b'x'];
        assert_eq!(structure(&text).err(), Some(Fault::Short));
        // Of truth values, which the crate counts without reading: a list of two, one of 2^31, a map.
        for bytes in [
            &[0x19, 0x21, 1, 2, 0][..],
            &[0x19, 0xf1, 0xff, 0xff, 0xff, 0xff, 7, 1, 2, 0],
            &[0x1b, 1, 0x13, 1, 1, 0],
            &[0x1b, 1, 0x32, 1, 1, 0],
        ] {
            assert_eq!(structure(bytes).err(), Some(Fault::Malformed), "{bytes:?}");
        }
        assert_eq!(structure(&[0x1c; 100]).err(), Some(Fault::Malformed), "too deep");
        assert_eq!(structure(&[0x1f]).err(), Some(Fault::Malformed));
    }
}
