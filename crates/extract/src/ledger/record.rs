//! One line of a ledger.

use corsmal_files::npz::EntryRecord;
use corsmal_files::outcome::Outcome;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

/// Something that is done.
pub trait Done: Serialize + DeserializeOwned {
    /// What it has put into the partial archive.
    fn entries(&self) -> &[EntryRecord];
}

/// One input that is done.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Record {
    /// What became of it.
    pub outcome: Outcome,
    /// Its entries in the partial archive.
    pub entries: Vec<EntryRecord>,
    /// Its row of the summary table, if it has one.
    #[serde(default, with = "row")]
    pub row: Option<Vec<f32>>,
    /// Names of the columns of the table, in the first record that has a row.
    #[serde(default)]
    pub names: Option<Vec<String>>,
}

impl Done for Record {
    fn entries(&self) -> &[EntryRecord] {
        &self.entries
    }
}

/// A summary row as hexadecimal little-endian bytes: exact for every value, NaN included.
mod row {
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    pub fn serialize<S: Serializer>(row: &Option<Vec<f32>>, to: S) -> Result<S::Ok, S::Error> {
        const DIGITS: [char; 16] =
            ['0', '1', '2', '3', '4', '5', '6', '7', '8', '9', 'a', 'b', 'c', 'd', 'e', 'f'];
        let hex = row.as_ref().map(|row| {
            let mut hex = String::with_capacity(row.len() * 8);
            for byte in row.iter().flat_map(|value| value.to_le_bytes()) {
                hex.push(DIGITS[usize::from(byte >> 4)]);
                hex.push(DIGITS[usize::from(byte & 15)]);
            }
            hex
        });
        hex.serialize(to)
    }

    pub fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Vec<f32>>, D::Error> {
        let Some(hex) = Option::<String>::deserialize(from)? else { return Ok(None) };
        let (groups, rest) = hex.as_bytes().as_chunks::<8>();
        let values = groups.iter().map(|group| {
            let digits = std::str::from_utf8(group).ok()?;
            // `from_str_radix` would take a sign.
            let bits = digits.bytes().all(|b| b.is_ascii_hexdigit()).then_some(digits)?;
            Some(f32::from_bits(u32::from_str_radix(bits, 16).ok()?.swap_bytes()))
        });
        match values.collect::<Option<Vec<f32>>>() {
            Some(values) if rest.is_empty() => Ok(Some(values)),
            _ => Err(D::Error::custom("a summary row is 8 hexadecimal digits per value")),
        }
    }
}
