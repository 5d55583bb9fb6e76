//! What a feature computes, and from what.

use corsmal_dsp::lanes::Row;
use corsmal_dsp::stft::{PadMode, StftParams};
use corsmal_dsp::time_domain::FrameParams;
use ndarray::Array2;

use super::derived::Derived;

/// What a spectrum feature reads of each frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quantity {
    /// `|X|^2`, one row a bin.
    Power,
    /// `|X|`, one row a bin.
    Magnitude,
    /// Real and imaginary parts, two rows a bin.
    Complex,
}

/// Computes from the spectra of sixteen (frame, channel) slots.
pub trait SpectrumKernel: Send + Sync {
    /// `spectrum` holds the quantity's rows, `out` the feature's.
    fn rows(&self, spectrum: &[Row], out: &mut [Row]);

    /// What the user should know of these parameters, though they are possible.
    fn warning(&self) -> Option<String> {
        None
    }
}

/// Computes from frames of the waveform.
pub trait WaveKernel: Send + Sync {
    /// `samples` is interleaved and starts at the first sample of the first of `frames` frames, edge
    /// padding included; appends `[frames][rows][channels]` to `out`.
    fn frames(&self, samples: &[f32], channels: usize, frames: usize, out: &mut Vec<f32>);
}

/// Computes from one magnitude spectrum of `n_fft / 2 + 1` bins the rows of one (frame, channel).
pub type SlotFn<'k> = Box<dyn FnMut(&[f32], &mut [f64]) + 'k>;

/// Computes from exact magnitude spectra, one (frame, channel) at a time.
pub trait SlotKernel: Send + Sync {
    /// The function with its working memory, made once per block of frames.
    fn worker(&self) -> SlotFn<'_>;

    /// As [`SpectrumKernel::warning`].
    fn warning(&self) -> Option<String> {
        None
    }
}

/// Computes from a whole channel, which is held in memory until its end.
pub trait WholeKernel: Send + Sync {
    /// `[coefficients, frames]` of the samples of one channel; a vector is one frame.
    ///
    /// # Errors
    /// A signal that the feature does not exist for.
    fn channel(&self, y: &[f32]) -> corsmal_dsp::Result<Array2<f32>>;

    /// `[frames][coefficients][channels]` of interleaved samples, where all channels are computed at once;
    /// `None` where each is by itself.
    fn interleaved(&self, _: &[f32], _: usize) -> Option<corsmal_dsp::Result<Vec<f32>>> {
        None
    }

    /// How many of the first of a signal's `frames` frames may be left out: the rest has the same values.
    fn unread(&self, _frames: u64) -> u64 {
        0
    }

    /// As [`SpectrumKernel::warning`].
    fn warning(&self) -> Option<String> {
        None
    }

    /// Bytes that computing takes for each sample of a channel, measured on long recordings.
    fn bytes_per_sample(&self) -> u64 {
        12
    }
}

/// Finishes stored values once the maxima of the recording are known.
pub trait Finish: Send + Sync {
    /// Rows whose maximum is needed, and whether it is joint over channels.
    fn peaks(&self) -> Vec<(std::ops::Range<usize>, bool)>;

    /// Whether finished values depend on those maxima.
    fn needs_peaks(&self) -> bool {
        !self.peaks().is_empty()
    }

    /// What to set so that they do not, where that can be.
    fn without_peaks(&self) -> Option<&'static str> {
        None
    }

    /// One frame, `raw [rows][channels]` to `out [coefficients][channels]`; `peaks` is
    /// `[peaks][channels]`.
    fn frame(&self, raw: &[f32], peaks: &[f32], channels: usize, out: &mut [f32]);
}

/// What a feature computes from. The plan of a configuration takes it apart: the kernel moves into
/// the stream of frames that it reads.
pub enum Kernel {
    /// Rows of the spectrum.
    Spectrum(StftParams, Quantity, Box<dyn SpectrumKernel>),
    /// Magnitudes of a transform in double precision, rounded to single precision as librosa
    /// stores them.
    Exact(StftParams, Box<dyn SlotKernel>),
    /// Frames of the waveform, with what they see outside the signal.
    Wave(FrameParams, PadMode, Box<dyn WaveKernel>),
    /// The whole recording, channel by channel.
    Whole(Extent, Box<dyn WholeKernel>),
    /// Nothing: [`Feature::derived`] reads the finished frames of an earlier feature, by name.
    Earlier(String),
}

impl Kernel {
    /// What the user should know of its parameters, though they are possible.
    pub fn warning(&self) -> Option<String> {
        match self {
            Self::Spectrum(.., kernel) => kernel.warning(),
            Self::Exact(_, kernel) => kernel.warning(),
            Self::Whole(_, kernel) => kernel.warning(),
            Self::Wave(..) | Self::Earlier(_) => None,
        }
    }
}

/// Where the frames of a feature lie.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Extent {
    /// Frames this many samples apart.
    Frames(f64),
    /// One vector, which statistics leave as it is.
    Vector,
}

/// A planned feature: samples to raw rows by `kernel`, raw rows to finished frames by `finish`,
/// finished frames to the output by `derived`.
pub struct Feature {
    /// What it computes from.
    pub kernel: Kernel,
    /// Values stored per frame and channel before finishing.
    pub raw_rows: usize,
    /// Names of the coefficients of a finished frame (none for [`Kernel::Earlier`], which has its
    /// source's).
    pub labels: Vec<String>,
    /// Whether pairs of rows are real and imaginary parts.
    pub complex: bool,
    /// Finishing, where values depend on the maximum of the recording.
    pub finish: Option<Box<dyn Finish>>,
    /// What is computed of the finished frames in their order of time, where frames depend on their
    /// neighbours.
    pub derived: Option<Box<dyn Derived>>,
}

impl Feature {
    /// A feature of a kernel whose values are final as computed, one row a label.
    pub fn new(kernel: Kernel, labels: Vec<String>) -> Self {
        let raw_rows = labels.len();
        Self { kernel, raw_rows, labels, complex: false, finish: None, derived: None }
    }

    /// A feature of exact magnitudes whose values are final as computed, one row a label.
    pub fn exact(stft: StftParams, kernel: impl SlotKernel + 'static, labels: Vec<String>) -> Self {
        Self::new(Kernel::Exact(stft, Box::new(kernel)), labels)
    }

    /// A feature of the whole recording, one row a label.
    pub fn whole(extent: Extent, kernel: impl WholeKernel + 'static, labels: Vec<String>) -> Self {
        Self::new(Kernel::Whole(extent, Box::new(kernel)), labels)
    }

    /// A feature of the finished frames of an earlier one.
    pub fn of_earlier(name: &str, derived: impl Derived + 'static) -> Self {
        let derived: Option<Box<dyn Derived>> = Some(Box::new(derived));
        Self { derived, ..Self::new(Kernel::Earlier(name.into()), Vec::new()) }
    }

    /// The earlier feature whose frames it reads.
    pub fn source(&self) -> Option<&str> {
        match &self.kernel {
            Kernel::Earlier(name) => Some(name),
            _ => None,
        }
    }

    /// Names of its output, given those of its source where it reads one.
    pub fn output_labels(&self, source: &[String]) -> Vec<String> {
        let finished = if self.source().is_some() { source } else { &self.labels };
        match &self.derived {
            Some(derived) => derived.labels(finished),
            None => finished.to_vec(),
        }
    }
}
