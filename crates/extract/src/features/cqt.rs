//! `cqt`: a constant-Q transform.

use corsmal_dsp::cqt::{C1, CqtParams, CqtPlan};
use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::librosa::LibrosaVersion;
use corsmal_dsp::window::Window;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::mel_bands::DecibelFinish;
use super::{Extent, Feature, FeatureKind, WholeKernel, hertz};
use crate::config::{DbSpec, Scale};

/// Parameters of `cqt`.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(default)]
pub struct Cqt {
    hop_length: usize,
    fmin: f64,
    n_bins: usize,
    bins_per_octave: usize,
    tuning: f64,
    filter_scale: f64,
    sparsity: f64,
    window: Window,
    librosa: LibrosaVersion,
    scale: Scale,
    #[serde(flatten)]
    db: DbSpec,
}

impl Default for Cqt {
    fn default() -> Self {
        let p = CqtParams::new(super::USUAL_RATE);
        Self {
            hop_length: p.hop_length,
            fmin: C1,
            n_bins: p.n_bins,
            bins_per_octave: p.bins_per_octave,
            tuning: p.tuning,
            filter_scale: p.filter_scale,
            sparsity: p.sparsity,
            window: p.window,
            librosa: LibrosaVersion::default(),
            scale: Scale::Linear,
            db: DbSpec::default(),
        }
    }
}

struct Magnitudes {
    transform: CqtPlan,
    scale: Scale,
    decibel: Decibel,
}

impl WholeKernel for Magnitudes {
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>> {
        let mut values = self.transform.transform(y)?.mapv(|z| z.norm());
        if self.scale == Scale::AmplitudeToDb {
            values.mapv_inplace(|x| x * x);
        }
        if self.scale != Scale::Linear {
            self.decibel.power(values.as_slice_mut().expect("made in C order"))?;
        }
        Ok(values)
    }
}

impl FeatureKind for Cqt {
    const KIND: &'static str = "cqt";
    const ABOUT: &'static str = "Magnitudes of a constant-Q transform (|librosa.cqt|): n_bins bins, \
        bins_per_octave of them to the octave, from fmin on; scale turns them into decibels. Holds \
        the whole recording in memory.";

    fn plan(&self, sr: f64) -> corsmal_dsp::Result<Feature> {
        let params = CqtParams {
            hop_length: self.hop_length,
            fmin: self.fmin,
            n_bins: self.n_bins,
            bins_per_octave: self.bins_per_octave,
            tuning: self.tuning,
            filter_scale: self.filter_scale,
            sparsity: self.sparsity,
            window: self.window.clone(),
            ..CqtParams::new(sr)
        };
        let transform = CqtPlan::new(&params.of(self.librosa))?;
        // The clamp follows once the maximum of the recording is known.
        let decibel = Decibel { top_db: None, ..self.db.decibel(self.scale)? };
        let per_octave = self.bins_per_octave as f64;
        let frequency = |k: usize| self.fmin * ((k as f64 + self.tuning) / per_octave).exp2();
        let labels = (0..self.n_bins).map(|k| hertz(frequency(k))).collect();
        let kernel = Magnitudes { transform, scale: self.scale, decibel };
        let extent = Extent::Frames(self.hop_length as f64);
        let finish = DecibelFinish::of(self.scale, &self.db, self.n_bins);
        Ok(Feature { finish, ..Feature::whole(extent, kernel, labels) })
    }

    /// Made for a common rate: the transform costs milliseconds, and more at higher ones.
    fn check(&self) -> corsmal_dsp::Result<()> {
        self.plan(super::USUAL_RATE).map(drop)
    }
}
