//! `cqt`: a constant-Q transform.

use corsmal_dsp::cqt::{C1, CqtParams, CqtPlan};
use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::librosa::LibrosaVersion;
use corsmal_dsp::window::Window;
use ndarray::Array2;
use serde::{Deserialize, Serialize};

use super::kernel::{Extent, Feature, WholeKernel};
use super::kind::FeatureKind;
use super::labels::hertz;
use super::mel_bands::DecibelFinish;
use crate::params::{DbSpec, Keys, LIBROSA, Scale, USUAL_RATE};

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
        let p = CqtParams::new(USUAL_RATE);
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
    const ABOUT: &'static str = "Magnitudes of a constant-Q transform (|librosa.cqt|): n_bins \
                                 bins from fmin on, with bins_per_octave per \
                                 octave; scale turns them into decibels. Holds \
        the whole recording in memory.";
    const KEYS: &'static [Keys] = &[
        LIBROSA,
        Scale::KEYS,
        DbSpec::KEYS,
        &[
            ("hop_length", "Samples from one frame to the next."),
            ("fmin", "Frequency of the lowest bin in Hz; the default is C1."),
            ("n_bins", "Number of bins."),
            ("bins_per_octave", "Bins per octave."),
            ("tuning", "Deviation from A = 440 Hz in fractions of a bin."),
            (
                "filter_scale",
                "Length of the filters; below 1 they are shorter, and resolve time better.",
            ),
            ("sparsity", "Share of the energy of a filter that may be left out."),
            ("window", "Window function of the filters, with scipy's name."),
        ],
    ];
    const PYTHON: &'static str = "cqt";

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
        self.plan(USUAL_RATE).map(drop)
    }
}
