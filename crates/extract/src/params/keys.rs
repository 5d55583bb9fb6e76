//! What keys of a configuration mean, in words.

/// Keys with a sentence each: meaning, unit, and what a special value stands for.
pub type Keys = &'static [(&'static str, &'static str)];

/// The key of features whose definition changed with librosa.
pub const LIBROSA: Keys =
    &[("librosa", "The librosa version whose conventions are followed: \"0.11\" or \"0.8\".")];
