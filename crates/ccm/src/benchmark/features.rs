//! The three feature sets of the audio baselines, as their published code computes them.

use std::path::Path;

use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::mel::{MelParams, SparseBank, mel_filter};
use corsmal_dsp::mfcc::{MfccParams, mfcc};
use corsmal_dsp::resample::resample_windowed_sinc;
use corsmal_dsp::resize::{ResizeParams, resize};
use corsmal_dsp::stft::{PadMode, StftParams, spectrogram};
use corsmal_dsp::time_domain::{FrameParams, ZeroCrossingParams, zero_crossing_rate};
use ndarray::{Array2, Axis, s};

/// Longest recording that is read, in samples of all channels (20 minutes of eight channels).
const MAX_SAMPLES: usize = 44_100 * 8 * 60 * 20;

const RATE: f64 = 22_050.0;

/// Seconds of the spectrogram.
const SPECTROGRAM_S: usize = 10;

/// A feature set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum FeatureSet {
    /// Means and deviations of MFCC 1 to 12 and of the zero-crossing rate: 26 values.
    ZcrMfcc,
    /// Means of MFCC, chroma, mel, spectral contrast and tonnetz: 193 values.
    Af193,
    /// Spectrogram resized to 96 x 96: 9,216 values.
    Spectrogram,
}

impl FeatureSet {
    /// All sets.
    pub const ALL: [Self; 3] = [Self::ZcrMfcc, Self::Af193, Self::Spectrogram];

    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::ZcrMfcc => "ZCR + MFCCs",
            Self::Af193 => "AF193",
            Self::Spectrogram => "Spect.",
        }
    }

    /// Name in files.
    pub fn slug(self) -> &'static str {
        match self {
            Self::ZcrMfcc => "zcr-mfcc",
            Self::Af193 => "af193",
            Self::Spectrogram => "spectrogram",
        }
    }

    /// Values per recording.
    pub fn width(self) -> usize {
        match self {
            Self::ZcrMfcc => 26,
            Self::Af193 => 193,
            Self::Spectrogram => 96 * 96,
        }
    }

    /// Whether training recordings are cropped to their annotated action.
    pub fn cropped(self) -> bool {
        self == Self::Spectrogram
    }
}

/// Computes feature vectors of recordings.
pub trait FeatureSource: Sync {
    /// Everything that decides the values of a set, as text: the cache is keyed by it.
    fn identity(&self, set: FeatureSet) -> String;

    /// The vector of a recording, cropped to a span in seconds where one is given.
    ///
    /// # Errors
    /// What is wrong with the recording.
    fn vector(
        &self,
        set: FeatureSet,
        path: &Path,
        crop: Option<(f64, f64)>,
    ) -> Result<Vec<f32>, String>;
}

/// The sets by this project's own signal processing, with librosa 0.8's choices: `kaiser_best`
/// resampling, reflected edges.
#[derive(Clone, Copy, Debug, Default)]
pub struct BaselineFeatures;

impl FeatureSource for BaselineFeatures {
    fn identity(&self, set: FeatureSet) -> String {
        let what = match set {
            FeatureSet::ZcrMfcc => "mean of channels, 22050 Hz kaiser_best, 20 MFCC 1..12, zcr",
            FeatureSet::Af193 => "channel 0, native rate, means of 40+12+128+7+6",
            FeatureSet::Spectrogram => {
                "mean of channels, 22050 Hz kaiser_best, action crop, rms 1, 10 s, stft 512/128, \
                 dB 80, 96x96"
            }
        };
        format!("{}/1: {what}; corsmal-feat {}", set.slug(), env!("CARGO_PKG_VERSION"))
    }

    fn vector(
        &self,
        set: FeatureSet,
        path: &Path,
        crop: Option<(f64, f64)>,
    ) -> Result<Vec<f32>, String> {
        let (samples, rate) = read(path)?;
        let vector = match set {
            FeatureSet::ZcrMfcc => zcr_mfcc(mono(&samples, rate)?.view()),
            FeatureSet::Af193 => corsmal_dsp::af193::Af193::new(rate)
                .and_then(|plan| plan.compute(&samples.row(0).to_vec()))
                .map(|v| v.to_vec()),
            FeatureSet::Spectrogram => spectrogram96(mono(&samples, rate)?, crop),
        };
        vector.map_err(|e| e.to_string())
    }
}

/// `[channels, samples]` and the rate.
fn read(path: &Path) -> Result<(Array2<f32>, f64), String> {
    let mut source = corsmal_audio::open(path).map_err(|e| e.to_string())?;
    let (channels, rate) = (usize::from(source.spec().channels), source.spec().sample_rate);
    let mut block = vec![0.0f32; 8192 * channels];
    let mut interleaved = Vec::new();
    loop {
        let frames = source.read(&mut block).map_err(|e| e.to_string())?;
        if frames == 0 {
            break;
        }
        interleaved.extend_from_slice(&block[..frames * channels]);
        if interleaved.len() > MAX_SAMPLES {
            return Err("longer than 20 minutes; no recording of the data set is".into());
        }
    }
    if interleaved.is_empty() {
        return Err("it has no samples".into());
    }
    let frames = interleaved.len() / channels;
    let samples = Array2::from_shape_vec((frames, channels), interleaved)
        .map_err(|e| e.to_string())?
        .reversed_axes();
    Ok((samples, f64::from(rate)))
}

/// Mean of the channels at 22,050 Hz, `[1, samples]`.
fn mono(samples: &Array2<f32>, rate: f64) -> Result<Array2<f32>, String> {
    let mean = corsmal_dsp::mono::to_mono(samples.view()).map_err(|e| e.to_string())?;
    resample_windowed_sinc(mean.insert_axis(Axis(0)).view(), rate, RATE, false)
        .map_err(|e| e.to_string())
}

fn reflected(n_fft: usize, hop: usize) -> StftParams {
    StftParams { pad_mode: PadMode::Reflect, ..StftParams::new(n_fft, hop) }
}

fn zcr_mfcc(y: ndarray::ArrayView2<f32>) -> corsmal_dsp::Result<Vec<f32>> {
    let power = spectrogram(y, &reflected(2048, 512), 2.0)?;
    let bank = SparseBank::new(&mel_filter(&MelParams::new(RATE, 2048))?);
    let mut mel = bank.apply(power.view());
    Decibel::default().power(mel.as_slice_mut().unwrap_or_default())?;
    let coefficients = mfcc(mel.view(), &MfccParams::default())?;
    let kept = coefficients.slice(s![0, 1..13, ..]);
    let zcr = zero_crossing_rate(y, &FrameParams::default(), &ZeroCrossingParams::default())?;
    let zcr = zcr.slice(s![0, 0, ..]);
    let zcr_mean = zcr.mean().unwrap_or(0.0);
    let mut vector: Vec<f32> = kept.mean_axis(Axis(1)).into_iter().flatten().collect();
    vector.extend(kept.std_axis(Axis(1), 0.0));
    vector.extend([zcr_mean as f32, zcr.std(0.0) as f32]);
    Ok(vector)
}

fn spectrogram96(y: Array2<f32>, crop: Option<(f64, f64)>) -> corsmal_dsp::Result<Vec<f32>> {
    let n = y.ncols();
    let at = |seconds: f64| ((seconds * RATE) as usize).min(n);
    // An annotation beyond the end leaves nothing: then the whole recording counts.
    let (from, to) = crop.map_or((0, n), |(a, b)| (at(a), at(b)));
    let (from, to) = if to > from { (from, to) } else { (0, n) };
    let cut = y.slice(s![.., from..to]);
    let square = cut.iter().map(|&v| f64::from(v).powi(2)).sum::<f64>() / cut.len() as f64;
    // Silence stays silent; the published code divides by zero here.
    let gain = if square > 0.0 { 1.0 / square.sqrt() } else { 1.0 };
    let length = SPECTROGRAM_S * RATE as usize;
    let mut padded = Array2::<f64>::zeros((1, length));
    for (to, &from) in padded.iter_mut().zip(cut.iter()) {
        *to = f64::from(from) * gain;
    }
    let mut power = spectrogram(padded.view(), &reflected(512, 128), 2.0)?;
    Decibel::default().power(power.as_slice_mut().unwrap_or_default())?;
    let image = resize(power.index_axis(Axis(0), 0), &ResizeParams::new(96, 96))?;
    Ok(image.iter().map(|&v| v as f32).collect())
}
