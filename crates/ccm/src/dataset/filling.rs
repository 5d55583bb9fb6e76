//! What a container is filled with, and to which level.

use serde::Serialize;

/// Type of filling, numbered as in file names (`fi`) and official files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub enum FillingType {
    /// Nothing.
    None = 0,
    /// Pasta.
    Pasta = 1,
    /// Rice.
    Rice = 2,
    /// Water.
    Water = 3,
}

/// Level of filling, numbered as in file names (`fu`) and official files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub enum FillingLevel {
    /// 0 % of the capacity.
    Empty = 0,
    /// 50 % of the capacity.
    Half = 1,
    /// 90 % of the capacity.
    Full = 2,
}

impl FillingType {
    /// All types, in the order of their numbers.
    pub const ALL: [Self; 4] = [Self::None, Self::Pasta, Self::Rice, Self::Water];

    /// The type with this number, 0 to 3.
    pub fn from_number(number: i64) -> Option<Self> {
        usize::try_from(number).ok().and_then(|n| Self::ALL.get(n).copied())
    }

    /// English name in lower case.
    pub fn name(self) -> &'static str {
        ["none", "pasta", "rice", "water"][self as usize]
    }

    /// The type with this name or number.
    pub fn parse(text: &str) -> Option<Self> {
        let named = Self::ALL.into_iter().find(|k| k.name().eq_ignore_ascii_case(text));
        named.or_else(|| Self::from_number(text.parse().ok()?))
    }
}

impl FillingLevel {
    /// All levels, in the order of their numbers.
    pub const ALL: [Self; 3] = [Self::Empty, Self::Half, Self::Full];

    /// The level with this number: 0, 1, 2, or written in percent as 50, 90.
    pub fn from_number(number: i64) -> Option<Self> {
        match number {
            0 => Some(Self::Empty),
            1 | 50 => Some(Self::Half),
            2 | 90 => Some(Self::Full),
            _ => None,
        }
    }

    /// English name in lower case.
    pub fn name(self) -> &'static str {
        ["empty", "half", "full"][self as usize]
    }

    /// The level with this name or number (50 and 90 are percent).
    pub fn parse(text: &str) -> Option<Self> {
        let named = Self::ALL.into_iter().find(|l| l.name().eq_ignore_ascii_case(text));
        named.or_else(|| Self::from_number(text.parse().ok()?))
    }

    /// Share of the capacity that is filled: 0, 0.5 or 0.9.
    pub fn fraction(self) -> f64 {
        [0.0, 0.5, 0.9][self as usize]
    }
}

/// A feasible pair of type and level: both empty, or neither. There are seven, the joint classes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
pub struct Filling {
    kind: FillingType,
    level: FillingLevel,
}

impl Filling {
    /// Number of joint classes.
    pub const COUNT: usize = 7;

    /// The empty container.
    pub const EMPTY: Self = Self { kind: FillingType::None, level: FillingLevel::Empty };

    /// The pair, or `None` where it is infeasible (something at level empty, nothing at half).
    pub fn new(kind: FillingType, level: FillingLevel) -> Option<Self> {
        let feasible = (kind == FillingType::None) == (level == FillingLevel::Empty);
        feasible.then_some(Self { kind, level })
    }

    /// The joint class: 0 empty; 1, 2 pasta; 3, 4 rice; 5, 6 water (half, full).
    pub fn joint(self) -> usize {
        match self.kind {
            FillingType::None => 0,
            kind => (kind as usize - 1) * 2 + self.level as usize,
        }
    }

    /// The filling of a joint class below [`Filling::COUNT`].
    pub fn from_joint(class: usize) -> Option<Self> {
        Self::all().nth(class)
    }

    /// The seven fillings in the order of their joint classes.
    pub fn all() -> impl Iterator<Item = Self> {
        FillingType::ALL.into_iter().flat_map(|kind| {
            FillingLevel::ALL.into_iter().filter_map(move |level| Self::new(kind, level))
        })
    }

    /// What it is.
    pub fn kind(self) -> FillingType {
        self.kind
    }

    /// How much it is.
    pub fn level(self) -> FillingLevel {
        self.level
    }

    /// Name such as `empty`, `pasta half`, `water full`.
    pub fn name(self) -> String {
        match self.kind {
            FillingType::None => "empty".into(),
            kind => format!("{} {}", kind.name(), self.level.name()),
        }
    }

    /// The filling with this name (`pasta half`), pair of type and level (`1-1`, `pasta-half`) or
    /// joint class.
    pub fn parse(text: &str) -> Option<Self> {
        let pair = text.split_once([' ', '-']);
        let pair = pair.and_then(|(k, l)| FillingType::parse(k).zip(FillingLevel::parse(l)));
        let named = || Self::all().find(|f| f.name().eq_ignore_ascii_case(text));
        let numbered = || Self::from_joint(text.parse().ok()?);
        pair.and_then(|(k, l)| Self::new(k, l)).or_else(named).or_else(numbered)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joint_classes_are_the_seven_feasible_pairs_in_order() {
        let names: Vec<_> = Filling::all().map(Filling::name).collect();
        assert_eq!(
            names,
            [
                "empty",
                "pasta half",
                "pasta full",
                "rice half",
                "rice full",
                "water half",
                "water full"
            ]
        );
        for (class, filling) in Filling::all().enumerate() {
            assert_eq!(filling.joint(), class);
            assert_eq!(Filling::from_joint(class), Some(filling));
            let pair = format!("{}-{}", filling.kind() as u8, filling.level() as u8);
            for text in [filling.name(), pair, class.to_string()] {
                assert_eq!(Filling::parse(&text), Some(filling), "{text}");
            }
        }
        assert_eq!(Filling::from_joint(7), None);
        assert_eq!(["1-0", "7", "tea", "pasta"].map(Filling::parse), [None; 4]);
        assert_eq!(Filling::new(FillingType::Rice, FillingLevel::Empty), None);
        assert_eq!(Filling::new(FillingType::None, FillingLevel::Full), None);
    }
}
