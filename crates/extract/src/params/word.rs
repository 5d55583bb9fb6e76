//! A number, or one word in its place.

use serde::{Deserialize, Deserializer};

/// A number, or the word `auto`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum AutoOr {
    /// This one.
    Value(f64),
    /// What suits.
    Auto,
}

/// A number or one word.
pub fn number_or<'de, D: Deserializer<'de>>(d: D, word: &str) -> Result<Option<f64>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged)]
    enum Raw {
        Number(f64),
        Word(String),
    }
    match Raw::deserialize(d) {
        Ok(Raw::Number(n)) => Ok(Some(n)),
        Ok(Raw::Word(w)) if w == word => Ok(None),
        Ok(Raw::Word(w)) if w.eq_ignore_ascii_case(word) => {
            Err(serde::de::Error::custom(format!("expected \"{word}\" in small letters")))
        }
        _ => Err(serde::de::Error::custom(format!("expected a number or \"{word}\""))),
    }
}

/// A variant with a number is that number, the other one its word.
macro_rules! number_or_word {
    ($type:ident, $number:ident, $other:ident, $word:literal) => {
        impl serde::Serialize for $type {
            fn serialize<S: serde::Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
                match self {
                    Self::$number(v) => s.serialize_f64(*v),
                    Self::$other => s.serialize_str($word),
                }
            }
        }

        impl<'de> serde::Deserialize<'de> for $type {
            fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
                Ok($crate::params::word::number_or(d, $word)?.map_or(Self::$other, Self::$number))
            }
        }
    };
}
pub(crate) use number_or_word;

number_or_word!(AutoOr, Value, Auto, "auto");
