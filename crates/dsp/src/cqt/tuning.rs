//! Tuning of a signal, as the constant-Q features estimate it.

use crate::error::Result;
use crate::lanes::{LANES, LaneFft, Row, Slots, gather};
use crate::pitch::{PitchParams, TuningEstimator};
use crate::real::Real;
use crate::simd::vectorized;
use crate::stft::{PadMode, StftParams};
use crate::transform::Forward;
use crate::window::get_window;

/// Transform length of librosa's `estimate_tuning`.
const N_FFT: usize = 2048;
const HOP: usize = N_FFT / 4;
/// Cells of the histogram, in bins.
const RESOLUTION: f64 = 0.01;

/// Collects the pitches of signals on their magnitude spectra (librosa 0.11 `estimate_tuning` with
/// its defaults). Tables are made once.
pub struct SignalTuning {
    params: PitchParams,
    window: Vec<f32>,
    lanes: LaneFft,
    precise: Forward<f64>,
}

impl SignalTuning {
    /// # Errors
    /// `sr` that is not positive.
    pub fn new(sr: f64) -> Result<Self> {
        Self::padded(sr, PadMode::default())
    }

    /// With another padding of the ends.
    ///
    /// # Errors
    /// `sr` that is not positive.
    pub fn padded(sr: f64, pad_mode: PadMode) -> Result<Self> {
        let stft = StftParams { pad_mode, ..StftParams::new(N_FFT, HOP) };
        let window = get_window(&stft.window, N_FFT, true)?;
        let params = PitchParams::new(sr, N_FFT);
        TuningEstimator::<f32>::new(params)?;
        Ok(Self {
            params,
            window: window.into_iter().map(|w| w as f32).collect(),
            lanes: LaneFft::new(N_FFT)?,
            precise: Forward::new(&stft)?,
        })
    }

    /// Deviation from A440 in fractions of a bin, one for all `channels`, in [-0.5, 0.5) and in
    /// steps of 0.01; `None` without any pitch.
    ///
    /// # Errors
    /// `bins_per_octave = 0`.
    pub fn estimate<'y, T: Real>(
        &self,
        channels: impl IntoIterator<Item = &'y [T]>,
        bins_per_octave: usize,
    ) -> Result<Option<f64>> {
        let mut estimator = TuningEstimator::new(self.params)?;
        for y in channels {
            match T::as_f32(y) {
                Some(narrow) => self.collect_in_lanes(narrow, &mut estimator),
                None => self.collect(y, &mut estimator),
            }
        }
        estimator.finish(RESOLUTION, bins_per_octave)
    }

    fn collect<T: Real>(&self, y: &[T], estimator: &mut TuningEstimator<T>) {
        let mut scratch = self.precise.scratch();
        for t in 0..self.precise.params().n_frames(y.len()) {
            let spectrum = self.precise.spectrum(y, t, &mut scratch);
            let magnitude: Vec<T> = spectrum.iter().map(|z| T::of(z.norm())).collect();
            estimator.push(&magnitude, None);
        }
    }

    fn collect_in_lanes<T: Real>(&self, y: &[f32], estimator: &mut TuningEstimator<T>) {
        let padded = self.precise.params().pad_mode.extended(y, N_FFT / 2);
        let mut frames = vec![Row::ZERO; N_FFT];
        let mut power = vec![Row::ZERO; self.lanes.n_bins()];
        let reach = estimator.tracker().reach();
        let mut magnitudes = vec![T::zero(); LANES * reach];
        for slots in Slots::blocks(self.precise.params().n_frames(y.len()), 1) {
            gather(&padded, HOP, &self.window, slots, &mut frames);
            self.lanes.power(&mut frames, &mut power);
            // The square root keeps the order, so the largest power has the largest magnitude.
            let mut largest = Row::ZERO;
            vectorized(
                #[inline(always)]
                || {
                    for row in &power {
                        for (top, x) in largest.0.iter_mut().zip(&row.0) {
                            *top = if *x > *top { *x } else { *top };
                        }
                    }
                    for row in &mut power[..reach] {
                        row.0.iter_mut().for_each(|x| *x = x.sqrt());
                    }
                },
            );
            let threshold = T::of(self.params.threshold);
            for (s, magnitude) in magnitudes.chunks_exact_mut(reach).take(slots.len).enumerate() {
                for (m, row) in magnitude.iter_mut().zip(&power) {
                    *m = T::of(row.0[s].into());
                }
                let reference = threshold * T::of(largest.0[s].sqrt().into());
                estimator.push(magnitude, Some(reference));
            }
        }
    }
}
