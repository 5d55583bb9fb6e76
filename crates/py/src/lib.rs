//! The private extension module `corsmal_feat._core`.
//!
//! Functions take contiguous `[channels, samples]` or `[channels, rows, frames]` arrays; the typed
//! Python package (`python/corsmal_feat/`) checks, reshapes and gives librosa's signatures. One
//! file per family, exported below. The GIL is released while we compute.

mod arrays;
mod batch;
mod chroma;
mod classifiers;
mod compound;
mod errors;
mod evaluate;
mod extract;
mod frontends;
mod harmonic;
mod listening;
mod mel;
mod nets;
mod onset;
mod pcen;
mod pool;
mod recording;
mod resample;
mod scoring;
mod spectral;
mod spectrum;
mod teller;
mod time_domain;
mod transform;
mod vision;

use pyo3::prelude::*;

#[pymodule]
mod _core {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::batch::{
        PyRecordings, collect, is_stored, lengths, require_store, shown, times_refusal,
    };
    #[pymodule_export]
    use crate::chroma::{chroma, chroma_filter, estimate_tuning, piptrack, pitch_tuning};
    #[pymodule_export]
    use crate::classifiers::{PyModel, classifier_parameters};
    #[pymodule_export]
    use crate::compound::{a34_short, a34f136, paa_fbank, pca_fit, pca_project, sk_resize};
    #[pymodule_export]
    use crate::errors::in_python;
    #[pymodule_export]
    use crate::evaluate::evaluate;
    #[pymodule_export]
    use crate::extract::{
        PySignal, PySignals, check_parquet, effective_config, extract, fetch, fit_projection,
    };
    #[pymodule_export]
    use crate::frontends::{
        m1_stft, m2_mfcc, m3_spectrogram, m4_logmel, m4_windows, m5_a34f136, m5_vggish_patches,
        m6_spectrogram, spec9216,
    };
    #[pymodule_export]
    use crate::harmonic::{
        af193, chroma_cqt, chroma_of_cqt, cqt, hpss_masks, istft, separate, tonnetz,
    };
    #[pymodule_export]
    use crate::listening::{
        cross_validate_network, embed_recordings, hear_recordings, train_network,
    };
    #[pymodule_export]
    use crate::mel::{apply_mel, delta, mel, melspectrogram, mfcc, power_to_db};
    #[pymodule_export]
    use crate::nets::{
        PyNetwork, PyTrainedNetwork, classifier_inputs, network_recipe, networks_published,
        read_weights, write_weights,
    };
    #[pymodule_export]
    use crate::onset::{detrend, onset_backtrack, onset_detect, onset_rises, onset_strength};
    #[pymodule_export]
    use crate::pcen::pcen;
    #[pymodule_export]
    use crate::pool::jobs;
    #[pymodule_export]
    use crate::recording::PyRecording;
    #[pymodule_export]
    use crate::resample::resample;
    #[pymodule_export]
    use crate::scoring::{compare_predictions, cross_validate, fuse, is_statistic, score};
    #[pymodule_export]
    use crate::spectral::{
        fft_frequencies, poly_features, spectral_bandwidth, spectral_centroid, spectral_contrast,
        spectral_flatness, spectral_rolloff, to_mono,
    };
    #[pymodule_export]
    use crate::spectrum::{all_finite, get_window, spectrogram, stft};
    #[pymodule_export]
    use crate::time_domain::{rms, rms_of_spectrogram, zero_crossing_rate};

    #[pymodule_export]
    use crate::vision::{
        cuboid, load_calibration, load_depth, load_mask, lode, m2_capacity, region, upright_box,
    };

    #[pymodule_init]
    fn init(m: &Bound<'_, PyModule>) -> PyResult<()> {
        corsmal_files::memory::keep_freed();
        m.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
