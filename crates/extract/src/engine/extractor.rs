//! The push interface: samples in, stored values of every feature out.

use std::ops::Range;
use std::sync::Arc;

use super::plan::{Plan, Scratch};
use super::stream::{Cursor, Window};

/// What the features of one span of a recording, or of a part of it, have stored.
#[derive(Debug, Default)]
pub struct Span {
    /// For each feature `[frames][rows][channels]`, unfinished.
    pub raw: Vec<Vec<f32>>,
    /// Length of the signal in samples, where the span reached its end.
    pub total: Option<u64>,
}

/// Computes the features of one span, fed block by block.
///
/// Any split of the samples into blocks gives the same bits.
pub struct Extractor {
    plan: Arc<Plan>,
    cursors: Vec<Cursor>,
    raw: Vec<Vec<f32>>,
    /// Interleaved samples; those before `head` are done with.
    buffer: Vec<f32>,
    head: usize,
    /// Absolute index of the sample at `head`.
    first: u64,
    scratch: Scratch,
}

impl Extractor {
    /// An extractor of frames anchored (`t * hop_length`) in `span`, whose first pushed sample is
    /// number `first` of the signal. A whole recording is `0..u64::MAX` from 0.
    pub fn new(plan: Arc<Plan>, span: Range<u64>, first: u64) -> Self {
        let cursors = plan.streams.iter().map(|s| Cursor::new(&s.framing, &span)).collect();
        let raw = vec![Vec::new(); plan.features.len()];
        Self { plan, cursors, raw, buffer: Vec::new(), head: 0, first, scratch: Scratch::default() }
    }

    /// Channels that are pushed.
    pub fn channels(&self) -> usize {
        self.plan.channels
    }

    /// Room for `frames` more frames, to be filled and then reported by [`Extractor::commit`].
    pub fn room(&mut self, frames: usize) -> &mut [f32] {
        let length = self.buffer.len();
        self.buffer.resize(length + frames * self.plan.channels, 0.0);
        &mut self.buffer[length..]
    }

    /// Keeps `filled` of the `room` frames last asked for, and computes what they complete.
    pub fn commit(&mut self, room: usize, filled: usize) {
        let unused = (room - filled) * self.plan.channels;
        self.buffer.truncate(self.buffer.len() - unused);
        self.advance(None);
        self.compact();
    }

    /// Takes interleaved samples (whole frames).
    pub fn push(&mut self, samples: &[f32]) {
        self.buffer.extend_from_slice(samples);
        self.commit(0, 0);
    }

    /// Number of values computed and not yet taken.
    pub fn stored(&self) -> usize {
        self.raw.iter().map(Vec::len).sum()
    }

    /// Takes what is computed so far, so that a long recording is never held whole. The span's
    /// other values follow.
    pub fn take(&mut self) -> Span {
        Span { raw: self.raw.iter_mut().map(std::mem::take).collect(), total: None }
    }

    /// Computes what remains. `at_end` says that the signal ends here; otherwise the pushed samples
    /// reach as far beyond the span as its last frames need.
    pub fn finish(mut self, at_end: bool) -> Span {
        let total = self.first + ((self.buffer.len() - self.head) / self.plan.channels) as u64;
        let total = at_end.then_some(total);
        self.advance(total);
        Span { raw: self.raw, total }
    }

    fn advance(&mut self, total: Option<u64>) {
        let window = Window { samples: &self.buffer[self.head..], first: self.first, total };
        for (stream, cursor) in self.cursors.iter_mut().enumerate() {
            cursor.advance(&self.plan, stream, &window, &mut self.raw, &mut self.scratch);
        }
    }

    /// Drops samples that no frame needs any more, once they are half of the buffer.
    fn compact(&mut self) {
        let keep = self
            .cursors
            .iter()
            .zip(&self.plan.streams)
            .map(|(cursor, stream)| cursor.keep_from(&stream.framing))
            .min()
            .unwrap_or(u64::MAX);
        let held = ((self.buffer.len() - self.head) / self.plan.channels) as u64;
        let done = keep.saturating_sub(self.first).min(held);
        self.first += done;
        self.head += done as usize * self.plan.channels;
        if self.head > self.buffer.len() / 2 {
            self.buffer.copy_within(self.head.., 0);
            self.buffer.truncate(self.buffer.len() - self.head);
            self.head = 0;
        }
    }
}
