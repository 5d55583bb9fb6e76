//! Blocks of 4-bit differences: IMA (DVI) ADPCM and Microsoft's, as they stand in WAV.

use crate::error::AudioError;
use crate::input::Input;
use crate::report::{ReadReport, Repair};
use crate::stream::{Next, Stream};

/// How the differences are coded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Kind {
    Ima,
    Microsoft,
}

/// Blocks of one size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Adpcm {
    pub(super) kind: Kind,
    /// Bytes of a block.
    pub(super) block: u16,
}

impl Adpcm {
    /// Bytes per channel before the differences of a block, and samples in them.
    fn head(self) -> (usize, usize) {
        match self.kind {
            Kind::Ima => (4, 1),
            Kind::Microsoft => (7, 2),
        }
    }

    /// Samples per channel in a block of so many bytes, which may be cut off.
    fn frames_of(self, bytes: usize, channels: usize) -> usize {
        let (head, first) = self.head();
        let Some(rest) = bytes.checked_sub(head * channels) else { return 0 };
        first
            + match self.kind {
                // Four bytes of one channel, then of the next.
                Kind::Ima => rest / (4 * channels) * 8,
                Kind::Microsoft => rest * 2 / channels,
            }
    }

    /// Samples per channel in so many bytes of blocks.
    pub(super) fn frames_in(self, bytes: u64, channels: u16) -> u64 {
        let frames = |bytes: u64| self.frames_of(bytes as usize, channels.into()) as u64;
        let block = u64::from(self.block);
        let Some(whole) = bytes.checked_div(block) else { return 0 };
        whole.saturating_mul(frames(block)).saturating_add(frames(bytes % block))
    }
}

/// Finds the byte at which more samples begin after so many bytes of them.
pub(super) type More = fn(&mut Input, u64) -> Result<Option<u64>, AudioError>;

/// The blocks of one recording.
pub(super) struct Blocks {
    input: Input,
    adpcm: Adpcm,
    channels: usize,
    /// Bytes of blocks still to come; `None`: to the end of a pipe.
    left: Option<u64>,
    /// Bytes of blocks by the header.
    size: Option<u64>,
    more: More,
    declared: Option<u64>,
    given: u64,
    is_over: bool,
}

impl Blocks {
    /// Blocks from the position of `input` on: `left` bytes, or to the end of a pipe; `size` bytes and
    /// `declared` frames by the header.
    pub(super) fn new(
        input: Input,
        adpcm: Adpcm,
        channels: u16,
        left: Option<u64>,
        (size, more): (Option<u64>, More),
        declared: Option<u64>,
    ) -> Self {
        let channels = channels.into();
        Self { input, adpcm, channels, left, size, more, declared, given: 0, is_over: false }
    }
}

impl Blocks {
    /// Notes samples after those of the header, of whose `rest` bytes no block was made.
    fn note_more(&mut self, rest: u64, report: &mut ReadReport) {
        // A pipe may stay open after its samples.
        let whole = self.input.len().is_some() && self.left.is_some_and(|left| left == rest);
        let Some(size) = self.size.filter(|_| whole && !report.truncated) else { return };
        let more = self.input.skip(rest).and_then(|_| (self.more)(&mut self.input, size));
        if let Ok(Some(offset)) = more {
            report.note(Repair::MoreData { offset });
        }
    }
}

impl Stream for Blocks {
    fn next(
        &mut self,
        samples: &mut Vec<f32>,
        report: &mut ReadReport,
    ) -> Result<Next, AudioError> {
        let wanted = u64::from(self.adpcm.block).min(self.left.unwrap_or(u64::MAX)) as usize;
        let shown = self.input.peek(wanted)?;
        let block = &shown[..shown.len().min(wanted)];
        let frames = self.adpcm.frames_of(block.len(), self.channels);
        let block_rest = block.len() as u64;
        if self.is_over || frames == 0 {
            if !block.is_empty() && !self.is_over {
                report.note(Repair::PartialFrame { bytes: block.len() as u64 });
            }
            if self.declared.is_some_and(|declared| self.given < declared) && !report.truncated {
                report.note_truncated(self.declared, self.given);
            }
            self.note_more(block_rest, report);
            return Ok(Next::End);
        }
        samples.resize(frames * self.channels, 0.0);
        match self.adpcm.kind {
            Kind::Ima => ima(block, self.channels, samples),
            Kind::Microsoft => microsoft(block, self.channels, samples),
        }
        let used = block.len();
        self.is_over = used < usize::from(self.adpcm.block);
        self.input.consume(used);
        self.left = self.left.map(|left| left - used as u64);
        self.given += frames as u64;
        Ok(Next::Samples)
    }
}

fn scaled(sample: i32) -> f32 {
    sample as f32 * (1.0 / 32768.0)
}

const IMA_STEPS: [i32; 89] = [
    7, 8, 9, 10, 11, 12, 13, 14, 16, 17, 19, 21, 23, 25, 28, 31, 34, 37, 41, 45, 50, 55, 60, 66,
    73, 80, 88, 97, 107, 118, 130, 143, 157, 173, 190, 209, 230, 253, 279, 307, 337, 371, 408, 449,
    494, 544, 598, 658, 724, 796, 876, 963, 1060, 1166, 1282, 1411, 1552, 1707, 1878, 2066, 2272,
    2499, 2749, 3024, 3327, 3660, 4026, 4428, 4871, 5358, 5894, 6484, 7132, 7845, 8630, 9493,
    10442, 11487, 12635, 13899, 15289, 16818, 18500, 20350, 22385, 24623, 27086, 29794, 32767,
];
const IMA_INDEX: [i32; 8] = [-1, -1, -1, -1, 2, 4, 6, 8];

/// A block: per channel the first sample and an index, then per channel eight differences in four
/// bytes, low half first.
fn ima(block: &[u8], channels: usize, out: &mut [f32]) {
    let (heads, groups) = block.split_at(4 * channels);
    for (channel, head) in heads.chunks_exact(4).enumerate() {
        let mut sample = i32::from(i16::from_le_bytes([head[0], head[1]]));
        let mut index = i32::from(head[2]).clamp(0, 88);
        let mut frames = out.chunks_exact_mut(channels);
        if let Some(frame) = frames.next() {
            frame[channel] = scaled(sample);
        }
        let own = groups.chunks_exact(4).skip(channel).step_by(channels);
        let codes = own.flatten().flat_map(|byte| [byte & 15, byte >> 4]);
        for (frame, code) in frames.zip(codes) {
            let step = IMA_STEPS[index as usize];
            let part = |bit: u8, shift: u8| if code & bit != 0 { step >> shift } else { 0 };
            let difference = (step >> 3) + part(4, 0) + part(2, 1) + part(1, 2);
            sample += if code & 8 != 0 { -difference } else { difference };
            sample = sample.clamp(i16::MIN.into(), i16::MAX.into());
            index = (index + IMA_INDEX[usize::from(code & 7)]).clamp(0, 88);
            frame[channel] = scaled(sample);
        }
    }
}

const MS_FACTORS: [(i32, i32); 7] =
    [(256, 0), (512, -256), (0, 0), (192, 64), (240, 0), (460, -208), (392, -232)];
const MS_DELTAS: [i32; 16] =
    [230, 230, 230, 230, 307, 409, 512, 614, 768, 614, 512, 409, 307, 230, 230, 230];

/// A block: for all channels the predictor, the delta, the second sample, the first sample, then
/// differences, high half first, the channels in turn.
fn microsoft(block: &[u8], channels: usize, out: &mut [f32]) {
    let (head, codes) = block.split_at(7 * channels);
    let word = |at: usize| i32::from(i16::from_le_bytes([head[at], head[at + 1]]));
    let at = |part: usize, channel: usize| channels + 2 * (part * channels + channel);
    let mut codes = codes.iter().flat_map(|byte| [byte >> 4, byte & 15]);
    let mut states: Vec<_> = (0..channels)
        .map(|c| {
            let factors = MS_FACTORS[usize::from(head[c]).min(6)];
            (factors, word(at(0, c)), word(at(1, c)), word(at(2, c)))
        })
        .collect();
    for (number, frame) in out.chunks_exact_mut(channels).enumerate() {
        for (sample, state) in frame.iter_mut().zip(&mut states) {
            let ((one, two), delta, last, before) = state;
            *sample = match number {
                0 => scaled(*before),
                1 => scaled(*last),
                _ => {
                    let code = i32::from(codes.next().unwrap_or(0));
                    let signed = if code > 7 { code - 16 } else { code };
                    let predicted = (*last * *one + *before * *two) >> 8;
                    let value = predicted.saturating_add(signed.saturating_mul(*delta));
                    let value = value.clamp(i16::MIN.into(), i16::MAX.into());
                    let grown = (MS_DELTAS[code as usize]).saturating_mul(*delta) >> 8;
                    (*delta, *before, *last) = (grown.max(16), *last, value);
                    scaled(value)
                }
            };
        }
    }
}
