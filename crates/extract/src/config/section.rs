//! What the parts of a configuration beside its features mean, key by key.

use serde_json::Value;

use super::SignalConfig;
use crate::summary::{Stat, SummaryConfig};

/// `[signal]` or `[summary]`.
#[derive(Debug)]
pub struct Section {
    /// Its name in a configuration.
    pub name: &'static str,
    /// What it is for.
    pub about: &'static str,
    /// Its keys in their order, and what each means.
    pub keys: &'static [(&'static str, &'static str)],
}

/// All of them.
pub const SECTIONS: [Section; 2] = [
    Section {
        name: "signal",
        about: "How a recording becomes the signal that features are computed from, in the order of \
                the keys. Change a key with --set signal.KEY=VALUE.",
        keys: &[
            (
                "channels",
                "\"all\", \"mean\" (librosa's mono), a list such as [0, 2], or \"downmix-7.1\"",
            ),
            ("start", "first second taken; the start of a manifest row is added to it"),
            ("end", "last second taken; 0 is the end of the recording"),
            ("sample_rate", "rate in Hz to resample to; 0 keeps that of the recording"),
            (
                "res_type",
                "filter of the resampling: \"soxr_hq\" (librosa's default since 0.10), \"kaiser_best\" \
                 (its default before) or \"kaiser_fast\"",
            ),
            ("preemphasis", "y[n] = x[n] - preemphasis * x[n - 1]; 0 for none"),
            (
                "normalize",
                "\"peak\" or \"rms\": divide by the largest magnitude or the root-mean-square value of \
                 all channels, which holds the recording in memory; \"none\"",
            ),
            ("length", "seconds to cut or zero-pad to, at the end; 0 keeps the length"),
        ],
    },
    Section {
        name: "summary",
        about: "Statistics of each coefficient over its frames: one row of numbers for each recording, \
                which is what classifiers learn from. Without this section, outputs hold the frames.",
        keys: &[
            (
                "stats",
                "one or more of mean, std, min, max, median, skew, kurtosis, and percentiles such as p95",
            ),
            (
                "average_channels",
                "whether channels are averaged, frame by frame, before the statistics",
            ),
        ],
    },
];

impl Section {
    /// An example of its values: the defaults, and for `[summary]`, which has none, mean and deviation.
    pub fn example(&self) -> Value {
        let value = match self.name {
            "signal" => serde_json::to_value(SignalConfig::default()),
            _ => serde_json::to_value(SummaryConfig {
                stats: vec![Stat::Mean, Stat::Std],
                average_channels: false,
            }),
        };
        value.unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_key_is_explained() {
        for section in &SECTIONS {
            let example = section.example();
            let keys: BTreeSet<&str> =
                example.as_object().unwrap().keys().map(String::as_str).collect();
            let explained: BTreeSet<&str> = section.keys.iter().map(|(key, _)| *key).collect();
            assert_eq!(explained, keys, "{}", section.name);
        }
    }
}
