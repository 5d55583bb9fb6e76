//! Which frames of a span can be computed, as samples arrive.

use std::ops::Range;

use corsmal_dsp::lanes::LANES;

use super::framing::{Frames, Framing, Scratch, Stream};

/// The samples in memory: interleaved, those from `first` on.
pub struct Window<'a> {
    /// Interleaved samples.
    pub samples: &'a [f32],
    /// Absolute index of the first sample.
    pub first: u64,
    /// Length of the signal, once it is known.
    pub total: Option<u64>,
}

/// Position of one stream in its span.
pub struct Cursor {
    /// Next frame to compute.
    pub next: u64,
    /// First frame of the next span.
    pub end: u64,
}

impl Cursor {
    /// Frames anchored (`t * hop`) in the sample positions `[start, end)`.
    pub fn new(framing: &Framing, span: &Range<u64>) -> Self {
        let hop = framing.hop as u64;
        Self { next: span.start.div_ceil(hop), end: span.end.div_ceil(hop) }
    }

    /// First sample that is still needed.
    pub fn keep_from(&self, framing: &Framing) -> u64 {
        // Padding by reflection reaches back `pad` samples from the end.
        (self.next * framing.hop as u64).saturating_sub(2 * framing.pad as u64 + 1)
    }

    /// Computes every frame that the window completes; all that remain once the total is known.
    /// Values are appended to `raw[feature]` as `[frames][rows][channels]`.
    pub fn advance(
        &mut self,
        stream: &dyn Stream,
        channels: usize,
        window: &Window<'_>,
        raw: &mut [Vec<f32>],
        scratch: &mut Scratch,
    ) {
        let framing = stream.framing();
        let available = window.first + (window.samples.len() / channels) as u64;
        let end = match window.total {
            Some(n) => self.end.min(framing.n_frames(n)),
            None => {
                // Frame t is complete with sample t * hop - pad + length - 1.
                let past = (available + framing.pad as u64).checked_sub(framing.length as u64);
                let complete = past.map_or(0, |p| p / framing.hop as u64 + 1);
                let mut end = self.end.min(complete);
                if end < self.end {
                    // Whole blocks only.
                    let group = (LANES / gcd(LANES, channels)) as u64;
                    end = self.next + end.saturating_sub(self.next) / group * group;
                }
                // The padding before frame 0 may need 2 pad samples.
                if self.next == 0 && available < 2 * framing.pad as u64 + 1 {
                    end = 0;
                }
                end
            }
        };
        while self.next < end {
            let inside = |t: u64| {
                let start = t * framing.hop as u64;
                start >= framing.pad as u64
                    && start - framing.pad as u64 + framing.length as u64 <= available
            };
            let first = self.next;
            let direct = inside(first);
            let mut last = first + 1;
            while last < end && inside(last) == direct {
                last += 1;
            }
            let frames = (last - first) as usize;
            let start = (first * framing.hop as u64) as i64 - framing.pad as i64;
            if direct {
                let offset = (start as u64 - window.first) as usize * channels;
                let samples = &window.samples[offset..];
                stream.run(Frames { samples, count: frames, channels }, raw, scratch);
            } else {
                let mut edge = std::mem::take(&mut scratch.edge);
                let length = (frames - 1) * framing.hop + framing.length;
                padded(window, &framing, channels, start, length, &mut edge);
                stream.run(Frames { samples: &edge, count: frames, channels }, raw, scratch);
                scratch.edge = edge;
            }
            self.next = last;
        }
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// `length` samples from `start` on, with padding where they lie outside the signal.
fn padded(
    window: &Window,
    framing: &Framing,
    channels: usize,
    start: i64,
    length: usize,
    out: &mut Vec<f32>,
) {
    let available = window.first + (window.samples.len() / channels) as u64;
    let n = window.total.unwrap_or(available) as usize;
    out.clear();
    for i in start..start + length as i64 {
        match framing.mode.index(i as isize, n) {
            None => out.resize(out.len() + channels, 0.0),
            Some(i) => {
                let at = (i as u64 - window.first) as usize * channels;
                out.extend_from_slice(&window.samples[at..at + channels]);
            }
        }
    }
}
