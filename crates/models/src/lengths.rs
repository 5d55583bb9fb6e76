//! Lengths of recordings: those that a model was trained on, and those that are quite different.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// How many times as long, or as short, a recording must be to be another kind of recording.
const APART: f64 = 2.0;

/// The lengths of some recordings, in seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lengths {
    /// of the shortest
    pub shortest: f64,
    /// of the longest
    pub longest: f64,
}

impl Lengths {
    /// Of these lengths in seconds; `None` without any.
    pub fn of(seconds: impl IntoIterator<Item = f64>) -> Option<Self> {
        let each = seconds.into_iter().map(|one| Self { shortest: one, longest: one });
        each.reduce(|a, b| Self {
            shortest: a.shortest.min(b.shortest),
            longest: a.longest.max(b.longest),
        })
    }

    /// Whether features of a recording with these seconds may be of another kind.
    pub fn differ_from(&self, seconds: f64) -> bool {
        seconds > APART * self.longest || APART * seconds < self.shortest
    }

    /// That some recordings, given by name and seconds, are far from those trained on, in words.
    pub fn warning<'a>(&self, given: impl IntoIterator<Item = (&'a str, f64)>) -> Option<String> {
        let (mut count, mut first) = (0, None);
        for (name, seconds) in given {
            if self.differ_from(seconds) {
                count += 1;
                first.get_or_insert((name, seconds));
            }
        }
        let (name, seconds) = first?;
        let more = match count - 1 {
            0 => String::new(),
            1 => " (1 more recording is too long or too short)".into(),
            n => format!(" ({n} more recordings are too long or too short)"),
        };
        Some(format!(
            "{name} is {} s long, but the model was trained on recordings of {self}{more}: the \
             predictions may be wrong",
            rounded(seconds)
        ))
    }
}

/// `0.9 to 1.1 s`
impl std::fmt::Display for Lengths {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (shortest, longest) = (rounded(self.shortest), rounded(self.longest));
        if shortest != longest {
            write!(f, "{shortest} to ")?;
        }
        write!(f, "{longest} s")
    }
}

/// Whether all features by this configuration are of one length, whatever the recording's.
pub(crate) fn is_cut(config: &Value) -> bool {
    config["signal"]["length"].as_f64().is_some_and(|seconds| seconds > 0.0)
}

/// Two significant digits, and all whole ones.
fn rounded(seconds: f64) -> String {
    let digits = match seconds {
        s if s >= 10.0 || s <= 0.0 => 0,
        s => (1.0 - s.log10().floor()) as usize,
    };
    let text = format!("{seconds:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_of_another_length_are_said_once() {
        let lengths = Lengths::of([1.04, 0.875]).unwrap();
        assert_eq!(lengths.to_string(), "0.88 to 1 s");
        assert_eq!(Lengths::of([]), None);
        assert_eq!(lengths.warning([("a", 2.0), ("b", 0.44)]), None);
        let found = lengths.warning([("a", 1.0), ("b", 10.0), ("c", 0.4)]).unwrap();
        assert!(found.starts_with("b is 10 s long, but"), "{found}");
        assert!(found.contains("of 0.88 to 1 s (1 more recording is too"), "{found}");
        assert_eq!([0.0, 0.004_21, 123.4].map(rounded), ["0", "0.0042", "123"]);
    }
}
