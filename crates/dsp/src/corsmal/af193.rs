//! AF193: the feature vector of the CORSMAL audio baseline, means over time of 40 MFCC, 12 chroma,
//! 128 mel, 7 spectral contrast and 6 tonnetz rows at librosa's defaults.
//!
//! All parts but the last share one transform; tonnetz comes from the harmonic part of the signal.

use std::sync::Arc;

use ndarray::{Array2, Axis};

use crate::chroma::{Chroma, ChromaParams, chroma_filter};
use crate::cqt::{ChromaCqt, ChromaCqtParams, CqtParams, CqtPlan, SignalTuning};
use crate::decibel::Decibel;
use crate::error::{DspError, Result};
use crate::frequency::fft_frequencies;
use crate::hpss::{self, HarmonicPart};
use crate::lanes::{LANES, Row, power_to_decibel};
use crate::librosa::LibrosaVersion;
use crate::mel::{MelParams, SparseBank, mel_filter};
use crate::mfcc::{MfccParams, mfcc_matrix};
use crate::normalize::Norm;
use crate::pitch::{PitchParams, TuningEstimator};
use crate::pool::Pool;
use crate::real::require_finite;
use crate::simd::vectorized;
use crate::spectral::{Contrast, ContrastParams, contrast_from_extremes};
use crate::sums;
use crate::tonnetz::tonnetz;
use crate::tuned::ByTuning;

const N_FFT: usize = 2048;
const HOP: usize = 512;
const N_MFCC: usize = 40;
const N_CHROMA: usize = 12;
const N_MELS: usize = 128;
const N_CONTRAST: usize = 7;
const N_TONNETZ: usize = crate::tonnetz::DIMENSIONS;
/// Bins per octave of the constant-Q transform.
const CQT_BINS: usize = 36;
const CQT_OCTAVES: usize = 7;
/// Cells of the tuning histogram, in bins.
const RESOLUTION: f64 = 0.01;

/// Values of the vector.
pub const LENGTH: usize = N_MFCC + N_CHROMA + N_MELS + N_CONTRAST + N_TONNETZ;

/// Names of the values: `mfcc_0`, ..., `tonnetz_5`.
pub fn names() -> Vec<String> {
    let parts = [
        ("mfcc", N_MFCC),
        ("chroma", N_CHROMA),
        ("mel", N_MELS),
        ("contrast", N_CONTRAST),
        ("tonnetz", N_TONNETZ),
    ];
    parts.iter().flat_map(|(part, n)| (0..*n).map(move |i| format!("{part}_{i}"))).collect()
}

/// Everything that recordings of one sample rate share; threads may use it together.
pub struct Af193 {
    sr: f64,
    librosa: LibrosaVersion,
    harmonic: HarmonicPart,
    mel: SparseBank,
    mfcc: Array2<f64>,
    contrast: Contrast,
    tuning: SignalTuning,
    chroma: ByTuning<Chroma<f32>>,
    cqt: ByTuning<CqtPlan>,
    fold: ChromaCqt,
    works: Pool<Work>,
}

impl Af193 {
    /// By the conventions of librosa 0.11.
    ///
    /// # Errors
    /// A sample rate at which a part does not exist: spectral contrast needs more than 12.8 kHz.
    pub fn new(sr: f64) -> Result<Self> {
        Self::of(sr, LibrosaVersion::V011)
    }

    /// By the conventions of a librosa; the published features are those of 0.8.
    ///
    /// # Errors
    /// As [`Af193::new`].
    pub fn of(sr: f64, librosa: LibrosaVersion) -> Result<Self> {
        let freqs = fft_frequencies(sr, N_FFT)?;
        let contrast = ContrastParams::default();
        let highest = contrast.start_of(contrast.n_bands);
        if highest >= 0.5 * sr {
            let allowed = format!(
                "above {} Hz for af193: the highest band of its spectral contrast starts at {highest} Hz",
                2.0 * highest
            );
            return Err(DspError::parameter("sr", sr, allowed));
        }
        let plan = Self {
            sr,
            librosa,
            harmonic: HarmonicPart::new(librosa)?,
            mel: SparseBank::new(&mel_filter(&MelParams::new(sr, N_FFT))?),
            mfcc: mfcc_matrix(N_MELS, &MfccParams { n_mfcc: N_MFCC, ..MfccParams::default() })?,
            contrast: Contrast::new(&freqs, sr, &contrast)?,
            tuning: SignalTuning::padded(sr, librosa.pad_mode())?,
            chroma: ByTuning::default(),
            cqt: ByTuning::default(),
            fold: ChromaCqt::new(CQT_BINS * CQT_OCTAVES, &ChromaCqtParams::default())?,
            works: Pool::default(),
        };
        plan.cqt(0.0)?;
        Ok(plan)
    }

    /// The vector of one channel.
    ///
    /// # Errors
    /// No samples, or samples that are not finite.
    pub fn compute(&self, y: &[f32]) -> Result<[f32; LENGTH]> {
        require_finite("y", y)?;
        let mut work = self.works.take().unwrap_or_default();
        let vector = self.compute_in(&mut work, y);
        self.works.give_back(work);
        vector
    }

    fn compute_in(&self, work: &mut Work, y: &[f32]) -> Result<[f32; LENGTH]> {
        let Work { separation, harmonic, power, mel, contrast, peaks, valleys } = work;
        power.resize(N_FFT / 2 + 1, 0.0);
        contrast.resize(self.contrast.scratch_len(), 0.0);
        mel.clear();
        peaks.clear();
        valleys.clear();
        let mut spectra = Spectra {
            plan: self,
            frames: 0,
            power,
            mel,
            mel_sum: [0.0; N_MELS],
            contrast,
            peaks,
            valleys,
            pitches: TuningEstimator::new(PitchParams::new(self.sr, N_FFT))?,
        };
        self.harmonic.of(y, harmonic, separation, |m| spectra.push(m))?;
        let mut vector = [0.0; LENGTH];
        let (mfcc, rest) = vector.split_at_mut(N_MFCC);
        let (chroma, rest) = rest.split_at_mut(N_CHROMA);
        let (mel, rest) = rest.split_at_mut(N_MELS);
        let (contrast, tonnetz) = rest.split_at_mut(N_CONTRAST);
        let tuning = spectra.finish(mfcc, mel, contrast)?;
        self.chroma_mean(separation.magnitude(), tuning, chroma)?;
        self.tonnetz_mean(harmonic, tonnetz)?;
        Ok(vector)
    }

    fn chroma_mean(&self, magnitude: &[f32], tuning: f64, out: &mut [f32]) -> Result<()> {
        let chroma = self.chroma.get(tuning, || {
            let params = ChromaParams { tuning, ..ChromaParams::new(self.sr, N_FFT) };
            Ok(Chroma::new(chroma_filter(&params)?.view(), Some(Norm::Max)))
        })?;
        let mut frame = [0.0; N_CHROMA];
        let mut sum = [0.0; N_CHROMA];
        let spectra = magnitude.chunks_exact(N_FFT / 2 + 1);
        let frames = spectra.len();
        for spectrum in spectra {
            chroma.frame(spectrum, &mut frame);
            sum.iter_mut().zip(frame).for_each(|(sum, x)| *sum += f64::from(x));
        }
        store_means(&sum, frames, out);
        Ok(())
    }

    fn cqt(&self, tuning: f64) -> Result<Arc<CqtPlan>> {
        self.cqt.get(tuning, || {
            let params = CqtParams {
                hop_length: HOP,
                n_bins: CQT_BINS * CQT_OCTAVES,
                bins_per_octave: CQT_BINS,
                tuning,
                ..CqtParams::new(self.sr)
            };
            CqtPlan::new(&params.of(self.librosa))
        })
    }

    fn tonnetz_mean(&self, harmonic: &[f32], out: &mut [f32]) -> Result<()> {
        let tuning = self.tuning.estimate([harmonic], CQT_BINS)?.unwrap_or(0.0);
        let chroma = self.fold.of_signal(&*self.cqt(tuning)?, harmonic)?;
        let centroids = tonnetz(chroma.view().insert_axis(Axis(0)))?;
        let sum: Vec<f64> = centroids.index_axis(Axis(0), 0).sum_axis(Axis(1)).to_vec();
        store_means(&sum, chroma.ncols(), out);
        Ok(())
    }
}

fn store_means(sums: &[f64], frames: usize, out: &mut [f32]) {
    for (out, sum) in out.iter_mut().zip(sums) {
        *out = (sum / frames as f64) as f32;
    }
}

/// Working memory of a recording, which later ones use again.
#[derive(Default)]
struct Work {
    separation: hpss::Work<f32>,
    harmonic: Vec<f32>,
    power: Vec<f32>,
    /// Mel powers of all frames, [`N_MELS`] each.
    mel: Vec<Row>,
    contrast: Vec<f32>,
    peaks: Vec<f64>,
    valleys: Vec<f64>,
}

/// What is collected frame by frame from the magnitude spectra.
struct Spectra<'p, 'w> {
    plan: &'p Af193,
    frames: usize,
    power: &'w mut Vec<f32>,
    mel: &'w mut Vec<Row>,
    mel_sum: [f64; N_MELS],
    contrast: &'w mut Vec<f32>,
    peaks: &'w mut Vec<f64>,
    valleys: &'w mut Vec<f64>,
    pitches: TuningEstimator<f32>,
}

impl Spectra<'_, '_> {
    fn push(&mut self, magnitude: &[f32]) {
        self.frames += 1;
        let first = self.mel.len();
        self.mel.resize(first + N_MELS / LANES, Row::ZERO);
        let mel = &mut self.mel[first..];
        vectorized(
            #[inline(always)]
            || {
                self.power.iter_mut().zip(magnitude).for_each(|(p, m)| *p = m * m);
                let slots = mel.iter_mut().flat_map(|row| &mut row.0);
                for (((start, weights), slot), sum) in
                    self.plan.mel.bands().iter().zip(slots).zip(&mut self.mel_sum)
                {
                    *slot = sums::sum_pairs(weights, &self.power[*start..], |w, p| w * p);
                    *sum += f64::from(*slot);
                }
            },
        );
        let at = self.peaks.len();
        self.peaks.resize(at + N_CONTRAST, 0.0);
        self.valleys.resize(at + N_CONTRAST, 0.0);
        let (peaks, valleys) = (&mut self.peaks[at..], &mut self.valleys[at..]);
        self.plan.contrast.peaks_valleys(magnitude, self.contrast, peaks, valleys);
        self.pitches.push(magnitude, None);
    }

    /// Writes the means and returns the tuning.
    fn finish(self, mfcc: &mut [f32], mel: &mut [f32], contrast: &mut [f32]) -> Result<f64> {
        store_means(&self.mel_sum, self.frames, mel);

        let decibel = Decibel::default();
        power_to_decibel(self.mel, decibel.amin as f32, decibel.offset() as f32);
        let log_mel = vectorized(
            #[inline(always)]
            || {
                let peak = self.mel.iter().fold(f32::NEG_INFINITY, |max, row| {
                    row.0.iter().fold(max, |max, x| if *x > max { *x } else { max })
                });
                let floor = decibel.top_db.map_or(f32::NEG_INFINITY, |range| peak - range as f32);
                let mut sums = [0.0; N_MELS];
                for frame in self.mel.chunks_exact(N_MELS / LANES) {
                    for (sums, row) in sums.chunks_exact_mut(LANES).zip(frame) {
                        for (sum, x) in sums.iter_mut().zip(&row.0) {
                            *sum += f64::from(if *x > floor { *x } else { floor });
                        }
                    }
                }
                sums
            },
        );
        // The cosine transform is linear: that of the mean is the mean of all.
        let cepstrum = self.plan.mfcc.dot(&ndarray::aview1(&log_mel));
        store_means(cepstrum.as_slice().expect("a new array"), self.frames, mfcc);

        contrast_from_extremes(self.peaks, self.valleys, false)?;
        let mut sum = [0.0; N_CONTRAST];
        for frame in self.peaks.chunks_exact(N_CONTRAST) {
            sum.iter_mut().zip(frame).for_each(|(sum, x)| *sum += x);
        }
        store_means(&sum, self.frames, contrast);
        Ok(self.pitches.finish(RESOLUTION, N_CHROMA)?.unwrap_or(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_has_its_name() {
        let names = names();
        assert_eq!(names.len(), LENGTH);
        assert_eq!([&names[0], &names[40], &names[192]], ["mfcc_0", "chroma_0", "tonnetz_5"]);
    }

    #[test]
    fn short_and_silent_signals_are_finite() {
        let plan = Af193::new(22050.0).unwrap();
        for y in [vec![0.5_f32], vec![0.0; 5000], vec![1.0; 3000]] {
            assert!(plan.compute(&y).unwrap().iter().all(|x| x.is_finite()));
        }
        assert!(plan.compute(&[]).is_err());
        assert!(plan.compute(&[f32::NAN]).is_err());
    }

    #[test]
    fn a_plan_gives_the_same_bits_again() {
        let plan = Af193::new(16000.0).unwrap();
        let y: Vec<f32> = (0..20000).map(|i| ((i * i) as f32 * 1e-4).sin()).collect();
        assert_eq!(plan.compute(&y).unwrap(), plan.compute(&y).unwrap());
    }

    #[test]
    fn a_rate_without_all_octaves_is_refused() {
        assert!(Af193::new(8000.0).is_err());
    }
}
