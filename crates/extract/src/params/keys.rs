//! What keys of a configuration mean, in words.

/// Keys with a sentence each: meaning, unit, and what a special value stands for.
pub type Keys = &'static [(&'static str, &'static str)];

/// The key of features whose definition changed with librosa.
pub const LIBROSA: Keys =
    &[("librosa", "The librosa version whose conventions are followed: \"0.11\" or \"0.8\".")];

/// What other tools call a key.
const ELSEWHERE: [(&str, &str); 7] = [
    ("sr", "signal.sample_rate"),
    ("rate", "signal.sample_rate"),
    ("mono", "signal.channels"),
    ("offset", "signal.start"),
    ("duration", "signal.length"),
    ("stat", "summary.stats"),
    ("statistics", "summary.stats"),
];

/// The dotted key of a configuration for what other tools call `key`.
pub fn elsewhere(key: &str) -> Option<&'static str> {
    ELSEWHERE.iter().find(|(other, _)| *other == key).map(|(_, here)| *here)
}
