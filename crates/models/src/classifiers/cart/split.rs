//! The search for the best split of a node.

use rand::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use rayon::prelude::*;

use super::Growth;
use super::columns::FeatureColumns;
use super::sample::Sample;
use super::tally::Tally;

/// Values to be sorted above which the features of one node are shared among threads.
const PARALLEL_WORK: usize = 200_000;

/// Where a node is split.
pub(super) struct Split {
    pub feature: usize,
    pub threshold: f32,
    pub gain: f64,
}

/// The search for the best split of one node.
pub(super) struct Search<'a> {
    pub columns: &'a FeatureColumns,
    pub sample: &'a Sample<'a>,
    pub growth: &'a Growth,
    /// rows of the node, class after class
    pub rows: &'a [u32],
    /// how often each counts
    pub times: Vec<u32>,
    /// each class there with the end of its rows
    pub ends: Vec<(usize, usize)>,
    /// weight of each class
    pub totals: &'a [f64],
}

impl Search<'_> {
    /// Looks at features in random order until enough of them, and at least one that varies, have
    /// been seen. The first of equal splits wins.
    pub(super) fn best(&self, features: &mut [u32], rng: &mut Xoshiro256PlusPlus) -> Option<Split> {
        let wanted = self.growth.max_features.of(features.len());
        if !self.growth.random_thresholds
            && wanted > 1
            && wanted.saturating_mul(self.rows.len()) >= PARALLEL_WORK
        {
            return self.best_parallel(features, wanted, rng);
        }
        let mut scratch = Scratch::default();
        let mut best: Option<Split> = None;
        let mut varied = false;
        for i in 0..features.len() {
            if i >= wanted && varied {
                break;
            }
            let pick = rng.gen_range(i..features.len());
            features.swap(i, pick);
            let feature = features[i] as usize;
            let found = if self.growth.random_thresholds {
                self.random_split(feature, rng, &mut scratch)
            } else {
                self.exhaustive_split(feature, &mut scratch)
            };
            let Some(found) = found else { continue };
            varied = true;
            if found.gain > best.as_ref().map_or(f64::NEG_INFINITY, |b| b.gain) {
                best = Some(found);
            }
        }
        best.filter(|b| b.gain.is_finite())
    }

    /// The same for big nodes, the first `wanted` features at once.
    fn best_parallel(
        &self,
        features: &mut [u32],
        wanted: usize,
        rng: &mut Xoshiro256PlusPlus,
    ) -> Option<Split> {
        for i in 0..wanted {
            let pick = rng.gen_range(i..features.len());
            features.swap(i, pick);
        }
        let found: Vec<_> = features[..wanted]
            .par_iter()
            .map_init(Scratch::default, |scratch, &f| self.exhaustive_split(f as usize, scratch))
            .collect();
        let mut best: Option<Split> = None;
        let mut varied = false;
        let mut consider = |found: Option<Split>| {
            let Some(found) = found else { return false };
            if found.gain > best.as_ref().map_or(f64::NEG_INFINITY, |b| b.gain) {
                best = Some(found);
            }
            true
        };
        for found in found {
            varied |= consider(found);
        }
        let mut scratch = Scratch::default();
        for i in wanted..features.len() {
            if varied {
                break;
            }
            let pick = rng.gen_range(i..features.len());
            features.swap(i, pick);
            varied |= consider(self.exhaustive_split(features[i] as usize, &mut scratch));
        }
        best.filter(|b| b.gain.is_finite())
    }

    /// The best threshold of one feature; `None` if it does not vary here.
    fn exhaustive_split(&self, feature: usize, scratch: &mut Scratch) -> Option<Split> {
        let column = self.columns.column(feature);
        let keys = &mut scratch.keys;
        keys.clear();
        // Value (as an integer of the same order) above, row below: one plain integer sort.
        keys.extend(
            self.rows.iter().map(|&r| u64::from(ordered(column[r as usize])) << 32 | u64::from(r)),
        );
        let (mut low, mut high) = (u64::MAX, 0);
        for &key in keys.iter() {
            low = low.min(key);
            high = high.max(key);
        }
        if low >> 32 == high >> 32 {
            return None;
        }
        keys.sort_unstable();
        let mut tally =
            Tally::new(self.growth.criterion, self.totals, &mut scratch.left, &mut scratch.right);
        let leaf = self.growth.min_samples_leaf;
        let mut best = Split { feature, threshold: 0.0, gain: f64::NEG_INFINITY };
        let mut best_at = 0;
        for at in 1..keys.len() {
            let row = keys[at - 1] as u32 as usize;
            tally.shift(self.sample.y[row] as usize, self.sample.weight(row));
            if keys[at] >> 32 == keys[at - 1] >> 32 || at < leaf || keys.len() - at < leaf {
                continue;
            }
            let gain = tally.gain();
            if gain > best.gain {
                best.gain = gain;
                best_at = at;
            }
        }
        if best_at > 0 {
            let value = |at: usize| column[keys[at] as u32 as usize];
            best.threshold = between(value(best_at - 1), value(best_at));
        }
        Some(best)
    }

    /// A threshold drawn between the smallest and the largest value.
    fn random_split(
        &self,
        feature: usize,
        rng: &mut Xoshiro256PlusPlus,
        scratch: &mut Scratch,
    ) -> Option<Split> {
        let column = self.columns.column(feature);
        let values = &mut scratch.values;
        values.clear();
        values.extend(self.rows.iter().map(|&row| column[row as usize]));
        let (low, high) = extremes(values);
        if low >= high {
            return None;
        }
        let drawn = f64::from(low) + rng.r#gen::<f64>() * (f64::from(high) - f64::from(low));
        let mut threshold = drawn as f32;
        if threshold >= high || threshold < low {
            threshold = low;
        }
        let mut tally =
            Tally::new(self.growth.criterion, self.totals, &mut scratch.left, &mut scratch.right);
        let (mut start, mut count) = (0, 0);
        for &(class, end) in &self.ends {
            let pairs = values[start..end].iter().zip(&self.times[start..end]);
            if self.sample.row_weights.is_some() {
                let members = self.rows[start..end].iter().zip(&values[start..end]);
                for (&row, _) in members.filter(|(_, value)| **value <= threshold) {
                    count += 1;
                    tally.left[class] += self.sample.weight(row as usize);
                }
                start = end;
                continue;
            }
            let (mut rows, mut times) = (0u32, 0u32);
            for (&value, &n) in pairs {
                let left = u32::from(value <= threshold);
                rows += left;
                times += n & left.wrapping_neg();
            }
            count += rows as usize;
            tally.left[class] = f64::from(times) * self.sample.class_weights[class];
            start = end;
        }
        tally.recount(self.totals);
        let leaf = self.growth.min_samples_leaf;
        let allowed = count >= leaf && self.rows.len() - count >= leaf;
        let gain = if allowed { tally.gain() } else { f64::NEG_INFINITY };
        Some(Split { feature, threshold, gain })
    }
}

/// Buffers reused from feature to feature.
#[derive(Default)]
struct Scratch {
    keys: Vec<u64>,
    values: Vec<f32>,
    left: Vec<f64>,
    right: Vec<f64>,
}

/// The smallest and the largest of finite values.
fn extremes(values: &[f32]) -> (f32, f32) {
    // Independent lanes: the compiler may not reorder comparisons of one.
    let (mut low, mut high) = ([f32::INFINITY; 16], [f32::NEG_INFINITY; 16]);
    let (chunks, rest) = values.as_chunks::<16>();
    let smaller = |a: f32, b: f32| if b < a { b } else { a };
    let larger = |a: f32, b: f32| if b > a { b } else { a };
    for chunk in chunks {
        for (i, &value) in chunk.iter().enumerate() {
            low[i] = smaller(low[i], value);
            high[i] = larger(high[i], value);
        }
    }
    let lows = low.iter().chain(rest).copied();
    let highs = high.iter().chain(rest).copied();
    (lows.fold(f32::INFINITY, smaller), highs.fold(f32::NEG_INFINITY, larger))
}

/// Bits of `value` as an integer that sorts the same way; both zeros are one.
fn ordered(value: f32) -> u32 {
    let bits = (value + 0.0).to_bits();
    if bits >> 31 == 1 { !bits } else { bits | 1 << 31 }
}

/// A threshold with `low ≤ threshold < high`.
fn between(low: f32, high: f32) -> f32 {
    let middle = ((f64::from(low) + f64::from(high)) / 2.0) as f32;
    if middle >= high || middle < low { low } else { middle }
}
