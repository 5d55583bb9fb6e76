//! Recordings cut into windows or stretches, each an input of its own.

use std::collections::HashMap;
use std::ops::RangeInclusive;
use std::path::absolute;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_audio::Repair;
use corsmal_files::spelling;

use crate::inputs::{Input, InputError, InputSource};
use crate::survey::{Length, headers, lengths};

/// Column that holds the recording of a window or stretch: the group that folds keep together.
pub const RECORDING: &str = "recording";
/// Most windows of a run.
const MOST: u64 = 50_000_000;

/// Seconds that a window or hop can have.
pub const WINDOW_SECONDS: RangeInclusive<f64> = 1e-3..=1e6;

/// Length of windows and distance from one to the next, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowSpan {
    /// Length.
    pub window: f64,
    /// From the begin of one to that of the next.
    pub hop: f64,
}

/// Windows, and what has none.
#[derive(Debug, Default)]
pub struct Windows {
    /// In the order of the recordings and of time.
    pub inputs: Vec<Input>,
    /// Recordings that were cut short, and stretches that end after their recording: how many, and of
    /// the first one the id and what is missing.
    cut_short: Missing,
    beyond: Missing,
}

type Missing = Option<(usize, String)>;

impl Windows {
    /// What the user should know before the run.
    pub fn warnings(&self) -> Vec<String> {
        let told = |missing: &Missing, what: &str| {
            let (number, first) = missing.as_ref()?;
            let of = match number {
                1 => String::new(),
                number => format!(", the first of {number} such {what}"),
            };
            Some(format!("{first}{of}; what is missing has no windows"))
        };
        let cut_short = told(&self.cut_short, "inputs");
        cut_short.into_iter().chain(told(&self.beyond, "stretches")).collect()
    }
}

fn note(missing: &mut Missing, what: impl FnOnce() -> String) {
    missing.get_or_insert_with(|| (0, what())).0 += 1;
}

/// The same with a label `recording`, the path, where inputs are stretches of one file: folds keep them
/// together also where another program rewrites the table. A label of that name stays as it is.
pub fn name_recordings(mut inputs: Vec<Input>) -> Vec<Input> {
    let is_stretch = |input: &Input| input.start.is_some() || input.end.is_some();
    let is_named = |input: &Input| input.labels.iter().any(|(name, _)| name == RECORDING);
    if !inputs.iter().any(is_stretch) || inputs.iter().any(is_named) {
        return inputs;
    }
    // A file may be written in several ways; the first one names it.
    let mut names: HashMap<String, (String, String)> = HashMap::new();
    let mut places = Vec::with_capacity(inputs.len());
    for input in &inputs {
        let name = spelling::plain(&input.source.to_string());
        let place = match &input.source {
            InputSource::File(path) => {
                absolute(path).ok().map(|path| spelling::plain(&path.to_string_lossy()))
            }
            InputSource::Object(object) => Some(object.address()),
            _ => None,
        };
        let place = place.unwrap_or_else(|| name.clone());
        names.entry(place.clone()).or_insert_with(|| (name, input.id.clone()));
        places.push(place);
    }
    // Addresses that only their queries tell apart, which no output has, go by the first of their ids.
    let mut times: HashMap<&str, usize> = HashMap::new();
    names.values().for_each(|(name, _)| *times.entry(name).or_default() += 1);
    let named = |(name, id): &(String, String)| match times[name.as_str()] {
        1 => name.clone(),
        _ => id.clone(),
    };
    let recordings: Vec<String> = places.iter().map(|place| named(&names[place])).collect();
    if names.len() < inputs.len() {
        let named = inputs.iter_mut().zip(recordings);
        named.for_each(|(input, recording)| input.labels.push((RECORDING.into(), recording)));
    }
    inputs
}

/// The windows of every recording, in the order of time: `x@0.5` begins half a second into `x`.
/// Labels are copied; the column `recording` holds the id of the recording, or its path where inputs are
/// stretches of one file.
///
/// Windows begin at multiples of the hop and are whole: what remains at the end is left out, but a
/// recording shorter than a window is one window. Both are whole numbers of frames, rounded once.
/// What cannot be read stays as it is, for its row in the output. Waiting for stores ends when `stop` is
/// set.
///
/// # Errors
/// Standard input, which cannot be read twice; too many windows; a window with the id of another
/// input; a label called `recording`, by whose values folds would split recordings; a stop.
pub fn into_windows(
    inputs: Vec<Input>,
    span: WindowSpan,
    stop: &Arc<AtomicBool>,
) -> Result<Windows, InputError> {
    if let Some(input) = inputs.iter().find(|i| i.labels.iter().any(|(name, _)| name == RECORDING))
    {
        let reason = format!(
            "the manifest has a column {RECORDING}, the name of what windows are cut from: rename it"
        );
        return Err(InputError::Window { id: input.id.clone(), reason });
    }
    let inputs = name_recordings(inputs);
    let headers = headers(&inputs, stop);
    let lengths = lengths(&inputs, &headers, stop);
    if stop.load(Ordering::Relaxed) {
        return Err(InputError::Stopped);
    }
    let mut windows = Windows::default();
    for ((input, header), length) in inputs.into_iter().zip(headers).zip(lengths) {
        if input.source.comes_once() {
            let name = match &input.source {
                InputSource::Pipe(path) => format!("{} is a pipe or device, so it", path.display()),
                _ => "standard input".into(),
            };
            let reason = format!("{name} cannot be cut into windows; classify --window can");
            return Err(InputError::Window { id: input.id, reason });
        }
        match header.zip(length) {
            Some((header, length)) => {
                of_recording(&input, (header.sample_rate, &length), span, &mut windows)?;
            }
            None => windows.inputs.push(labelled(&input, input.id.clone(), input.start, input.end)),
        }
    }
    let mut ids: Vec<&str> = windows.inputs.iter().map(|input| input.id.as_str()).collect();
    ids.sort_unstable();
    match ids.windows(2).find(|pair| pair[0] == pair[1]) {
        None => Ok(windows),
        Some(pair) => {
            let reason = "a window of one recording has the id of another input".into();
            Err(InputError::Window { id: pair[0].into(), reason })
        }
    }
}

fn of_recording(
    input: &Input,
    (sample_rate, length): (u32, &Length),
    span: WindowSpan,
    windows: &mut Windows,
) -> Result<(), InputError> {
    let rate = f64::from(sample_rate);
    let frames = |seconds: f64| ((seconds * rate).round() as u64).max(1);
    let at = |seconds: f64| frame_at(seconds, rate);
    let base = input.start.map_or(0, at);
    let (there, wanted) = (length.frames, input.end.map_or(u64::MAX, at));
    let end = wanted.min(there);
    let (window, hop) = (frames(span.window), frames(span.hop));
    let count = match end.saturating_sub(base).checked_sub(window) {
        None => {
            // Shorter than a window.
            let id = format!("{}@{}", input.id, seconds(base, rate));
            // Its row says what is missing.
            windows.inputs.push(labelled(input, id, input.start, input.end));
            return Ok(());
        }
        Some(rest) => rest / hop + 1,
    };
    if count + windows.inputs.len() as u64 > MOST {
        let reason = format!("more than {MOST} windows in all; use a longer hop");
        return Err(InputError::Window { id: input.id.clone(), reason });
    }
    for number in 0..count {
        let first = base + number * hop;
        let id = format!("{}@{}", input.id, seconds(first, rate));
        let (start, end) = (first as f64 / rate, (first + window) as f64 / rate);
        windows.inputs.push(labelled(input, id, Some(start), Some(end)));
    }
    let until = |end: u64| (end.saturating_sub(base + window) / hop).saturating_add(1);
    match (&length.cut_short, input.end) {
        (Some(Repair::Truncated { declared: Some(declared), .. }), _)
            if until(wanted.min(*declared)) == count => {}
        (_, Some(_)) if until(wanted) == count => {}
        (Some(repair), _) => {
            note(&mut windows.cut_short, || format!("{}: {repair}", input.id));
        }
        (None, Some(end)) => note(&mut windows.beyond, || {
            let there = seconds(there, rate);
            format!("{}: the stretch ends at {end} s, its recording at {there} s", input.id)
        }),
        (None, None) => {}
    }
    Ok(())
}

/// Seconds of a frame as short as can be: to the microsecond, or the nanosecond where that names another frame.
fn seconds(frame: u64, rate: f64) -> f64 {
    let to = |digits: f64| (frame as f64 / rate * digits).round() / digits;
    let short = to(1e6);
    if frame_at(short, rate) == frame { short } else { to(1e9) }
}

/// The frame that a time names: the last one that does not begin later.
fn frame_at(seconds: f64, rate: f64) -> u64 {
    (seconds * rate + 1e-3) as u64
}

fn labelled(input: &Input, id: String, start: Option<f64>, end: Option<f64>) -> Input {
    let mut labels = input.labels.clone();
    if labels.iter().all(|(name, _)| name != RECORDING) {
        labels.push((RECORDING.into(), input.id.clone()));
    }
    Input { id, source: input.source.clone(), start, end, labels }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A manifest made of ids began a frame earlier.
    #[test]
    fn the_time_in_an_id_names_the_frame() {
        for rate in [8000.0, 22_050.0, 44_100.0, 192_000.0] {
            for frame in (0..500_000).step_by(61).chain([5_513, 10_000_000_001]) {
                assert_eq!(frame_at(seconds(frame, rate), rate), frame, "{frame} at {rate}");
            }
        }
        assert_eq!(seconds(22_050, 44_100.0).to_string(), "0.5");
        assert_eq!(seconds(5_513, 44_100.0).to_string(), "0.125011338");
    }
}
