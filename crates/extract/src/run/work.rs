//! What a job does with a recording: open it, compute a span of it, finish it.

use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_audio::BlockSource;
use corsmal_files::npz::Compression;
use corsmal_files::outcome::{Outcome, Status};

use super::output::Member;
use crate::engine::reading::Part;
use crate::engine::stretch;
use crate::engine::together::Wanted;
use crate::engine::{
    Decoders, Failed, Features, Plan, Planned, Plans, Reader, Recording, Span, Watch, reading,
};
use crate::inputs::Input;
use crate::survey::Survey;

/// The outcome of an input before anything is known of it but what its bytes are.
pub(super) fn outcome_of(input: &Input) -> Outcome {
    // Objects of stores tell theirs when they are read.
    let identity = if input.source.is_stored() { String::new() } else { input.source.identity() };
    known_outcome_of(input, identity)
}

/// The same where it is known what its bytes are.
pub(super) fn known_outcome_of(input: &Input, identity: String) -> Outcome {
    let mut outcome = Outcome::new(&input.id, input.source.to_string(), Status::Ok, "");
    outcome.identity = identity;
    outcome
}

/// A recording that is open, and how it is cut.
pub(super) struct Opened {
    pub reader: Reader,
    pub planned: Planned,
    /// The frames that are wanted.
    pub crop: Range<u64>,
    pub spans: Vec<Range<u64>>,
}

/// Opens a recording that the run takes, or goes on with one of the `decoders` where that gives the same.
pub(super) fn open(
    input: &Input,
    (watch, decoders): (&Watch, Option<&Decoders>),
    (plans, survey): (&Plans<'_>, &Survey),
    stop: &Arc<AtomicBool>,
    outcome: &mut Outcome,
) -> Result<Opened, Failed> {
    let times = (input.start, input.end);
    let stretch = |rate| reading::crop(plans.signal(), times, rate);
    let mut begins = false;
    let mut reader = match decoders.and_then(|decoders| decoders.take(watch, stretch)) {
        Some(replay) => Reader::Again(replay),
        None => {
            let opened = watch.settle(reading::open(input, watch, Part::Whole, stop));
            if let Some(identity) = watch.identity() {
                outcome.identity = identity;
            }
            begins = true;
            let is_watched = decoders.is_some() && watch.lasting().is_some();
            Reader::new(opened?, is_watched && times != (None, None))
        }
    };
    let source = &*reader.source();
    let wanted = wanted(input, source, (plans, survey), outcome);
    // What a decoder has met is told at the end of a stretch, in the order of the recording.
    if begins && (times == (None, None) || wanted.is_err()) {
        reading::describe(outcome, source, &stretch(source.spec().sample_rate));
    } else {
        reading::describe_format(outcome, source.spec());
    }
    let Wanted { planned, crop } = wanted?;
    let spans = reading::spans(source, &planned, &crop);
    Ok(Opened { reader, planned, crop, spans })
}

/// What is to be computed of a recording that is open. Notes in `outcome` where a stretch begins.
pub(super) fn wanted(
    input: &Input,
    source: &dyn BlockSource,
    (plans, survey): (&Plans<'_>, &Survey),
    outcome: &mut Outcome,
) -> Result<Wanted, Failed> {
    if let Some(reason) = survey.refusal(source.spec().channels) {
        return Err(Failed::new(Status::Mismatch, reason));
    }
    let planned = plans.of(source.spec()).map_err(|e| Failed::new(Status::Unsupported, e))?;
    let signal = &planned.plan.config.signal;
    let crop = reading::crop(signal, (input.start, input.end), source.spec().sample_rate);
    let is_stretch = input.start.is_some() || input.end.is_some();
    // Readers of tables have signed integers.
    outcome.start_frame = Some(crop.start).filter(|&at| is_stretch && at <= i64::MAX as u64);
    Ok(Wanted { planned, crop })
}

/// Computes a recording as one span; `None` where the run was stopped. Adds to `outcome` what the
/// reader has learned; it waits among the `decoders` for the next stretch.
pub(super) fn whole(
    opened: Opened,
    (watch, decoders): (&Watch, &Decoders),
    folder: &Path,
    stop: &AtomicBool,
    outcome: &mut Outcome,
) -> Result<Option<Recording>, Failed> {
    let Opened { mut reader, planned, crop, .. } = opened;
    let source = reader.source();
    let mut recording = Recording::new(planned.plan.clone(), folder);
    let decoded = &mut outcome.decoded_frames;
    let span = (&crop, &stretch::WHOLE);
    let computed = reading::compute(source, &planned, span, stop, decoded, |part| {
        recording.add(part).map_err(Failed::temporary)
    });
    reading::describe(outcome, source, &crop);
    if !watch.settle(computed)? {
        return Ok(None);
    }
    decoders.put(watch, reader);
    Ok(Some(recording))
}

/// Computes the frames of a piece of a recording, those anchored at the samples `piece`; the same as the
/// whole recording has there. `None` where the run was stopped.
pub(super) fn piece(
    mut opened: Opened,
    piece: &Range<u64>,
    (watch, folder): (&Watch, &Path),
    stop: &AtomicBool,
    outcome: &mut Outcome,
) -> Result<Option<Features>, Failed> {
    let Opened { reader, planned, crop, .. } = &mut opened;
    let source = reader.source();
    let resampled = planned.resample.is_some().then_some("the recording is resampled");
    let refusal = planned.plan.piece_refusal().or(resampled.map(String::from));
    if let Some(reason) = refusal {
        let reason = format!("a piece of it has no frames: {reason}");
        return Err(Failed::new(Status::Unsupported, reason));
    }
    let mut recording = Recording::new(planned.plan.clone(), folder);
    let decoded = &mut outcome.decoded_frames;
    let computed = reading::compute(source, planned, (&*crop, piece), stop, decoded, |part| {
        recording.add(part).map_err(Failed::temporary)
    });
    reading::describe(outcome, source, crop);
    if !watch.settle(computed)? {
        return Ok(None);
    }
    watch.check_content(&outcome.identity)?;
    Ok(Some(recording.finish()?))
}

/// A span of a recording that was cut.
pub(super) struct SpanJob {
    pub input: usize,
    pub index: usize,
    pub span: Range<u64>,
    pub planned: Planned,
    pub watch: Watch,
}

/// What computing a span gave.
pub(super) struct SpanDone {
    /// With the frames of the recording that are wanted.
    pub source: Option<(Box<dyn BlockSource>, Range<u64>)>,
    /// Frames decoded for it.
    pub decoded: u64,
    pub parts: Result<Vec<Span>, Failed>,
}

impl SpanJob {
    /// Reads and computes the span; `None` where the run was stopped.
    pub(super) fn compute(&self, input: &Input, stop: &Arc<AtomicBool>) -> Option<SpanDone> {
        let mut parts = Vec::new();
        let mut last = None;
        let mut decoded = 0;
        let computed = reading::open(input, &self.watch, Part::Span, stop).and_then(|source| {
            // The spans before this one were read from the file as it was then.
            self.watch.check()?;
            let signal = &self.planned.plan.config.signal;
            let crop = reading::crop(signal, (input.start, input.end), source.spec().sample_rate);
            let (source, crop) = last.insert((source, crop));
            let (span, decoded) = ((&*crop, &self.span), &mut decoded);
            reading::compute(source.as_mut(), &self.planned, span, stop, decoded, |part| {
                parts.push(part);
                Ok(())
            })
        });
        let parts = match self.watch.settle(computed) {
            Ok(false) => return None,
            Ok(true) => Ok(parts),
            Err(failed) => Err(failed),
        };
        Some(SpanDone { source: last, decoded, parts })
    }
}

/// What a recording gives: arrays, or a row of the table; and its samples.
pub(super) struct Parts {
    pub arrays: Vec<Member>,
    pub row: Option<Vec<f32>>,
    pub total: u64,
}

/// Finishes a recording whose spans are all added.
pub(super) fn finish(
    input: &Input,
    (planned, watch): (&Planned, &Watch),
    recording: Result<Recording, Failed>,
    compression: Compression,
    outcome: &mut Outcome,
) -> Result<Parts, Failed> {
    let plan = &planned.plan;
    let (features, total) = complete(input, (planned, watch), recording, outcome)?;
    Ok(match features {
        Features::Summary(row) => Parts { arrays: Vec::new(), row: Some(row), total },
        Features::Frames(arrays) => {
            let arrays = Member::of(&input.id, plan, arrays, compression);
            Parts { arrays: arrays.map_err(Failed::temporary)?, row: None, total }
        }
    })
}

/// The features of a recording whose spans are all added, and its samples.
pub(super) fn complete(
    input: &Input,
    (planned, watch): (&Planned, &Watch),
    recording: Result<Recording, Failed>,
    outcome: &mut Outcome,
) -> Result<(Features, u64), Failed> {
    let stretch = reading::check_stretch(input, &planned.plan.config.signal, outcome);
    let recording = recording?;
    watch.check_content(&outcome.identity)?;
    stretch?;
    let total = recording.total();
    Ok((recording.complete()?, total))
}

/// What to tell of a recording of `total` samples that is shorter than a transform.
pub(super) fn short(plan: &Plan, total: u64, outcome: &Outcome) -> Option<String> {
    let longest = plan.longest_transform().filter(|longest| total < *longest as u64)?;
    let id = &outcome.id;
    Some(format!("{id}: {total} samples are fewer than n_fft = {longest} (reported once per run)"))
}

/// Why an input has no features, in its outcome.
pub(super) fn note(outcome: &mut Outcome, failed: Failed) {
    if failed.status == Status::Changed {
        // It is of a file that is no more: what is there now is to be read again.
        outcome.identity.clear();
    }
    outcome.status = failed.status;
    outcome.reason = failed.reason;
    outcome.byte_offset = failed.byte_offset;
}

/// A fault of this program.
pub(super) fn broken() -> Failed {
    Failed::new(Status::Unsupported, "this is a bug in corsmal-feat: please report it")
}
