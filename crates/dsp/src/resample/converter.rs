//! Any of librosa's converters as a stream.

use std::sync::{Arc, Mutex, PoisonError};

use super::sinc::{SincPlan, SincStream};
use super::{ResType, ResamplePlan, ResampleStream};
use crate::error::Result;

/// Bits of both rates, and the kind.
type Key = (u64, u64, ResType);

/// Converters that [`Converter::shared`] keeps, of at most a few megabytes each.
const KEPT: usize = 8;

/// The filters from one rate to another of one [`ResType`].
#[derive(Debug, Clone)]
pub enum Converter {
    /// libsoxr's.
    Soxr(Arc<ResamplePlan>),
    /// resampy's.
    Sinc(Arc<SincPlan>),
}

impl Converter {
    /// Designs the filters (milliseconds: make one converter per pair of rates).
    ///
    /// # Errors
    /// Impossible rates.
    pub fn new(orig_sr: f64, target_sr: f64, res_type: ResType) -> Result<Self> {
        let sinc = |fast| Ok(Self::Sinc(Arc::new(SincPlan::new(orig_sr, target_sr, fast)?)));
        match res_type {
            ResType::SoxrHq => Ok(Self::Soxr(Arc::new(ResamplePlan::new(orig_sr, target_sr)?))),
            ResType::KaiserBest => sinc(false),
            ResType::KaiserFast => sinc(true),
        }
    }

    /// [`new`](Self::new), or one of those that were asked for last: arrays come one by one, mostly
    /// at the same rates.
    pub(super) fn shared(orig_sr: f64, target_sr: f64, res_type: ResType) -> Result<Self> {
        static RECENT: Mutex<Vec<(Key, Converter)>> = Mutex::new(Vec::new());
        let key = (orig_sr.to_bits(), target_sr.to_bits(), res_type);
        let recent = || RECENT.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, converter)) = recent().iter().find(|(known, _)| *known == key) {
            return Ok(converter.clone());
        }
        let converter = Self::new(orig_sr, target_sr, res_type)?;
        let mut recent = recent();
        recent.truncate(KEPT - 1);
        recent.insert(0, (key, converter.clone()));
        Ok(converter)
    }

    /// A stream of `channels` interleaved channels.
    ///
    /// # Errors
    /// `channels` is 0.
    pub fn stream(&self, channels: usize) -> Result<ConverterStream> {
        Ok(match self {
            Self::Soxr(plan) => ConverterStream::Soxr(ResampleStream::new(plan.clone(), channels)?),
            Self::Sinc(plan) => ConverterStream::Sinc(SincStream::new(plan.clone(), channels)?),
        })
    }
}

/// Converts interleaved frames as they come, with the bits of [`resample`](super::resample)
/// (`fix = true`) however the input is cut into blocks.
#[derive(Debug, Clone)]
pub enum ConverterStream {
    /// By libsoxr's filters.
    Soxr(ResampleStream),
    /// By resampy's.
    Sinc(SincStream),
}

impl ConverterStream {
    /// Takes whole interleaved frames, appends the outputs that are complete to `out`.
    ///
    /// # Errors
    /// `input` is not whole frames.
    pub fn push(&mut self, input: &[f32], out: &mut Vec<f32>) -> Result<()> {
        match self {
            Self::Soxr(stream) => stream.push(input, out),
            Self::Sinc(stream) => stream.push(input, out),
        }
    }

    /// Ends the stream, with `ceil(frames * target_sr / orig_sr)` frames given in all.
    pub fn finish(self, out: &mut Vec<f32>) {
        match self {
            Self::Soxr(stream) => stream.finish(out),
            Self::Sinc(stream) => stream.finish(out),
        }
    }
}
