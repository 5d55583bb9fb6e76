//! Statistics over frames.

use corsmal_files::statistic::NAMES;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::params::ConfigError;

/// One statistic over the frames of a coefficient.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Stat {
    /// Arithmetic mean.
    Mean,
    /// Standard deviation of the population (ddof 0, as numpy's default).
    Std,
    /// Smallest value.
    Min,
    /// Largest value.
    Max,
    /// Third standardised moment, biased as scipy's default; 0 where there is no variance.
    Skew,
    /// Fourth standardised moment less 3, biased as scipy's default; 0 where there is no variance.
    Kurtosis,
    /// Percentile by linear interpolation, as numpy's default; the median is 50. Holds every value
    /// of the recording.
    Percentile(f64),
}

const STATS: &str = "mean, std, min, max, median, skew, kurtosis or a percentile such as p95";

impl std::fmt::Display for Stat {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Mean => f.write_str("mean"),
            Self::Std => f.write_str("std"),
            Self::Min => f.write_str("min"),
            Self::Max => f.write_str("max"),
            Self::Skew => f.write_str("skew"),
            Self::Kurtosis => f.write_str("kurtosis"),
            Self::Percentile(p) if *p == 50.0 => f.write_str("median"),
            Self::Percentile(p) => write!(f, "p{p}"),
        }
    }
}

impl std::str::FromStr for Stat {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Ok(match name {
            "mean" => Self::Mean,
            "std" => Self::Std,
            "min" => Self::Min,
            "max" => Self::Max,
            "median" => Self::Percentile(50.0),
            "skew" => Self::Skew,
            "kurtosis" => Self::Kurtosis,
            other => match other.strip_prefix('p').and_then(|p| p.parse::<f64>().ok()) {
                Some(p) if (0.0..=100.0).contains(&p) => Self::Percentile(p),
                _ => {
                    let meant = corsmal_names::closest(other, NAMES);
                    let meant = meant.map(|name| format!(" did you mean \"{name}\"?"));
                    let meant = meant.unwrap_or_default();
                    return Err(format!("\"{other}\" is not a statistic:{meant} {STATS}"));
                }
            },
        })
    }
}

impl Serialize for Stat {
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Stat {
    fn deserialize<D: Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        String::deserialize(d)?.parse().map_err(serde::de::Error::custom)
    }
}

/// Which statistics, and over what.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SummaryConfig {
    /// Statistics in their order of output; a single one may stand by itself, several as words
    /// between commas.
    #[serde(deserialize_with = "one_or_more")]
    pub stats: Vec<Stat>,
    /// Channels are averaged, frame by frame, before the statistics.
    pub average_channels: bool,
}

/// `"mean"`, `"mean,std"` or `["mean", "std"]`.
fn one_or_more<'de, D: Deserializer<'de>>(d: D) -> Result<Vec<Stat>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "expected statistics, such as [\"mean\", \"std\"]")]
    enum Words {
        One(String),
        List(Vec<String>),
    }
    let words = match Words::deserialize(d)? {
        Words::One(text) => text.split(',').map(|word| word.trim().to_string()).collect(),
        Words::List(words) => words,
    };
    let stats: Result<Vec<Stat>, String> = words.iter().map(|word| word.parse()).collect();
    stats.map_err(serde::de::Error::custom)
}

impl SummaryConfig {
    /// Refuses an empty list, and columns that would have the same name.
    pub fn check(&self) -> Result<(), ConfigError> {
        if self.stats.is_empty() {
            return Err(ConfigError::key("summary.stats", format!("must not be empty: {STATS}")));
        }
        for (index, stat) in self.stats.iter().enumerate() {
            if self.stats[..index].contains(stat) {
                return Err(ConfigError::key("summary.stats", format!("names {stat} twice")));
            }
        }
        Ok(())
    }
}

/// Statistics of `width` series at once, a frame at a time.
///
/// Moments are sums in double precision of the differences from the first frame, so that a large
/// common level costs no digits; the order of summation is that of the frames.
pub struct Accumulator {
    stats: Vec<Stat>,
    width: usize,
    frames: u64,
    /// The first frame, subtracted from every value.
    shift: Vec<f64>,
    /// Sums of powers 1 to 4 of the shifted values.
    sums: [Vec<f64>; 4],
    min: Vec<f32>,
    max: Vec<f32>,
    /// Every value, where a percentile is asked for: `[frames][width]`.
    values: Vec<f32>,
}

impl Accumulator {
    /// Statistics of `width` series.
    pub fn new(stats: &[Stat], width: usize) -> Self {
        Self {
            stats: stats.to_vec(),
            width,
            frames: 0,
            shift: Vec::new(),
            sums: std::array::from_fn(|_| vec![0.0; width]),
            min: vec![f32::INFINITY; width],
            max: vec![f32::NEG_INFINITY; width],
            values: Vec::new(),
        }
    }

    fn highest_power(&self) -> usize {
        let power = |s: &Stat| match s {
            Stat::Mean => 1,
            Stat::Std => 2,
            Stat::Skew => 3,
            Stat::Kurtosis => 4,
            _ => 0,
        };
        self.stats.iter().map(power).max().unwrap_or(0)
    }

    /// Takes whole frames, `[frames][width]`.
    pub fn push(&mut self, values: &[f32]) {
        let powers = self.highest_power();
        let extremes = self.stats.iter().any(|s| matches!(s, Stat::Min | Stat::Max));
        if self.shift.is_empty() && values.len() >= self.width {
            self.shift = values[..self.width].iter().map(|x| f64::from(*x)).collect();
        }
        for frame in values.chunks_exact(self.width) {
            if powers > 0 {
                let [s1, s2, s3, s4] = &mut self.sums;
                for (i, (x, shift)) in frame.iter().zip(&self.shift).enumerate() {
                    let d = f64::from(*x) - shift;
                    s1[i] += d;
                    s2[i] += d * d;
                    if powers > 2 {
                        s3[i] += d * d * d;
                        s4[i] += d * d * d * d;
                    }
                }
            }
            if extremes {
                for (i, x) in frame.iter().enumerate() {
                    self.min[i] = self.min[i].min(*x);
                    self.max[i] = self.max[i].max(*x);
                }
            }
            self.frames += 1;
        }
        if self.stats.iter().any(|s| matches!(s, Stat::Percentile(_))) {
            self.values.extend_from_slice(values);
        }
    }

    /// The statistics `[stats][width]`; zeros where there was no frame.
    pub fn finish(mut self) -> Vec<f32> {
        let n = self.frames as f64;
        let mut out = Vec::with_capacity(self.stats.len() * self.width);
        let stats = std::mem::take(&mut self.stats);
        let mut column = Vec::new();
        for stat in stats {
            for i in 0..self.width {
                if self.frames == 0 {
                    out.push(0.0);
                    continue;
                }
                let [a, b, c, d] = [0, 1, 2, 3].map(|k| self.sums[k][i] / n);
                // Not `max`, which would make zero of NaN.
                let variance = b - a * a;
                let variance = if variance < 0.0 { 0.0 } else { variance };
                let value = match stat {
                    Stat::Mean => self.shift[i] + a,
                    Stat::Std => variance.sqrt(),
                    Stat::Min => f64::from(self.min[i]),
                    Stat::Max => f64::from(self.max[i]),
                    Stat::Skew if variance != 0.0 => {
                        (c - 3.0 * a * b + 2.0 * a * a * a) / variance.powf(1.5)
                    }
                    Stat::Kurtosis if variance != 0.0 => {
                        let fourth = d - 4.0 * a * c + 6.0 * a * a * b - 3.0 * a * a * a * a;
                        fourth / (variance * variance) - 3.0
                    }
                    Stat::Skew | Stat::Kurtosis => 0.0,
                    Stat::Percentile(p) => {
                        column.clear();
                        column.extend(self.values.iter().skip(i).step_by(self.width));
                        percentile(&mut column, p)
                    }
                };
                out.push(value as f32);
            }
        }
        out
    }
}

/// numpy's linear percentile; reorders `values`.
fn percentile(values: &mut [f32], p: f64) -> f64 {
    let position = p / 100.0 * (values.len() - 1) as f64;
    let below = position.floor() as usize;
    let (_, low, above) = values.select_nth_unstable_by(below, f32::total_cmp);
    let low = f64::from(*low);
    match above.iter().copied().min_by(f32::total_cmp) {
        Some(high) => low + (f64::from(high) - low) * (position - below as f64),
        None => low,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stats(names: &[&str], values: &[f32]) -> Vec<f32> {
        let stats: Vec<Stat> = names.iter().map(|n| n.parse().unwrap()).collect();
        let mut all = Accumulator::new(&stats, 1);
        values.chunks(2).for_each(|c| all.push(c));
        all.finish()
    }

    #[test]
    fn known_values() {
        let names = ["mean", "std", "min", "max", "median", "skew", "kurtosis", "p25"];
        let got = stats(&names, &[1.0, 2.0, 3.0, 4.0, 10.0]);
        // numpy and scipy.stats of the same five numbers.
        let want = [4.0, 3.1622777, 1.0, 10.0, 3.0, 1.138_419_9, -0.212, 2.0];
        for (got, want) in got.iter().zip(want) {
            assert!((got - want).abs() < 1e-6, "{got} {want}");
        }
    }

    #[test]
    fn names_are_read_and_written() {
        for name in NAMES.iter().copied().chain(["p0", "p2.5", "p100"]) {
            let stat: Stat = name.parse().unwrap();
            assert_eq!(stat.to_string(), name);
            assert!(corsmal_files::statistic::is_column(&format!("rms.{stat}")), "{stat}");
        }
    }

    #[test]
    fn constant_series_have_no_shape() {
        assert_eq!(stats(&["std", "skew", "kurtosis"], &[1e6; 100]), [0.0; 3]);
    }

    /// The deviation was 0, and so were skew and kurtosis.
    #[test]
    fn statistics_of_an_infinite_value_are_not_finite() {
        let got = stats(&["std", "skew", "kurtosis"], &[1.0, f32::INFINITY, 2.0]);
        assert!(got.iter().all(|value| value.is_nan()), "{got:?}");
    }

    #[test]
    fn unknown_names_are_refused() {
        assert!("p101".parse::<Stat>().is_err());
        assert!("avg".parse::<Stat>().is_err());
    }
}
