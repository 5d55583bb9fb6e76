//! The push interface: samples in, stored values of every feature out.

use std::ops::Range;
use std::sync::Arc;

use corsmal_dsp::DspError;
use ndarray::Array2;
use rayon::prelude::*;
use thiserror::Error;

use super::plan::{Plan, WholeFeature};
use super::stream::{Cursor, Window};
use super::workspace::Workspace;

/// What the features of one span of a recording, or of a part of it, have stored.
#[derive(Debug, Default)]
pub struct Span {
    /// For each feature `[frames][rows][channels]`, unfinished.
    pub raw: Vec<Vec<f32>>,
    /// Length of the signal in samples, where the span reached its end.
    pub total: Option<u64>,
}

/// A feature of the whole recording that does not exist for it.
#[derive(Debug, Error)]
#[error("{feature}: {source}")]
pub struct Refused {
    /// Name of the feature.
    pub feature: String,
    /// Why.
    pub source: DspError,
}

/// Computes the features of one span, fed block by block.
///
/// Any split of the samples into blocks gives the same bits.
pub struct Extractor {
    plan: Arc<Plan>,
    cursors: Vec<Cursor>,
    raw: Vec<Vec<f32>>,
    workspace: Workspace,
    head: usize,
    /// Absolute index of the sample at `head`.
    first: u64,
}

impl Extractor {
    /// An extractor of frames anchored (`t * hop_length`) in `span`, whose first pushed sample is
    /// number `first` of the signal. A whole recording is `0..u64::MAX` from 0.
    pub fn new(plan: Arc<Plan>, span: Range<u64>, first: u64) -> Self {
        let cursors = plan.streams.iter().map(|s| Cursor::new(&s.framing(), &span)).collect();
        let raw = vec![Vec::new(); plan.features.len()];
        let workspace = plan.workspaces.take();
        Self { plan, cursors, raw, workspace, head: 0, first }
    }

    /// Makes room for a signal of `frames` frames that will be held whole, up to a few MiB.
    pub fn reserve(&mut self, frames: u64) {
        let values =
            usize::try_from(frames).unwrap_or(usize::MAX).saturating_mul(self.plan.channels);
        if self.plan.needs_whole() && values <= Workspace::MOST_SAMPLES {
            self.workspace.buffer.reserve_exact(values);
        }
    }

    /// Channels that are pushed.
    pub fn channels(&self) -> usize {
        self.plan.channels
    }

    /// Room for `frames` more frames, to be filled and then reported by [`Extractor::commit`].
    pub fn room(&mut self, frames: usize) -> &mut [f32] {
        let length = self.workspace.buffer.len();
        self.workspace.buffer.resize(length + frames * self.plan.channels, 0.0);
        &mut self.workspace.buffer[length..]
    }

    /// Keeps `filled` of the `room` frames last asked for, and computes what they complete.
    pub fn commit(&mut self, room: usize, filled: usize) {
        let unused = (room - filled) * self.plan.channels;
        self.workspace.buffer.truncate(self.workspace.buffer.len() - unused);
        self.advance(None);
        self.compact();
    }

    /// Takes interleaved samples (whole frames).
    pub fn push(&mut self, samples: &[f32]) {
        self.workspace.buffer.extend_from_slice(samples);
        self.commit(0, 0);
    }

    /// Frames of the signal up to the last that was pushed.
    pub fn reached(&self) -> u64 {
        self.first + ((self.workspace.buffer.len() - self.head) / self.plan.channels) as u64
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
    ///
    /// # Errors
    /// A feature of the whole recording does not exist for this one.
    pub fn finish(mut self, at_end: bool) -> Result<Span, Refused> {
        let total = at_end.then_some(self.reached());
        self.advance(total);
        if total.is_some_and(|n| n > 0) {
            self.whole()?;
        }
        Ok(Span { raw: std::mem::take(&mut self.raw), total })
    }

    /// Computes the features of the whole recording, which the buffer holds.
    fn whole(&mut self) -> Result<(), Refused> {
        if !self.plan.needs_whole() {
            return Ok(());
        }
        let mut apart_too = Vec::new();
        for whole @ WholeFeature { feature, kernel } in &self.plan.whole {
            match kernel.interleaved(&self.workspace.buffer, self.plan.channels) {
                Some(values) => {
                    self.raw[*feature] = values.map_err(|source| self.refused(*feature, source))?;
                }
                None => apart_too.push(whole),
            }
        }
        if apart_too.is_empty() {
            return Ok(());
        }
        let owned = if self.plan.channels == 1 {
            Vec::new()
        } else {
            apart(&self.workspace.buffer, self.plan.channels)
        };
        let planes: Vec<&[f32]> = if owned.is_empty() {
            vec![&self.workspace.buffer]
        } else {
            // Long recordings are held twice only while their channels are taken apart.
            if self.workspace.buffer.capacity() > Workspace::MOST_SAMPLES {
                self.workspace.buffer = Vec::new();
            }
            owned.iter().map(Vec::as_slice).collect()
        };
        for WholeFeature { feature, kernel } in apart_too {
            let each: Vec<Array2<f32>> = planes
                .par_iter()
                .map(|y| kernel.channel(y).map(|values| values.reversed_axes()))
                .collect::<Result<_, _>>()
                .map_err(|source| self.refused(*feature, source))?;
            let raw = &mut self.raw[*feature];
            // `[frames, rows]` of every channel, mostly contiguous.
            let each: Vec<_> = each.iter().map(Array2::as_standard_layout).collect();
            let each: Vec<&[f32]> = each.iter().filter_map(|values| values.as_slice()).collect();
            if let [values] = each[..] {
                raw.extend_from_slice(values);
                continue;
            }
            raw.resize(each.iter().map(|values| values.len()).sum(), 0.0);
            for (i, slots) in raw.chunks_exact_mut(each.len()).enumerate() {
                slots.iter_mut().zip(&each).for_each(|(slot, values)| *slot = values[i]);
            }
        }
        Ok(())
    }

    fn refused(&self, feature: usize, source: DspError) -> Refused {
        Refused { feature: self.plan.features[feature].name.clone(), source }
    }

    fn advance(&mut self, total: Option<u64>) {
        let window =
            Window { samples: &self.workspace.buffer[self.head..], first: self.first, total };
        for (stream, cursor) in self.plan.streams.iter().zip(&mut self.cursors) {
            let (raw, scratch) = (&mut self.raw, &mut self.workspace.scratch);
            cursor.advance(stream.as_ref(), self.plan.channels, &window, raw, scratch);
        }
    }

    /// Drops samples that no frame needs any more, once they are half of the buffer.
    fn compact(&mut self) {
        if self.plan.needs_whole() {
            return;
        }
        let keep = self
            .cursors
            .iter()
            .zip(&self.plan.streams)
            .map(|(cursor, stream)| cursor.keep_from(&stream.framing()))
            .min()
            .unwrap_or(u64::MAX);
        let held = ((self.workspace.buffer.len() - self.head) / self.plan.channels) as u64;
        let done = keep.saturating_sub(self.first).min(held);
        self.first += done;
        self.head += done as usize * self.plan.channels;
        if self.head > self.workspace.buffer.len() / 2 {
            self.workspace.buffer.copy_within(self.head.., 0);
            self.workspace.buffer.truncate(self.workspace.buffer.len() - self.head);
            self.head = 0;
        }
    }
}

impl Drop for Extractor {
    fn drop(&mut self) {
        self.plan.workspaces.give(std::mem::take(&mut self.workspace));
    }
}

/// The channels of interleaved samples.
fn apart(samples: &[f32], channels: usize) -> Vec<Vec<f32>> {
    /// Frames whose samples stay in the cache until each channel has taken its own.
    const BLOCK: usize = 1 << 10;
    let plane = |_| Vec::with_capacity(samples.len() / channels);
    let mut planes: Vec<Vec<f32>> = (0..channels).map(plane).collect();
    for block in samples.chunks(BLOCK * channels) {
        for (c, plane) in planes.iter_mut().enumerate() {
            match block.as_chunks::<8>() {
                (frames, []) if channels == 8 => plane.extend(frames.iter().map(|frame| frame[c])),
                _ => plane.extend(block.chunks_exact(channels).map(|frame| frame[c])),
            }
        }
    }
    planes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Config;

    #[test]
    fn extractors_of_a_plan_work_in_the_same_memory() {
        let config = Arc::new(Config::preset("logmel").unwrap());
        let plan = Arc::new(Plan::new(&config, 16_000.0, 2).unwrap());
        let compute = |samples: usize| {
            let mut extractor = Extractor::new(plan.clone(), 0..u64::MAX, 0);
            extractor.push(&vec![0.1; 2 * samples]);
            extractor.finish(true).unwrap().raw
        };
        let first = compute(8000);
        let place = |work: &Workspace| (work.buffer.as_ptr(), work.buffer.capacity());
        let workspace = plan.workspaces.take();
        let before = place(&workspace);
        assert!(before.1 >= 16_000 && !workspace.scratch.frames.is_empty());
        plan.workspaces.give(workspace);
        assert_eq!(compute(8000), first);
        assert_eq!(place(&plan.workspaces.take()), before);
        assert!(plan.workspaces.take().buffer.capacity() == 0, "one was at work at a time");

        compute(Workspace::MOST_SAMPLES);
        assert!(plan.workspaces.take().buffer.capacity() == 0, "long buffers are freed");

        // As many signals as may be open at once.
        let open: Vec<Extractor> =
            (0..1000).map(|_| Extractor::new(plan.clone(), 0..u64::MAX, 0)).collect();
        drop(open);
        assert!(plan.workspaces.idle() <= rayon::current_num_threads());
    }

    #[test]
    fn a_recording_that_fails_leaves_nothing_behind() {
        for preset in ["logmel", "mfcc-zcr", "m4-code", "esc26"] {
            let config = Arc::new(Config::preset(preset).unwrap());
            let plan = Arc::new(Plan::new(&config, 16_000.0, 2).unwrap());
            let noise: Vec<f32> =
                (0..40_000_u32).map(|i| (i * i % 997) as f32 / 997.0 - 0.5).collect();
            let compute = || {
                let mut extractor = Extractor::new(plan.clone(), 0..u64::MAX, 0);
                noise.chunks(1500).for_each(|block| extractor.push(block));
                extractor.finish(true).unwrap().raw
            };
            let first = compute();
            let mut failed = Extractor::new(plan.clone(), 0..u64::MAX, 0);
            failed.push(&vec![1e30; 30_000]);
            // Read, found wanting, never committed.
            failed.room(500).fill(f32::NAN);
            drop(failed);
            assert_eq!(compute(), first, "{preset}");
        }
    }
}
