//! Peaks of whole spectrograms, bin by bin.

use ndarray::{Array2, Array3, ArrayView2, ArrayView3, Axis, s};
use rayon::prelude::*;

use super::{AT_ONCE, Peak, PitchParams, PitchTracker, TuningEstimator, check};
use crate::decibel::larger;
use crate::error::Result;
use crate::real::Real;
use crate::simd::vectorized;

/// Frames of which one thread takes the maxima.
const FRAMES: usize = 128;

/// Pitches in Hz and magnitudes of all peaks, each shaped as `s [channels, bins, frames]` and zero
/// elsewhere (`piptrack`). `reference [channels, frames]` replaces the threshold.
///
/// # Errors
/// As [`PitchTracker::new`], or arrays that do not fit.
pub fn piptrack<T: Real>(
    s: ArrayView3<T>,
    reference: Option<ArrayView2<T>>,
    params: PitchParams,
) -> Result<(Array3<T>, Array3<T>)> {
    let tracker = PitchTracker::new(params)?;
    check(&tracker, s, reference)?;
    let (mut pitches, mut magnitudes) = (Array3::zeros(s.raw_dim()), Array3::zeros(s.raw_dim()));
    if s.is_empty() {
        return Ok((pitches, magnitudes));
    }
    let s = s.as_standard_layout();
    let bins = Bins::new(&tracker, s.view(), reference);
    let frames = bins.frames;
    let pitches_of = pitches.as_slice_mut().expect("made in C order").par_chunks_mut(frames);
    let magnitudes_of = magnitudes.as_slice_mut().expect("made in C order").par_chunks_mut(frames);
    pitches_of.zip(magnitudes_of).enumerate().for_each(|(i, (pitches, magnitudes))| {
        let bin = i % bins.bins;
        if tracker.bins().contains(&bin) {
            bins.around(i / bins.bins, bin).peaks(&tracker, |t, peak| {
                (pitches[t], magnitudes[t]) = (peak.pitch, peak.magnitude);
            });
        }
    });
    Ok((pitches, magnitudes))
}

/// Adds all peaks of `s [channels, bins, frames]` to `estimator`, where their order plays no part.
pub(super) fn collect<T: Real>(
    estimator: &mut TuningEstimator<T>,
    s: ArrayView3<T>,
    reference: Option<ArrayView2<T>>,
) {
    if s.is_empty() {
        return;
    }
    let s = s.as_standard_layout();
    let tracker = estimator.tracker();
    let bins = Bins::new(tracker, s.view(), reference);
    let (searched, channels) = (tracker.bins(), s.len_of(Axis(0)));
    let parts = (0..channels * searched.len()).into_par_iter().with_min_len(ROWS);
    let parts = parts.fold(
        || TuningEstimator::of(tracker.clone()),
        |mut found, i| {
            let (channel, bin) = (i / searched.len(), searched.start + i % searched.len());
            bins.around(channel, bin).peaks(tracker, |_, peak| found.add(peak));
            found
        },
    );
    let parts: Vec<_> = parts.collect();
    parts.into_iter().for_each(|part| estimator.merge(part));
}

/// Bins of which one thread takes the peaks at least.
const ROWS: usize = 16;

/// The bins of a spectrogram, each with its neighbours, and what peaks exceed.
struct Bins<'a, T> {
    values: &'a [T],
    bins: usize,
    frames: usize,
    /// `[channels, frames]`.
    references: Array2<T>,
}

impl<'a, T: Real> Bins<'a, T> {
    /// Of a spectrogram in C order that is not empty.
    fn new(tracker: &PitchTracker, s: ArrayView3<'a, T>, reference: Option<ArrayView2<T>>) -> Self {
        let (_, bins, frames) = s.dim();
        let references = match reference {
            Some(given) => given.as_standard_layout().into_owned(),
            None => thresholds(s, T::of(tracker.params.threshold)),
        };
        Self { values: s.to_slice().expect("in C order"), bins, frames, references }
    }

    fn around(&self, channel: usize, bin: usize) -> Around<'_, T> {
        let row = |bin: usize| {
            let start = (channel * self.bins + bin) * self.frames;
            &self.values[start..start + self.frames]
        };
        Around {
            bin,
            left: row(bin - 1),
            here: row(bin),
            right: (bin + 1 < self.bins).then(|| row(bin + 1)),
            references: self.references.row(channel).to_slice().expect("in C order"),
        }
    }
}

/// The share `threshold` of the largest magnitude of every spectrum, `[channels, frames]`.
fn thresholds<T: Real>(s: ArrayView3<T>, threshold: T) -> Array2<T> {
    let (channels, bins, frames) = s.dim();
    let mut largest = Array2::zeros((channels, frames));
    let rows = largest.as_slice_mut().expect("made in C order").chunks_mut(frames).enumerate();
    let parts = rows.flat_map(|(channel, row)| {
        let parts = row.chunks_mut(FRAMES).enumerate();
        parts.map(move |(i, part)| (channel, i * FRAMES, part))
    });
    parts.collect::<Vec<_>>().into_par_iter().for_each(|(channel, first, part)| {
        for bin in 0..bins {
            let row = s.slice(s![channel, bin, first..first + part.len()]);
            let row = row.to_slice().expect("in C order");
            vectorized(
                #[inline(always)]
                || {
                    for (largest, x) in part.iter_mut().zip(row) {
                        let x = x.abs();
                        *largest = larger(x, *largest);
                    }
                },
            );
        }
        part.iter_mut().for_each(|x| *x = threshold * *x);
    });
    largest
}

/// A bin of all frames, with its neighbours.
struct Around<'a, T> {
    bin: usize,
    left: &'a [T],
    here: &'a [T],
    right: Option<&'a [T]>,
    references: &'a [T],
}

impl<T: Real> Around<'_, T> {
    /// Calls `each` with the frames that have a peak in this bin.
    fn peaks(&self, tracker: &PitchTracker, mut each: impl FnMut(usize, Peak<T>)) {
        let parts = self.here.chunks(AT_ONCE).zip(self.references.chunks(AT_ONCE)).enumerate();
        for (i, (here, references)) in parts {
            // Most frames are far below the reference.
            let low = vectorized(
                #[inline(always)]
                || {
                    let pairs = here.iter().zip(references);
                    pairs.fold(true, |low, (x, reference)| low & (x.abs() <= *reference))
                },
            );
            if low {
                continue;
            }
            for (t, (here, reference)) in (i * AT_ONCE..).zip(here.iter().zip(references)) {
                let right = self.right.map(|right| right[t].abs());
                let magnitude = (self.left[t].abs(), here.abs(), right);
                if let Some(peak) = tracker.peak(self.bin, magnitude, *reference) {
                    each(t, peak);
                }
            }
        }
    }
}
