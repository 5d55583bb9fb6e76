//! Names of recordings: `s1_fi2_fu1_b0_l1`.

use std::fmt;

use serde::Serialize;

use super::container::Container;
use super::filling::{Filling, FillingLevel, FillingType};

/// What the name of a training recording tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct SequenceName {
    /// 0 on the table, 1 in the hand, 2 standing away from the table.
    pub scenario: u8,
    /// Type and level.
    pub filling: Filling,
    /// 0 or 1.
    pub background: u8,
    /// 0 or 1.
    pub illumination: u8,
}

impl SequenceName {
    /// Reads a name; what follows it (`_audio.wav`, `_c2`) is ignored.
    ///
    /// `None` where the text is not such a name or names an infeasible filling.
    pub fn parse(text: &str) -> Option<Self> {
        let mut parts = text.split(['_', '.']);
        let mut field = |prefix: &str, below: u8| {
            let value: u8 = parts.next()?.strip_prefix(prefix)?.parse().ok()?;
            (value < below).then_some(value)
        };
        let scenario = field("s", 3)?;
        let kind = FillingType::from_number(field("fi", 4)?.into())?;
        let level = FillingLevel::from_number(field("fu", 3)?.into())?;
        let background = field("b", 2)?;
        let illumination = field("l", 2)?;
        Some(Self { scenario, filling: Filling::new(kind, level)?, background, illumination })
    }

    /// All names of a container in the order of the 2020 sequence numbers: scenario outermost,
    /// then background, illumination and filling.
    pub fn all(container: Container) -> impl Iterator<Item = Self> {
        (0..12u8).flat_map(move |i| {
            container.fillings().map(move |filling| Self {
                scenario: i / 4,
                filling,
                background: i / 2 % 2,
                illumination: i % 2,
            })
        })
    }

    /// Position in [`SequenceName::all`], the sequence number of the 2020 files; `None` for a
    /// filling that the container is never recorded with.
    pub fn number(self, container: Container) -> Option<u16> {
        let fillings = container.fillings().count() as u16;
        let filling = container.fillings().position(|f| f == self.filling)? as u16;
        let setting = u16::from(self.scenario) * 4
            + u16::from(self.background) * 2
            + u16::from(self.illumination);
        Some(setting * fillings + filling)
    }
}

impl fmt::Display for SequenceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "s{}_fi{}_fu{}_b{}_l{}",
            self.scenario,
            self.filling.kind() as u8,
            self.filling.level() as u8,
            self.background,
            self.illumination
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip_and_number_in_order() {
        for container in Container::all() {
            for (i, name) in SequenceName::all(container).enumerate() {
                assert_eq!(SequenceName::parse(&format!("{name}_audio.wav")), Some(name));
                assert_eq!(name.number(container), Some(i as u16));
            }
        }
    }

    #[test]
    fn refuses_what_is_no_name() {
        for text in ["", "0000_audio.wav", "s3_fi0_fu0_b0_l0", "s0_fi1_fu0_b0_l0", "s0_fi0_fu0_b0"]
        {
            assert_eq!(SequenceName::parse(text), None, "{text}");
        }
        let water = SequenceName::parse("s0_fi3_fu1_b0_l0").unwrap();
        assert_eq!(water.number(Container::new(7).unwrap()), None);
    }
}
