//! What pyAudioAnalysis computes again for every frame: mel filters, chroma assignment, DCT.

use std::f64::consts::PI;

use ndarray::Array2;

use crate::error::{DspError, Result};
use crate::frequency::require_rate;

/// Filters of the talkbox bank: 13 linearly and 27 logarithmically spaced.
const LINEAR: usize = 13;
const FILTERS: usize = 40;
pub(super) const N_MFCC: usize = 13;
pub(super) const N_CHROMA: usize = 12;

/// The non-zero part of one filter.
#[derive(Debug, Clone)]
pub(super) struct Filter {
    pub first: usize,
    pub weights: Vec<f64>,
}

/// The 40 triangles over `num_fft` bins. Bin `k` is taken to lie at `k / num_fft * sr` although the
/// bins span only half the rate, so every filter sits at half its nominal frequency.
pub(super) fn filters(sr: f64, num_fft: usize) -> Result<Vec<Filter>> {
    let n = num_fft as f64;
    let mut edges: Vec<f64> = (0..LINEAR).map(|i| 133.33 + i as f64 * (200.0 / 3.0)).collect();
    let last = edges[LINEAR - 1];
    edges.extend((1..=FILTERS + 2 - LINEAR).map(|i| last * 1.0711703f64.powi(i as i32)));
    let first_above = |f: f64| (f * n / sr).floor() as usize + 1;
    let highest = first_above(edges[FILTERS + 1]) - 1;
    if highest >= num_fft {
        let top = edges[FILTERS + 1];
        let allowed = format!("above {top:.0} Hz, the end of the mel filters");
        return Err(DspError::parameter("sr", sr, allowed));
    }
    let filter = |e: &[f64]| {
        let [low, centre, high] = [e[0], e[1], e[2]];
        let height = 2.0 / (high - low);
        let (first, peak, end) = (first_above(low), first_above(centre), first_above(high));
        let frequency = |k: usize| k as f64 / n * sr;
        let rising = (first..peak).map(|k| height / (centre - low) * (frequency(k) - low));
        let falling = (peak..end).map(|k| height / (high - centre) * (high - frequency(k)));
        Filter { first, weights: rising.chain(falling).collect() }
    };
    Ok(edges.windows(3).map(filter).collect())
}

/// The bank as a matrix `[40, num_fft]` (pyAudioAnalysis `mfcc_filter_banks`).
///
/// # Errors
/// No bins, or a rate below the highest filter.
pub fn paa_fbank(sr: f64, num_fft: usize) -> Result<Array2<f64>> {
    if num_fft == 0 {
        return Err(DspError::parameter("num_fft", num_fft, "at least 1"));
    }
    require_rate(sr)?;
    let mut bank = Array2::zeros((FILTERS, num_fft));
    for (mut row, filter) in bank.outer_iter_mut().zip(filters(sr, num_fft)?) {
        for (slot, w) in row.iter_mut().skip(filter.first).zip(filter.weights) {
            *slot = w;
        }
    }
    Ok(bank)
}

/// First 13 rows of the orthonormal DCT-II of 40 values.
pub(super) fn dct() -> Array2<f64> {
    let n = FILTERS as f64;
    Array2::from_shape_fn((N_MFCC, FILTERS), |(k, i)| {
        let scale = if k == 0 { (1.0 / n).sqrt() } else { (2.0 / n).sqrt() };
        scale * (PI * k as f64 * (2.0 * i as f64 + 1.0) / (2.0 * n)).cos()
    })
}

/// A bin whose energy reaches the chroma vector.
#[derive(Debug, Clone, Copy)]
pub(super) struct ChromaBin {
    pub bin: usize,
    pub class: usize,
    pub divisor: f64,
}

/// Which bins count and where. pyAudioAnalysis assigns (rather than adds) each bin to its semitone
/// number, so only the last bin of a semitone counts; negative numbers wrap to the end of the
/// array; and the divisor is looked up by semitone number where a bin number was meant.
pub(super) fn chroma_bins(sr: f64, num_fft: usize) -> Result<Vec<ChromaBin>> {
    let semitone = |k: usize| {
        let frequency = (k + 1) as f64 * sr / (2.0 * num_fft as f64);
        (12.0 * (frequency / 27.5).log2()).round_ties_even() as i64
    };
    let semitones: Vec<i64> = (0..num_fft).map(semitone).collect();
    let n = num_fft as i64;
    let (low, high) = (semitones[0], semitones[num_fft - 1]);
    if high >= n || low < -n {
        let allowed = format!(
            "at least {} samples, since the chroma code needs more bins than semitones",
            2 * high.max(-low).max(0) + 2
        );
        return Err(DspError::parameter("window", 2 * num_fft, allowed));
    }
    let slot = |s: i64| if s < 0 { (s + n) as usize } else { s as usize };
    let mut members = std::collections::HashMap::new();
    for &s in &semitones {
        *members.entry(s).or_insert(0u32) += 1;
    }
    let mut owner = vec![None; num_fft];
    for (bin, &s) in semitones.iter().enumerate() {
        owner[slot(s)] = Some(bin);
    }
    let bins = owner.iter().enumerate().filter_map(|(j, bin)| {
        let looked_up = semitones[slot(semitones[j])];
        bin.map(|bin| ChromaBin {
            bin,
            class: j % N_CHROMA,
            divisor: f64::from(members[&looked_up]),
        })
    });
    Ok(bins.collect())
}
