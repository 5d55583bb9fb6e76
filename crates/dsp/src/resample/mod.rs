//! Sample-rate conversion equal to librosa's default (`res_type="soxr_hq"`: libsoxr, 20 bits,
//! linear phase), and resampy's `kaiser_best` and `kaiser_fast` of librosa up to 0.9.
//!
//! A [`ResamplePlan`] holds the filters of one pair of rates. It runs in three ways with the same
//! bits: a whole array ([`resample`]), a stream in blocks of any size ([`ResampleStream`]), and any
//! range of outputs of a long recording ([`ResamplePlan::segment`]).

mod array;
mod check;
mod converter;
mod design;
mod dot;
mod frames;
mod kaiser;
mod kernel;
mod low_pass;
mod overlap_save;
mod poly;
mod rounded;
mod sinc;
mod stage;
mod stream;
mod strided;

use std::borrow::Cow;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::error::{Result, from_name};
use check::{check_interleaved, check_rates};
use frames::Frames;
use stage::Stage;

pub(crate) use array::{before_last, resample_last};
pub use array::{resample, resample_into, resampled_len};
pub use converter::{Converter, ConverterStream};
pub(crate) use kaiser::halving;
pub use sinc::{SincPlan, SincStream};
pub use stream::ResampleStream;

/// The converter, by librosa's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ResType {
    /// libsoxr's high quality, librosa's default since 0.10.
    #[default]
    SoxrHq,
    /// resampy's `kaiser_best`, librosa's default up to 0.9.
    KaiserBest,
    /// resampy's `kaiser_fast`.
    KaiserFast,
}

from_name!(
    ResType, "res_type",
    "soxr_hq" => Self::SoxrHq,
    "kaiser_best" => Self::KaiserBest,
    "kaiser_fast" => Self::KaiserFast,
);

/// Largest growth of a recording whose rate comes from its file: a header that says 1 Hz would turn
/// a small file into billions of samples.
pub const MAX_EXPANSION: f64 = 100.0;

/// The filters that convert one rate to another.
///
/// Outputs are numbered from 0; output `o` lies at input time `o * orig_sr / target_sr`, and the
/// signal is zero outside its samples.
#[derive(Debug, Clone)]
pub struct ResamplePlan {
    orig_sr: f64,
    target_sr: f64,
    stages: Vec<Stage>,
}

impl ResamplePlan {
    /// Designs the filters (milliseconds: make one plan per pair of rates). Equal rates pass the
    /// signal through.
    ///
    /// # Errors
    /// A rate that is not positive and finite, or rates more than a factor of 65536 apart.
    pub fn new(orig_sr: f64, target_sr: f64) -> Result<Self> {
        check_rates(orig_sr, target_sr)?;
        let chain =
            if orig_sr == target_sr { Vec::new() } else { design::chain(orig_sr / target_sr) };
        let grain = period(orig_sr, target_sr).map_or(1, |(inputs, _)| inputs as usize);
        Ok(Self { orig_sr, target_sr, stages: Stage::chain(&chain, grain) })
    }

    /// Input rate in hertz.
    pub fn orig_sr(&self) -> f64 {
        self.orig_sr
    }

    /// Output rate in hertz.
    pub fn target_sr(&self) -> f64 {
        self.target_sr
    }

    /// The fewest input frames that can be left out at the beginning, so that all later outputs keep their
    /// bits, and the outputs that go with them. `None` where places of outputs do not repeat.
    fn repeats(&self) -> Option<(u64, u64)> {
        let (inputs, outputs) = period(self.orig_sr, self.target_sr)?;
        // `times * inputs` frames at the beginning are `times * up / down` of the stage.
        let (mut times, mut up, mut down) = (1, u128::from(inputs), 1);
        for stage in &self.stages {
            let (step, stage_up, stage_down) = stage.repeats()?;
            let needed = down * u128::from(step);
            times *= needed / common(times * up, needed);
            (up, down) = (up * u128::from(stage_up), down * u128::from(stage_down));
            let both = common(up, down);
            (up, down) = (up / both, down / both);
            if times >= 1 << 40 || up >= 1 << 40 || down >= 1 << 40 {
                return None;
            }
        }
        Some((u64::try_from(times).ok()? * inputs, u64::try_from(times).ok()? * outputs))
    }

    /// Outputs of a channel that one thread should make at a time.
    fn span(&self) -> usize {
        self.stages.last().map_or(kernel::SPAN, Stage::span)
    }

    /// Frames out of `n` frames in: `ceil(n * target_sr / orig_sr)`, librosa's rule (`fix=True`).
    pub fn output_len(&self, n: u64) -> u64 {
        (n as f64 * (self.target_sr / self.orig_sr)).ceil() as u64
    }

    /// Frames that the filters themselves give for `n` frames in: the nearest integer, so that the
    /// last one of [`Self::output_len`] is sometimes an exact zero.
    pub fn filtered_len(&self, n: u64) -> u64 {
        if self.stages.is_empty() {
            return n;
        }
        (n as f64 / (self.orig_sr / self.target_sr) + 0.5) as u64
    }

    /// Input frames that cover what outputs `out` depend on. It may begin before 0 and end after
    /// the signal, where samples are zero.
    pub fn input_range(&self, out: Range<u64>) -> Range<i64> {
        let mut range = out.start as i64..out.end as i64;
        for stage in self.stages.iter().rev() {
            range = stage.input_range(&clip(&range));
        }
        range
    }

    /// Outputs `out` (interleaved) of a recording of `channels` channels, given the frames from
    /// number `start` on that lie in [`Self::input_range`] and in the recording; the same bits as a
    /// conversion of the whole.
    ///
    /// # Errors
    /// `channels` is 0 or does not divide `input`.
    pub fn segment(
        &self,
        channels: usize,
        out: Range<u64>,
        input: &[f32],
        start: u64,
    ) -> Result<Vec<f32>> {
        check_interleaved(channels, input)?;
        let mut made = vec![0.0; (out.end - out.start) as usize * channels];
        self.segment_into(channels, out, input, start, &mut made);
        Ok(made)
    }

    /// [`segment`](Self::segment) of whole frames written into `made`.
    fn segment_into(
        &self,
        channels: usize,
        out: Range<u64>,
        input: &[f32],
        start: u64,
        made: &mut [f32],
    ) {
        let mut range = out.start as i64..out.end as i64;
        let mut steps = Vec::with_capacity(self.stages.len());
        for stage in self.stages.iter().rev() {
            let from = stage.input_range(&clip(&range));
            steps.push((stage, std::mem::replace(&mut range, from.clone()), from));
        }
        let mut data = covering(channels, &range, input, start as i64);
        let Some((last, earlier)) = steps.split_first() else {
            return made.copy_from_slice(&data);
        };
        for (stage, to, from) in earlier.iter().rev() {
            let mut next = vec![0.0; (to.end - to.start) as usize * channels];
            let out = clip(to);
            if !out.is_empty() {
                let input = Frames { data: &data, start: from.start };
                let before = (out.start as i64 - to.start) as usize * channels;
                stage.run(channels, out.start, input, &mut next[before..]);
            }
            data = Cow::Owned(next);
        }
        let (stage, to, from) = last;
        if !to.is_empty() {
            let input = Frames { data: &data, start: from.start };
            stage.run(channels, to.start as u64, input, made);
        }
    }
}

/// After so many inputs and so many outputs their places repeat, for rates of whole hertz.
fn period(orig_sr: f64, target_sr: f64) -> Option<(u64, u64)> {
    let whole = |rate: f64| rate.fract() == 0.0 && rate < 2f64.powi(32);
    if !whole(orig_sr) || !whole(target_sr) {
        return None;
    }
    let (orig, target) = (orig_sr as u64, target_sr as u64);
    let both = common(orig.into(), target.into()) as u64;
    Some((orig / both, target / both))
}

/// The largest common divisor.
fn common(mut a: u128, mut b: u128) -> u128 {
    while b > 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// The part of a range of positions that exists: a stage gives nothing before its output 0.
fn clip(range: &Range<i64>) -> Range<u64> {
    range.start.max(0) as u64..range.end.max(0) as u64
}

/// Frames `range` cut from `input`, which begins at frame `start`; zeros where it has none.
fn covering<'a>(
    channels: usize,
    range: &Range<i64>,
    input: &'a [f32],
    start: i64,
) -> Cow<'a, [f32]> {
    let end = start + (input.len() / channels) as i64;
    let (from, to) = (range.start.max(start), range.end.min(end));
    let source = match from < to {
        true => &input[(from - start) as usize * channels..(to - start) as usize * channels],
        false => &[],
    };
    let needed = (range.end - range.start).max(0) as usize * channels;
    if source.len() == needed {
        return Cow::Borrowed(source);
    }
    let mut data = vec![0.0; needed];
    let at = (from - range.start).max(0) as usize * channels;
    if let Some(slots) = data.get_mut(at..at + source.len()) {
        slots.copy_from_slice(source);
    }
    Cow::Owned(data)
}

#[cfg(test)]
mod tests;
