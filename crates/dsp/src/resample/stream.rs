//! Conversion of a stream, block by block.

use std::ops::Range;
use std::sync::Arc;

use super::ResamplePlan;
use super::check::check_interleaved;
use super::frames::Frames;
use crate::error::Result;

/// Converts interleaved frames as they come; the outputs do not depend on how the input is cut into
/// blocks. Output lags by the filters' reach, where a filter is long by a pass of transforms: 32 blocks of
/// one channel, 4 of eight, of up to eight times the filter's length.
///
/// ```
/// use std::sync::Arc;
/// use corsmal_dsp::resample::{ResamplePlan, ResampleStream};
///
/// let plan = Arc::new(ResamplePlan::new(44100.0, 16000.0)?);
/// let mut stream = ResampleStream::new(plan, 2)?;
/// let mut out = Vec::new();
/// for block in [[0.25; 8820]; 10] {
///     stream.push(&block, &mut out)?; // stereo frames, as they arrive
/// }
/// stream.finish(&mut out);
/// assert_eq!(out.len(), 2 * 16000);
/// # Ok::<(), corsmal_dsp::DspError>(())
/// ```
#[derive(Debug, Clone)]
pub struct ResampleStream {
    plan: Arc<ResamplePlan>,
    channels: usize,
    buffers: Vec<Buffer>,
    pushed: u64,
    given: u64,
}

/// Input of one stage that is still needed.
#[derive(Debug, Clone)]
struct Buffer {
    data: Vec<f32>,
    /// Frame number of the first frame held.
    start: i64,
    /// Next output of the stage.
    next: u64,
}

impl ResampleStream {
    /// A stream of `channels` interleaved channels.
    ///
    /// # Errors
    /// `channels` is 0.
    pub fn new(plan: Arc<ResamplePlan>, channels: usize) -> Result<Self> {
        check_interleaved(channels, &[])?;
        let buffers = plan
            .stages
            .iter()
            .map(|stage| {
                let start = stage.input_range(&(0..1)).start.min(0);
                Buffer { data: vec![0.0; -start as usize * channels], start, next: 0 }
            })
            .collect();
        Ok(Self { plan, channels, buffers, pushed: 0, given: 0 })
    }

    /// Takes whole interleaved frames of finite samples, appends the outputs that are complete to `out`. A
    /// sample that is not finite spoils outputs around it, how many depends on the blocks.
    ///
    /// # Errors
    /// `input` is not whole frames.
    pub fn push(&mut self, input: &[f32], out: &mut Vec<f32>) -> Result<()> {
        check_interleaved(self.channels, input)?;
        self.pushed += (input.len() / self.channels) as u64;
        self.run(input, out, false);
        Ok(())
    }

    /// Ends the stream: the outputs that depend on the zeros after the last sample, in all
    /// [`ResamplePlan::output_len`] frames (librosa's rule, with its final zero where it has one).
    pub fn finish(mut self, out: &mut Vec<f32>) {
        let filtered = self.plan.filtered_len(self.pushed);
        let needed = self.plan.input_range(0..filtered).end - self.pushed as i64;
        let from = out.len();
        let before = self.given;
        let zeros = vec![0.0; needed.max(0) as usize * self.channels];
        self.run(&zeros, out, true);
        // Outputs beyond the rounded length are dropped, and one that is missing is a zero.
        let keep = filtered.saturating_sub(before) as usize * self.channels;
        out.truncate(from + keep.min(out.len() - from));
        let total = self.plan.output_len(self.pushed).saturating_sub(before) as usize;
        out.resize(from + total * self.channels, 0.0);
    }

    /// Takes `input` and appends what is complete; until the stream `ends`, whole passes only.
    fn run(&mut self, input: &[f32], out: &mut Vec<f32>, ends: bool) {
        let channels = self.channels;
        let mut block = None;
        for (stage, buffer) in self.plan.stages.iter().zip(&mut self.buffers) {
            buffer.data.extend_from_slice(block.as_deref().unwrap_or(input));
            let end = buffer.start + (buffer.data.len() / channels) as i64;
            let available = stage.available(end);
            let left = if ends { 0 } else { available % stage.pass(channels) };
            let ready: Range<u64> = buffer.next..(available - left).max(buffer.next);
            let mut made = vec![0.0; (ready.end - ready.start) as usize * channels];
            if !ready.is_empty() {
                let frames = Frames { data: &buffer.data, start: buffer.start };
                stage.run(channels, ready.start, frames, &mut made);
                buffer.next = ready.end;
                let first = stage.input_range(&(ready.end..ready.end + 1)).start;
                let spent = (first - buffer.start).clamp(0, end - buffer.start) as usize;
                buffer.data.drain(..spent * channels);
                buffer.start += spent as i64;
            }
            block = Some(made);
        }
        let made = block.as_deref().unwrap_or(input);
        self.given += (made.len() / channels) as u64;
        out.extend_from_slice(made);
    }
}
