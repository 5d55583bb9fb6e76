//! Peaks of whole spectrograms, bin by bin.

use ndarray::{Array2, Array3, ArrayView2, ArrayView3, s};
use rayon::prelude::*;

use super::{AT_ONCE, PitchParams, PitchTracker, check};
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
    let (_, bins, frames) = s.dim();
    let references = match reference {
        Some(given) => given.as_standard_layout().into_owned(),
        None => thresholds(s.view(), T::of(params.threshold)),
    };
    let values = s.as_slice().expect("in C order");
    let pitches_of = pitches.as_slice_mut().expect("made in C order").par_chunks_mut(frames);
    let magnitudes_of = magnitudes.as_slice_mut().expect("made in C order").par_chunks_mut(frames);
    pitches_of.zip(magnitudes_of).enumerate().for_each(|(i, (pitches, magnitudes))| {
        let (channel, bin) = (i / bins, i % bins);
        if (tracker.first.max(1)..tracker.end).contains(&bin) {
            let row = |i: usize| &values[i * frames..(i + 1) * frames];
            let around = Around {
                bin,
                left: row(i - 1),
                here: row(i),
                right: (bin + 1 < bins).then(|| row(i + 1)),
                references: references.row(channel).to_slice().expect("in C order"),
            };
            around.peaks(&tracker, pitches, magnitudes);
        }
    });
    Ok((pitches, magnitudes))
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
                        *largest = if x > *largest { x } else { *largest };
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
    /// Peaks into `pitches` and `magnitudes`, which are zero.
    fn peaks(&self, tracker: &PitchTracker, pitches: &mut [T], magnitudes: &mut [T]) {
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
                    (pitches[t], magnitudes[t]) = (peak.pitch, peak.magnitude);
                }
            }
        }
    }
}
