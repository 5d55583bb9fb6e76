//! One span of one recording: opened, read, pushed through signal chain and extractor.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_audio::{AudioSpec, BlockSource};
use corsmal_files::outcome::{Outcome, Status};

use super::extractor::Span;
use super::failed::Failed;
use super::live::Live;
use super::pass::Pass;
use super::plans::Planned;
use super::signal_chain::SignalChain;
use super::stretch::WHOLE;
use super::watch::Watch;
use crate::config::SignalConfig;
use crate::inputs::stored::Purpose;
use crate::inputs::{Input, InputSource};

/// The repair of a stretch whose end is after that of its recording.
const END_BEYOND: &str = "end_beyond_recording";
/// Frames of a recording that is not cut.
const UNCUT: u64 = 1 << 21;
/// Frames of a span of one that is: few enough that threads end together.
const SPAN: u64 = 1 << 19;

/// Opens an input, all of it or a part. A stream on standard input and what comes from a store fail once
/// `stop` is set, also while nothing comes.
pub fn open(
    input: &Input,
    watch: &Watch,
    part: Part,
    stop: &Arc<AtomicBool>,
) -> Result<Box<dyn BlockSource>, Failed> {
    let purpose = match part {
        Part::Whole if input.start.is_none() => Purpose::Content,
        Part::Whole | Part::Span => Purpose::Part,
    };
    Ok(match &input.source {
        InputSource::Stdin => {
            corsmal_audio::from_reader(Live::new(std::io::stdin(), stop.clone()))?
        }
        InputSource::Pipe(path) => {
            corsmal_audio::from_reader(Live::of_pipe(path.clone(), stop.clone()))?
        }
        source => source.open_for(purpose, (watch.pin(), stop))?,
    })
}

/// How much of a recording is read after it was opened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// As much as the input takes.
    Whole,
    /// One span of several.
    Span,
}

/// The frame at a time: the last one that does not begin later. Times written with nine decimals
/// name the frame they were made from.
pub fn frame_at(seconds: f64, sample_rate: u32) -> u64 {
    (seconds * f64::from(sample_rate) + 1e-3) as u64
}

/// Frames of the recording that are taken, by the configuration and the manifest's start and end.
pub fn crop(
    signal: &SignalConfig,
    (start, end): (Option<f64>, Option<f64>),
    sample_rate: u32,
) -> Range<u64> {
    let frame = |seconds: f64| frame_at(seconds, sample_rate);
    let offset = start.unwrap_or(0.0);
    let first = frame(offset + signal.start);
    let mut last = end.map_or(u64::MAX, frame);
    if signal.end > 0.0 {
        last = last.min(frame(offset + signal.end));
    }
    first..last.max(first)
}

/// Spans of the signal that can be computed apart; one where it cannot be cut.
pub fn spans(source: &dyn BlockSource, planned: &Planned, crop: &Range<u64>) -> Vec<Range<u64>> {
    let separable = source.seekable()
        && !planned.plan.needs_whole()
        && SignalChain::is_local(&planned.plan.config.signal, planned.resample.is_some());
    let Some(most) = source.most_frames().filter(|_| separable) else {
        return vec![WHOLE];
    };
    let frames = most.min(crop.end).saturating_sub(crop.start);
    if frames <= UNCUT {
        return vec![WHOLE];
    }
    let mut spans: Vec<Range<u64>> = (0..frames / SPAN).map(|i| i * SPAN..(i + 1) * SPAN).collect();
    // The last span takes the rest, whatever the header said.
    if let Some(last) = spans.last_mut() {
        last.end = u64::MAX;
    }
    spans
}

/// Reads and computes one span of a crop, and hands it to `each` in parts of bounded size; adds to
/// `decoded` the frames of the file that belong to it. Whether it came to its end: `false` when the
/// run was stopped.
pub fn compute(
    source: &mut dyn BlockSource,
    planned: &Planned,
    crop_and_span: (&Range<u64>, &Range<u64>),
    stop: &AtomicBool,
    decoded: &mut u64,
    mut each: impl FnMut(Span) -> Result<(), Failed>,
) -> Result<bool, Failed> {
    let mut pass = Pass::new(source, planned, crop_and_span)?;
    let mut each_of = |_: usize, span: Span| each(span);
    *decoded += pass.passed();
    source.go_to(pass.reads().start)?;
    let mut block = Vec::new();
    let mut ended = false;
    while !ended && pass.wanted() > 0 {
        if stop.load(Ordering::Relaxed) {
            return Ok(false);
        }
        pass.hand_on(&mut each_of)?;
        ended = pass.read(source, &mut block, decoded)? == 0;
    }
    let Some(last) = pass.finish(ended, stop, &mut each_of)? else { return Ok(false) };
    last.into_iter().try_for_each(|span| each(span?))?;
    Ok(true)
}

/// Why a stretch has no samples.
pub fn no_frame(rate: u32) -> String {
    format!("the stretch has no frame at {rate} Hz")
}

/// Why a stretch has no samples of its recording.
pub fn behind_the_end(start: f64) -> String {
    format!("the stretch begins at {start} s, after the end of the recording")
}

/// Notes where a stretch reaches beyond the end of its recording, now read.
///
/// # Errors
/// It begins there.
pub fn check_stretch(
    input: &Input,
    signal: &SignalConfig,
    outcome: &mut Outcome,
) -> Result<(), Failed> {
    let Some(rate) = outcome.sample_rate else { return Ok(()) };
    let crop = crop(signal, (input.start, input.end), rate);
    // A start beyond all frames is after the end.
    if crop.is_empty() && crop.start < u64::MAX {
        let start = frame_at(input.start.unwrap_or(0.0), rate);
        let has_frames = input.end.is_none_or(|end| frame_at(end, rate) > start);
        let of = if (input.start, input.end) == (None, None) { "recording" } else { "stretch" };
        let reason = match has_frames {
            true => format!("signal.start and signal.end leave nothing of the {of}"),
            false => no_frame(rate),
        };
        return Err(Failed::new(Status::Empty, reason));
    }
    if let Some(start) = input.start.filter(|_| crop.start > 0 && outcome.decoded_frames == 0) {
        return Err(Failed::new(Status::Empty, behind_the_end(start)));
    }
    let is_end = input.end.is_some_and(|end| crop.end == frame_at(end, rate));
    if is_end && outcome.decoded_frames < crop.end - crop.start {
        outcome.repairs.push(END_BEYOND.into());
    }
    Ok(())
}

/// Fills an outcome with the format of a recording.
pub fn describe_format(outcome: &mut Outcome, spec: &AudioSpec) {
    outcome.declared_frames = spec.declared_frames;
    outcome.sample_rate = Some(spec.sample_rate);
    outcome.channels = Some(u32::from(spec.channels));
}

/// Fills an outcome with what the reader knows of a stretch.
pub fn describe(outcome: &mut Outcome, source: &dyn BlockSource, stretch: &Range<u64>) {
    describe_format(outcome, source.spec());
    let report = source.health();
    for repair in report.repairs.iter().filter(|repair| report.concerns(repair, stretch)) {
        if !outcome.repairs.iter().any(|r| r == repair.name()) {
            outcome.repairs.push(repair.name().to_string());
        }
    }
    let known = matches!(outcome.status, Status::Ok | Status::Truncated);
    if let Some(loss) = report.loss_in(stretch).filter(|_| known) {
        outcome.status = Status::Truncated;
        outcome.reason = loss.to_string();
    }
}
