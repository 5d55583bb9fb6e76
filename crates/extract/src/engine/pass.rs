//! A stretch of a recording on its way to features: one signal chain, and an extractor for each plan that
//! sees its signal.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_audio::BlockSource;
use corsmal_files::outcome::Status;

use super::extractor::{Extractor, Span};
use super::failed::Failed;
use super::held::Held;
use super::plans::Planned;
use super::samples::{BLOCK, check_samples};
use super::signal_chain::SignalChain;
use super::stretch::Stretch;

/// Values computed of a span before they are handed on (8 MiB).
const PART: usize = 1 << 21;

/// A stretch of a recording on its way to features.
pub struct Pass {
    stretch: Stretch,
    /// Whether the end of the stretch is the end of the signal, too.
    to_end: bool,
    front: SignalChain,
    branches: Vec<Branch>,
    channels: usize,
    /// Frames to take at a time.
    step: usize,
    /// Whether samples may be NaN or infinite.
    checked: bool,
    /// Frames of the signal for each of the recording.
    ratio: f64,
    /// The next frame to be read.
    position: u64,
    signal: Vec<f32>,
}

/// What is computed of the signal by one plan.
struct Branch {
    planned: Planned,
    span: Range<u64>,
    held: Option<Held>,
    /// Why there is nothing to compute any more.
    extractor: Result<Extractor, Failed>,
}

impl Branch {
    /// So many frames of the signal are there; gives up where they take more memory than is free.
    fn hold(&mut self, frames: u64) {
        if let (Some(held), Ok(_)) = (&mut self.held, &self.extractor)
            && let Err(failed) = held.reach(frames)
        {
            self.extractor = Err(failed);
        }
    }

    fn push(&mut self, signal: &[f32]) {
        if let Ok(extractor) = &mut self.extractor {
            extractor.push(signal);
        }
    }

    /// What is computed, once it is much.
    fn part(&mut self) -> Option<Span> {
        let extractor = self.extractor.as_mut().ok()?;
        (extractor.stored() > PART).then(|| extractor.take())
    }
}

impl Pass {
    /// The span `span` of a crop, computed by one plan.
    pub fn new(
        source: &dyn BlockSource,
        planned: &Planned,
        (crop, span): (&Range<u64>, &Range<u64>),
    ) -> Result<Self, Failed> {
        let plan = &planned.plan;
        let spec = source.spec();
        let channels = usize::from(spec.channels);
        let config = &plan.config.signal;
        let front = SignalChain::new(config, channels, planned.resample.clone(), plan.sample_rate)
            .map_err(|e| Failed::new(Status::Unsupported, e))?;
        let stretch = Stretch::of(source, planned, (crop, span));
        let mut pass = Self {
            to_end: stretch.read.end == crop.end,
            position: stretch.read.start,
            stretch,
            front,
            branches: Vec::with_capacity(1),
            channels,
            step: planned.step(BLOCK / channels, spec.sample_rate),
            checked: spec.encoding.may_be_non_finite(),
            ratio: plan.sample_rate / f64::from(spec.sample_rate),
            signal: Vec::new(),
        };
        pass.branch(source, planned, span.clone());
        Ok(pass)
    }

    fn branch(&mut self, source: &dyn BlockSource, planned: &Planned, span: Range<u64>) {
        let plan = &planned.plan;
        let Stretch { read, first, .. } = &self.stretch;
        let mut extractor = Extractor::new(plan.clone(), span.clone(), *first);
        if let Some(most) = source.most_frames() {
            // Rounding may add a frame, the end of the recording some of a block that is not filled.
            let frames = most.min(read.end).saturating_sub(read.start) as f64 * self.ratio;
            extractor.reserve(frames as u64 + 1 + (BLOCK / self.channels) as u64);
        }
        let (held, extractor) = (Held::of(plan), Ok(extractor));
        self.branches.push(Branch { planned: planned.clone(), span, held, extractor });
    }

    /// Computes a whole crop by another plan, too, if the same signal chain gives its signal; says whether.
    pub fn join(
        &mut self,
        source: &dyn BlockSource,
        planned: &Planned,
        (crop, span): (&Range<u64>, &Range<u64>),
    ) -> bool {
        let same = self.branches.iter().all(|branch| {
            let (own, other) = (&branch.planned.plan, &planned.plan);
            own.sample_rate == other.sample_rate
                && own.config.signal == other.config.signal
                && branch.span == *span
        });
        let same = same && Stretch::of(source, planned, (crop, span)) == self.stretch;
        if same {
            self.branch(source, planned, span.clone());
        }
        same
    }

    /// Frames that are to be read.
    pub fn reads(&self) -> &Range<u64> {
        &self.stretch.read
    }

    /// Frames of the span that are passed without a look.
    pub fn passed(&self) -> u64 {
        self.stretch.passed
    }

    /// Frames to read next; none at the end of the stretch, and where no plan can be computed any more.
    pub fn wanted(&self) -> usize {
        if self.branches.iter().all(|branch| branch.extractor.is_err()) {
            return 0;
        }
        (self.step as u64).min(self.stretch.read.end.saturating_sub(self.position)) as usize
    }

    /// Hands on what is computed, once it is much: the number of the plan, and its values.
    ///
    /// # Errors
    /// Those of `each`.
    pub fn hand_on(
        &mut self,
        each: &mut impl FnMut(usize, Span) -> Result<(), Failed>,
    ) -> Result<(), Failed> {
        for (i, branch) in self.branches.iter_mut().enumerate() {
            branch.part().map_or(Ok(()), |part| each(i, part))?;
        }
        Ok(())
    }

    /// Reads the next frames and takes them; how many there were, none at the end of the recording. Adds to
    /// `decoded` those of them that belong to the span.
    ///
    /// # Errors
    /// As [`take`](Self::take), or the recording cannot be read.
    pub fn read(
        &mut self,
        source: &mut dyn BlockSource,
        block: &mut Vec<f32>,
        decoded: &mut u64,
    ) -> Result<usize, Failed> {
        let wanted = self.wanted();
        if !self.front.is_identity() || self.branches.len() != 1 {
            block.resize(wanted * self.channels, 0.0);
            let frames = source.read(block)?;
            self.take(source, &block[..frames * self.channels], decoded)?;
            return Ok(frames);
        }
        let Some(Branch { extractor: Ok(extractor), .. }) = self.branches.first_mut() else {
            return Ok(0);
        };
        let room = extractor.room(wanted);
        let frames = source.read(room)?;
        *decoded += self.stretch.owned(self.position, frames);
        if self.checked {
            let samples = &room[..frames * self.channels];
            check_samples(samples, self.position, self.channels, |frame| source.byte_of(frame))?;
        }
        extractor.commit(wanted, frames);
        self.advance(frames);
        Ok(frames)
    }

    /// Takes the frames that follow those taken before, at most as many as are [`wanted`](Self::wanted).
    ///
    /// # Errors
    /// NaN or infinite samples.
    pub fn take(
        &mut self,
        source: &dyn BlockSource,
        samples: &[f32],
        decoded: &mut u64,
    ) -> Result<(), Failed> {
        let frames = samples.len() / self.channels;
        *decoded += self.stretch.owned(self.position, frames);
        if self.checked {
            check_samples(samples, self.position, self.channels, |frame| source.byte_of(frame))?;
        }
        self.front.push(samples, &mut self.signal);
        self.branches.iter_mut().for_each(|branch| branch.push(&self.signal));
        self.signal.clear();
        self.advance(frames);
        Ok(())
    }

    fn advance(&mut self, frames: usize) {
        if frames == 0 {
            return;
        }
        self.position += frames as u64;
        let reached = ((self.position - self.stretch.read.start) as f64 * self.ratio) as u64;
        self.branches.iter_mut().for_each(|branch| branch.hold(reached));
    }

    /// What remains after the last frame for each plan, where the recording `ended` or the stretch did; `None`
    /// when the run was stopped. What is much before that goes to `each`.
    ///
    /// # Errors
    /// Those of `each`.
    pub fn finish(
        self,
        ended: bool,
        stop: &AtomicBool,
        each: &mut impl FnMut(usize, Span) -> Result<(), Failed>,
    ) -> Result<Option<Vec<Result<Span, Failed>>>, Failed> {
        let Self { front, mut branches, to_end, .. } = self;
        let at_end = ended || to_end;
        if !front.is_identity() && at_end {
            let whole = front.finish(|rest| {
                if stop.load(Ordering::Relaxed) {
                    return Ok(false);
                }
                for (i, branch) in branches.iter_mut().enumerate() {
                    branch.part().map_or(Ok(()), |part| each(i, part))?;
                    branch.push(rest);
                    if branch.planned.plan.needs_whole()
                        && let Ok(extractor) = &branch.extractor
                    {
                        branch.hold(extractor.reached());
                    }
                }
                Ok::<_, Failed>(true)
            })?;
            if !whole {
                return Ok(None);
            }
        }
        let last = |branch: Branch| Ok(branch.extractor?.finish(at_end)?);
        Ok(Some(branches.into_iter().map(last).collect()))
    }
}
