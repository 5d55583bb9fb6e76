//! What is read of a recording for a span of its signal.

use std::ops::Range;

use corsmal_audio::BlockSource;

use super::plans::Planned;
use super::signal_chain::SignalChain;

/// The span of a signal that is not cut.
pub const WHOLE: Range<u64> = 0..u64::MAX;

/// Frames of a recording that are read, and those of them that belong to the span.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Stretch {
    pub(super) read: Range<u64>,
    own: Range<u64>,
    /// Number of the first in the signal.
    pub(super) first: u64,
    /// Frames of the span that are passed without a look.
    pub(super) passed: u64,
}

impl Stretch {
    pub(super) fn of(
        source: &dyn BlockSource,
        planned: &Planned,
        (crop, span): (&Range<u64>, &Range<u64>),
    ) -> Self {
        // Padding by reflection may reach back twice the padding of a frame; one more is for what looks at
        // the sample before.
        let (before, after) = planned.plan.context();
        let passed = unread(source, planned, crop, span);
        let first = span.start.saturating_sub(2 * before as u64 + 1) + passed;
        let begin = crop.start.saturating_add(first);
        let end = crop.end.min(crop.start.saturating_add(span.end.saturating_add(after as u64)));
        let own = crop.start.saturating_add(span.start)..crop.start.saturating_add(span.end);
        Self { read: begin..end, own, first, passed }
    }

    /// How many of `frames` read from `position` on belong to the span; others are its context.
    pub(super) fn owned(&self, position: u64, frames: usize) -> u64 {
        let end = (position + frames as u64).min(self.own.end);
        end.saturating_sub(position.max(self.own.start))
    }
}

/// Frames at the beginning of a crop that no feature depends on, and that can be passed without a look:
/// integers, which are valid whatever they are, each of which has its place in the file.
fn unread(
    source: &dyn BlockSource,
    planned: &Planned,
    crop: &Range<u64>,
    span: &Range<u64>,
) -> u64 {
    let signal = &planned.plan.config.signal;
    let plain = source.seekable()
        && source.byte_of(0).is_some()
        && !source.spec().encoding.may_be_non_finite()
        && SignalChain::is_local(signal, planned.resample.is_some())
        && signal.preemphasis == 0.0
        && *span == WHOLE;
    match source.most_frames().filter(|_| plain) {
        Some(most) => planned.plan.unread(most.min(crop.end).saturating_sub(crop.start)),
        None => 0,
    }
}
