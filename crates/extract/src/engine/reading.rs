//! One span of one recording: opened, read, pushed through signal chain and extractor.

use std::ops::Range;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_audio::BlockSource;
use corsmal_files::outcome::{Outcome, Status};

use super::extractor::{Extractor, Span};
use super::failed::Failed;
use super::held::Held;
use super::live::Live;
use super::plans::Planned;
use super::signal_chain::SignalChain;
use super::watch::Watch;
use crate::config::SignalConfig;
use crate::inputs::stored::Purpose;
use crate::inputs::{Input, InputSource};

/// Samples read at a time, all channels together.
const BLOCK: usize = 1 << 16;
/// Values computed of a span before they are handed on (8 MiB).
const PART: usize = 1 << 21;
/// The repair of a stretch whose end is behind that of its recording.
const END_BEYOND: &str = "end_beyond_recording";
/// Frames of a span; recordings of more than two are cut.
const SPAN: u64 = 1 << 20;

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
    let whole = 0..u64::MAX;
    let separable = source.seekable()
        && !planned.plan.needs_whole()
        && SignalChain::is_local(&planned.plan.config.signal, planned.resample.is_some());
    let Some(most) = source.most_frames().filter(|_| separable) else {
        return vec![whole];
    };
    let frames = most.min(crop.end).saturating_sub(crop.start);
    if frames <= 2 * SPAN {
        return vec![whole];
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
    (crop, span): (&Range<u64>, &Range<u64>),
    stop: &AtomicBool,
    decoded: &mut u64,
    mut each: impl FnMut(Span) -> Result<(), Failed>,
) -> Result<bool, Failed> {
    let plan = &planned.plan;
    let config = &plan.config.signal;
    let channels = usize::from(source.spec().channels);
    let mut front = SignalChain::new(config, channels, planned.resample.clone(), plan.sample_rate)
        .map_err(|e| Failed::new(Status::Unsupported, e))?;
    // Padding by reflection may reach back twice the padding of a frame; one more is for what looks at the
    // sample before.
    let (before, after) = plan.context();
    let passed = unread(source, planned, crop, span);
    let first = span.start.saturating_sub(2 * before as u64 + 1) + passed;
    let begin = crop.start.saturating_add(first);
    *decoded += passed;
    let end = crop.end.min(crop.start.saturating_add(span.end.saturating_add(after as u64)));
    skip_to(source, begin)?;
    let own = crop.start.saturating_add(span.start)..crop.start.saturating_add(span.end);
    let checked = source.spec().encoding.may_be_non_finite();
    let mut extractor = Extractor::new(plan.clone(), span.clone(), first);
    let rate = plan.sample_rate / f64::from(source.spec().sample_rate);
    if let Some(most) = source.most_frames() {
        // Rounding may add a frame, the end of the recording some of a block that is not filled.
        let frames = most.min(end).saturating_sub(begin) as f64 * rate;
        extractor.reserve(frames as u64 + 1 + (BLOCK / channels) as u64);
    }
    let mut held = Held::of(plan);
    let mut hold = |frames: u64| held.as_mut().map_or(Ok(()), |held| held.reach(frames));
    let identity = front.is_identity();
    let (mut block, mut signal) = (Vec::new(), Vec::new());
    let step = planned.step(BLOCK / channels, source.spec().sample_rate);
    let mut position = begin;
    let mut ended = false;
    // Frames read belong to the span, to its context, or in part to both.
    let mut count = |position: u64, frames: usize| {
        let end = (position + frames as u64).min(own.end);
        *decoded += end.saturating_sub(position.max(own.start));
    };
    while position < end {
        if stop.load(Ordering::Relaxed) {
            return Ok(false);
        }
        if extractor.stored() > PART {
            each(extractor.take())?;
        }
        let wanted = (step as u64).min(end - position) as usize;
        let frames = if identity {
            let room = extractor.room(wanted);
            let frames = source.read(room)?;
            count(position, frames);
            if checked {
                let byte_of = |frame| source.byte_of(frame);
                require_finite(&room[..frames * channels], position, channels, byte_of)?;
            }
            extractor.commit(wanted, frames);
            frames
        } else {
            block.resize(wanted * channels, 0.0);
            let frames = source.read(&mut block)?;
            count(position, frames);
            let samples = &block[..frames * channels];
            if checked {
                require_finite(samples, position, channels, |frame| source.byte_of(frame))?;
            }
            front.push(samples, &mut signal);
            extractor.push(&signal);
            signal.clear();
            frames
        };
        if frames == 0 {
            ended = true;
            break;
        }
        position += frames as u64;
        hold(((position - begin) as f64 * rate) as u64)?;
    }
    // The end of the crop is the end of the signal, too.
    let at_end = ended || end == crop.end;
    if !identity && at_end {
        let whole = front.finish(|rest| {
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            if extractor.stored() > PART {
                each(extractor.take())?;
            }
            extractor.push(rest);
            if plan.needs_whole() {
                hold(extractor.reached())?;
            }
            Ok::<_, Failed>(true)
        })?;
        if !whole {
            return Ok(false);
        }
    }
    each(extractor.finish(at_end)?)?;
    Ok(true)
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
        && *span == (0..u64::MAX);
    match source.most_frames().filter(|_| plain) {
        Some(most) => planned.plan.unread(most.min(crop.end).saturating_sub(crop.start)),
        None => 0,
    }
}

/// Goes to a frame, by reading where the source cannot seek.
fn skip_to(source: &mut dyn BlockSource, frame: u64) -> Result<(), Failed> {
    if frame == 0 {
        return Ok(());
    }
    if source.seekable() {
        return Ok(source.seek(frame)?);
    }
    let channels = usize::from(source.spec().channels);
    let mut block = vec![0.0; BLOCK / channels * channels];
    let mut left = frame;
    while left > 0 {
        let wanted = (left.min((BLOCK / channels) as u64)) as usize * channels;
        match source.read(&mut block[..wanted])? {
            0 => break,
            frames => left -= frames as u64,
        }
    }
    Ok(())
}

/// Refuses samples that features cannot be computed of; `position` is that of the first frame, and
/// `byte_of` knows where in the file a frame begins.
pub fn require_finite(
    samples: &[f32],
    position: u64,
    channels: usize,
    byte_of: impl Fn(u64) -> Option<u64>,
) -> Result<(), Failed> {
    if samples.iter().fold(true, |all, x| all & x.is_finite()) {
        return Ok(());
    }
    let bad = samples.iter().filter(|x| !x.is_finite()).count();
    let at = samples.iter().position(|x| !x.is_finite()).unwrap_or(0);
    let frame = position + (at / channels) as u64;
    let reason = format!(
        "NaN or infinite from frame {frame} on (channel {}; {} of this block)",
        at % channels,
        if bad == 1 { "1 sample".into() } else { format!("{bad} samples") }
    );
    Err(Failed { byte_offset: byte_of(frame), ..Failed::new(Status::NonFinite, reason) })
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
    if let Some(start) = input.start.filter(|_| crop.start > 0 && outcome.decoded_frames == 0) {
        let reason = format!("the stretch begins at {start} s, after the end of the recording");
        return Err(Failed::new(Status::Empty, reason));
    }
    let is_end = input.end.is_some_and(|end| crop.end == frame_at(end, rate));
    if is_end && outcome.decoded_frames < crop.end - crop.start {
        outcome.repairs.push(END_BEYOND.into());
    }
    Ok(())
}

/// Fills an outcome with what the reader knows.
pub fn describe(outcome: &mut Outcome, source: &dyn BlockSource) {
    let spec = source.spec();
    outcome.declared_frames = spec.declared_frames;
    outcome.sample_rate = Some(spec.sample_rate);
    outcome.channels = Some(u32::from(spec.channels));
    let report = source.health();
    for repair in &report.repairs {
        if !outcome.repairs.iter().any(|r| r == repair.name()) {
            outcome.repairs.push(repair.name().to_string());
        }
    }
    if let Some(loss) = report.loss().filter(|_| outcome.status == Status::Ok) {
        outcome.status = Status::Truncated;
        outcome.reason = loss.to_string();
    }
}
