//! Walks over Thrift's compact protocol without reading anything into memory, so that what the
//! parquet crate is given to decode is known to end where it says.
//!
//! The crate (60.1) believes the lengths of lists and maps: four thousand bytes keep it busy for
//! hours. Here every element takes at least one byte, so the walk takes as long as the bytes.
//!
//! What the crate would read otherwise is refused: known fields that declare another type, and lists and maps
//! of truth values, for which it takes no bytes; Parquet's metadata have none.

use super::fields::{Fields, Type};

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

/// Walks over the structure with these `fields` that `bytes` begin with.
pub(super) fn structure(bytes: &[u8], fields: &Fields) -> Result<Walked, Fault> {
    let mut walk = Walk { bytes, at: 0 };
    let mut numbers = Vec::new();
    walk.structure(fields, DEPTH, Some(&mut numbers))?;
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
        fields: &Fields,
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
            let known = fields.iter().find(|(number, _)| *number == field).map(|(_, known)| *known);
            if known.is_some_and(|known| !known.is(head & 15)) {
                return Err(Fault::Malformed);
            }
            match head & 15 {
                // In a structure, truth values are in their type.
                1 | 2 => {}
                5 => {
                    let value = self.number()? as i32;
                    if let Some(numbers) = &mut numbers {
                        numbers.push((field, value));
                    }
                }
                kind => self.value(kind, known, depth)?,
            }
        }
    }

    /// A value in a list or a map.
    fn element(&mut self, kind: u8, known: Option<Type>, depth: usize) -> Result<(), Fault> {
        match kind {
            1 | 2 => Err(Fault::Malformed),
            kind if known.is_some_and(|known| !known.is(kind)) => Err(Fault::Malformed),
            kind => self.value(kind, known, depth),
        }
    }

    /// A value whose type is `known`, where it is.
    fn value(&mut self, kind: u8, known: Option<Type>, depth: usize) -> Result<(), Fault> {
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
                let known = match known {
                    Some(Type::List(of)) => Some(*of),
                    _ => None,
                };
                (0..count).try_for_each(|_| self.element(head & 15, known, depth))
            }
            11 => {
                let count = self.varint()?;
                let kinds = if count > 0 { self.byte()? } else { 0 };
                (0..count).try_for_each(|_| {
                    self.element(kinds >> 4, None, depth)?;
                    self.element(kinds & 15, None, depth)
                })
            }
            12 => match known {
                Some(Type::Struct(fields)) => self.structure(fields, depth, None),
                _ => self.structure(&[], depth, None),
            },
            13 => self.skip(16),
            _ => Err(Fault::Malformed),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::fields::{FOOTER, PAGE_HEADER};
    use super::*;

    fn structure(bytes: &[u8]) -> Result<Walked, Fault> {
        super::structure(bytes, &[])
    }

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
    /// A footer of 10 KB kept the crate busy for a second: it read a list where the header says binary.
    #[test]
    fn known_fields_have_their_types() {
        // Version 1; no schema; no rows; a row group with no columns, 0 bytes, 0 rows.
        let sound = [0x15, 2, 0x19, 0, 0x16, 0, 0x19, 0x1c, 0x19, 0x0c, 0x16, 0, 0x16, 0, 0, 0];
        assert_eq!(super::structure(&sound, FOOTER).unwrap().length, sound.len());
        // The columns as text; a list of numbers for row groups; the version as a structure.
        for (at, byte) in [(8, 0x18), (7, 0x15), (0, 0x1c)] {
            let mut other = sound;
            other[at] = byte;
            assert_eq!(super::structure(&other, FOOTER).err(), Some(Fault::Malformed), "{at}");
        }
        // A page header: type, two sizes, and a data page whose statistics are a number.
        let page =
            [0x15, 0, 0x15, 2, 0x15, 2, 0x2c, 0x15, 2, 0x15, 0, 0x15, 6, 0x15, 6, 0x1c, 0, 0, 0];
        assert_eq!(super::structure(&page, PAGE_HEADER).unwrap().numbers[1..], [(2, 1), (3, 1)]);
        let mut other = page;
        other[15] = 0x15;
        assert_eq!(super::structure(&other, PAGE_HEADER).err(), Some(Fault::Malformed));
    }
}
