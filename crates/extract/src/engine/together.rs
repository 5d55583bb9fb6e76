//! Several configurations of one recording, computed in one reading of it.

use std::ops::Range;
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_audio::BlockSource;

use super::failed::Failed;
use super::pass::Pass;
use super::plans::Planned;
use super::recording::Recording;
use super::samples::BLOCK;
use super::stretch::WHOLE;

/// What is to be computed of a recording.
pub struct Wanted {
    /// By what.
    pub planned: Planned,
    /// Of which frames.
    pub crop: Range<u64>,
}

/// What was computed.
pub struct Computed {
    /// All of it, or why there is nothing.
    pub recording: Result<Recording, Failed>,
    /// Frames that were read for it.
    pub decoded: u64,
}

/// Whether one reading gives what several would: a reader that can go to any frame tells of the file what it
/// tells of a stretch.
pub fn can_share(source: &dyn BlockSource) -> bool {
    source.seekable() && source.byte_of(0).is_some()
}

/// Computes all that is `wanted` of a source that [can be shared](can_share); `false` when the run was stopped.
/// Signals that are alike are made once. Each is handed to `done` with its number once its last frame is read,
/// when the source knows what it would know had only this been read.
///
/// # Errors
/// A temporary file fails.
pub fn compute(
    source: &mut dyn BlockSource,
    wanted: &[Wanted],
    folder: &Path,
    stop: &AtomicBool,
    mut done: impl FnMut(usize, Computed, &dyn BlockSource),
) -> Result<bool, Failed> {
    let mut open: Vec<Shared> = Vec::with_capacity(wanted.len());
    for (number, Wanted { planned, crop }) in wanted.iter().enumerate() {
        let whole = (crop, &WHOLE);
        let member = || (number, Recording::new(planned.plan.clone(), folder));
        if let Some(shared) = open.iter_mut().find_map(|shared| {
            let joined = shared.pass.join(source, planned, whole);
            joined.then_some(shared)
        }) {
            shared.members.push(member());
            continue;
        }
        match Pass::new(source, planned, whole) {
            Ok(pass) => {
                open.push(Shared { decoded: pass.passed(), pass, members: vec![member()] });
            }
            Err(failed) => done(number, Computed { recording: Err(failed), decoded: 0 }, source),
        }
    }
    let channels = usize::from(source.spec().channels);
    let most = BLOCK / channels;
    let mut block = vec![0.0; most * channels];
    let mut position = open.iter().map(|shared| shared.pass.reads().start).min().unwrap_or(0);
    let mut read = source.go_to(position).map(|()| 0).map_err(Failed::from);
    let mut ended = false;
    loop {
        let failed = read.as_ref().err().map(Failed::same);
        let frames = read.unwrap_or(0);
        let samples = &block[..frames * channels];
        let mut rest = Vec::with_capacity(open.len());
        for mut shared in open {
            let taken = match &failed {
                Some(failed) => Err(failed.same()),
                None => shared.take(source, position, samples),
            };
            let last = match taken {
                Err(failed) if failed.temporary.is_some() => return Err(failed),
                Err(failed) => shared.fail(&failed),
                Ok(()) if ended || shared.is_complete(position + frames as u64) => {
                    match shared.finish(ended, stop)? {
                        Some(last) => last,
                        None => return Ok(false),
                    }
                }
                Ok(()) => {
                    rest.push(shared);
                    continue;
                }
            };
            last.into_iter().for_each(|(number, computed)| done(number, computed, source));
        }
        open = rest;
        position += frames as u64;
        let Some(first) = open.iter().map(|shared| shared.pass.reads().start).min() else {
            return Ok(true);
        };
        if stop.load(Ordering::Relaxed) {
            return Ok(false);
        }
        // Nobody wants what lies before.
        if first > position {
            read = source.go_to(first).map(|()| 0).map_err(Failed::from);
            position = first;
            continue;
        }
        let next = open.iter().map(|shared| shared.wanted(position)).min().unwrap_or(0);
        let wanted = usize::try_from(next).unwrap_or(most).min(most);
        read = source.read(&mut block[..wanted * channels]).map_err(Failed::from);
        ended = matches!(read, Ok(0));
    }
}

/// A pass, with the numbers of what is computed by it.
struct Shared {
    pass: Pass,
    members: Vec<(usize, Recording)>,
    decoded: u64,
}

impl Shared {
    /// Takes what was read from `position` on, if it has begun.
    fn take(
        &mut self,
        source: &dyn BlockSource,
        position: u64,
        samples: &[f32],
    ) -> Result<(), Failed> {
        if samples.is_empty() || position < self.pass.reads().start {
            return Ok(());
        }
        let Self { pass, members, decoded } = self;
        pass.hand_on(&mut |i, span| members[i].1.add(span).map_err(Failed::temporary))?;
        pass.take(source, samples, decoded)
    }

    /// Frames that may be read next: those that it takes, or those before it begins.
    fn wanted(&self, position: u64) -> u64 {
        match self.pass.reads().start.saturating_sub(position) {
            0 => self.pass.wanted() as u64,
            ahead => ahead,
        }
    }

    /// Whether it needs nothing from `position` on.
    fn is_complete(&self, position: u64) -> bool {
        self.wanted(position) == 0
    }

    /// What was computed; `None` when the run was stopped.
    fn finish(
        self,
        ended: bool,
        stop: &AtomicBool,
    ) -> Result<Option<Vec<(usize, Computed)>>, Failed> {
        let Self { pass, mut members, decoded } = self;
        let mut add = |i: usize, span| {
            let (_, recording): &mut (usize, Recording) = &mut members[i];
            recording.add(span).map_err(Failed::temporary)
        };
        let Some(last) = pass.finish(ended, stop, &mut add)? else { return Ok(None) };
        let complete = |((number, mut recording), span): ((usize, Recording), _)| {
            let recording = match span {
                Err(failed) => Err(failed),
                Ok(span) => match recording.add(span) {
                    Err(error) => return Err(Failed::temporary(error)),
                    Ok(()) => Ok(recording),
                },
            };
            Ok((number, Computed { recording, decoded }))
        };
        members.into_iter().zip(last).map(complete).collect::<Result<_, _>>().map(Some)
    }

    /// The same failure for everything that was to be computed.
    fn fail(self, failed: &Failed) -> Vec<(usize, Computed)> {
        let Self { members, decoded, .. } = self;
        let each = members.into_iter();
        each.map(|(number, _)| (number, Computed { recording: Err(failed.same()), decoded }))
            .collect()
    }
}
