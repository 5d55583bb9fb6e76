//! What the headers of recordings say before any of them is computed: how long they are, and whether
//! they fit into one table.

use std::collections::HashMap;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_audio::{AudioError, BlockSource, Repair};
use corsmal_files::outcome::{Outcome, Status};
use rayon::prelude::*;

use crate::config::{Channels, Config};
use crate::inputs::{Input, InputSource, stored};

/// Samples read at a time where frames have to be counted.
const BLOCK: usize = 1 << 16;
/// Different values that a message names.
const NAMED: usize = 4;

/// What a header says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Header {
    /// Frames per second.
    pub sample_rate: u32,
    /// Channels.
    pub channels: u16,
    /// Frames; `None` where only decoding tells: lengths in headers of compressed files are claims.
    pub frames: Option<u64>,
    /// Whether its reader can go to any frame.
    pub seekable: bool,
    /// Frames that the header declares.
    pub declared: Option<u64>,
}

/// How long a recording is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Length {
    /// Frames that are there.
    pub frames: u64,
    /// Why there are no more, where more should be.
    pub cut_short: Option<Repair>,
}

/// The header of each input, every file opened once; `None` for what comes once and for what cannot
/// be read, which the run will say. Waiting for stores ends when `stop` is set.
pub fn headers(inputs: &[Input], stop: &Arc<AtomicBool>) -> Vec<Option<Header>> {
    let mut sources: Vec<&InputSource> = inputs.iter().filter_map(again).collect();
    sources.sort_unstable();
    sources.dedup();
    let read = |source: &&InputSource| source.open_header(stop).ok().map(|s| of(s.as_ref()));
    let stored = sources.iter().any(|source| source.is_stored());
    let found: Vec<Option<Header>> = on_threads(stored, || sources.par_iter().map(read).collect());
    let known: HashMap<&InputSource, Option<Header>> = sources.into_iter().zip(found).collect();
    inputs.iter().map(|input| again(input).and_then(|s| known.get(s).copied()?)).collect()
}

/// Does work that is parallel in it: on more threads than cores where answers of stores are waited for,
/// else on those of the caller's pool, or of one of its own. Never on rayon's global ones, which a process
/// that was forked lacks.
fn on_threads<T: Send>(waits: bool, work: impl FnOnce() -> T + Send) -> T {
    let threads = match rayon::current_thread_index() {
        _ if waits => stored::LOOKS,
        Some(_) => return work(),
        None => 0, // one for each core
    };
    match stored::pool(threads) {
        Some(pool) => pool.install(work),
        None => work(),
    }
}

/// What can be read again afterwards.
fn again(input: &Input) -> Option<&InputSource> {
    (!input.source.comes_once()).then_some(&input.source)
}

fn of(source: &dyn BlockSource) -> Header {
    let (spec, seekable) = (source.spec(), source.seekable());
    let frames = source.most_frames().filter(|_| seekable);
    let (sample_rate, channels, declared) = (spec.sample_rate, spec.channels, spec.declared_frames);
    Header { sample_rate, channels, frames, seekable, declared }
}

/// The length of each input, the frames of every file counted once; `None` for what cannot be read to its
/// end, which the run will say. `headers` are those of [`headers`]. Waiting for stores ends when `stop`
/// is set.
pub fn lengths(
    inputs: &[Input],
    headers: &[Option<Header>],
    stop: &Arc<AtomicBool>,
) -> Vec<Option<Length>> {
    let mut sources: Vec<(&InputSource, Header)> = inputs
        .iter()
        .zip(headers)
        .filter_map(|(input, header)| Some((again(input)?, (*header)?)))
        .collect();
    sources.sort_unstable_by_key(|(source, _)| *source);
    sources.dedup_by_key(|(source, _)| *source);
    let count = |(source, header): &(&InputSource, Header)| {
        let of_header = header.frames.map(|frames| {
            let declared = header.declared.filter(|declared| *declared > frames);
            let cut_short = declared.map(|_| Repair::Truncated { declared, actual: frames });
            Length { frames, cut_short }
        });
        of_header.or_else(|| count_frames(source, stop).ok())
    };
    let found: Vec<Option<Length>> = on_threads(false, || sources.par_iter().map(count).collect());
    let known: HashMap<&InputSource, Option<Length>> =
        sources.into_iter().map(|(source, _)| source).zip(found).collect();
    inputs.iter().map(|input| again(input).and_then(|s| known.get(s).cloned()?)).collect()
}

/// Length of a recording whose header does not say: decodes it.
///
/// # Errors
/// It cannot be read to its end.
fn count_frames(source: &InputSource, stop: &Arc<AtomicBool>) -> Result<Length, AudioError> {
    let mut source = source.open_until(stop)?;
    let channels = usize::from(source.spec().channels);
    let mut block = vec![0.0; (BLOCK / channels).max(1) * channels];
    let mut frames = 0;
    loop {
        match source.read(&mut block)? {
            0 => break,
            read => frames += read as u64,
        }
    }
    let mut repairs = source.health().repairs.iter();
    let cut_short = repairs.find(|repair| matches!(repair, Repair::Truncated { .. })).cloned();
    Ok(Length { frames, cut_short })
}

/// Whether recordings fit into one summary table.
///
/// The number of channels that most of them have sets the width; the first of them in the list where
/// there are equally many. It is found from all inputs, whatever shard is computed, so that shards
/// agree.
#[derive(Debug, Default)]
pub struct Survey {
    /// Numbers of channels, the one that sets the width first; empty where the width does not depend
    /// on them.
    channels: Vec<Group<u16>>,
    /// Sample rates, the most frequent first; empty where features run at a common rate.
    rates: Vec<Group<u32>>,
}

/// Recordings that agree.
#[derive(Debug)]
struct Group<T> {
    value: T,
    count: usize,
    /// Id of the first.
    first: String,
}

impl Survey {
    /// Looks at the headers of `inputs`, where `config` asks for a summary table. Waiting for stores
    /// ends when `stop` is set; what it says then counts no more.
    pub fn of(inputs: &[Input], config: &Config, stop: &Arc<AtomicBool>) -> Self {
        if config.summary.is_none() {
            return Self::default();
        }
        let apart = depends_on_channels(config);
        let own_rate = config.signal.sample_rate == 0.0;
        if !apart && !own_rate {
            return Self::default();
        }
        let headers = headers(inputs, stop);
        let known = || inputs.iter().zip(&headers).filter_map(|(i, h)| Some((i, (*h)?)));
        let mut survey = Self::default();
        if apart {
            survey.channels = groups(known().map(|(input, header)| (input, header.channels)));
        }
        if own_rate {
            survey.rates = groups(known().map(|(input, header)| (input, header.sample_rate)));
        }
        survey
    }

    /// For recordings that come a few at a time: all tables are as wide as recordings of `channels`
    /// channels make them.
    pub fn of_channels(channels: u16, config: &Config) -> Self {
        let mut survey = Self::default();
        if depends_on_channels(config) {
            let first = format!("channels = {channels} says");
            survey.channels.push(Group { value: channels, count: 0, first });
        }
        survey
    }

    /// The number of channels that sets the width of the table; `None` where it does not depend on
    /// them, and where no header can be read.
    pub fn channels(&self) -> Option<u16> {
        self.channels.first().map(|width| width.value)
    }

    /// What the user should know before the run.
    pub fn warnings(&self) -> Vec<String> {
        let mut warnings = Vec::new();
        if let [width, others @ ..] = &self.channels[..]
            && !others.is_empty()
        {
            let odd: usize = others.iter().map(|group| group.count).sum();
            let all = odd + width.count;
            warnings.push(format!(
                "{} of {all} recordings have {}, which sets the width of the table (the first: {}); \
                 {odd} with another number ({}) will have the status mismatch. {ONE_WIDTH}",
                width.count,
                channels_text(width.value),
                width.first,
                listed(others, |channels| channels_text(*channels)),
            ));
        }
        if let [usual, _, ..] = &self.rates[..] {
            warnings.push(format!(
                "the table mixes {} sample rates ({}): features of different rates are not \
                 comparable. --set signal.sample_rate={} gives one",
                self.rates.len(),
                listed(&self.rates, |rate| format!("{rate} Hz")),
                usual.value,
            ));
        }
        warnings
    }

    /// Whether a run with this table could have come to this outcome.
    pub fn agrees(&self, outcome: &Outcome) -> bool {
        let (Some(width), Some(channels)) = (self.channels(), outcome.channels) else {
            return true;
        };
        let is_as_wide = channels == u32::from(width);
        match is_refusal(outcome) {
            true => !is_as_wide,
            false => is_as_wide || !outcome.status.has_features(),
        }
    }

    /// Gives the reason of an earlier run that refused a recording for its channels as of now: other
    /// recordings may have set the width.
    pub fn renew(&self, outcome: &mut Outcome) {
        let channels = outcome.channels.and_then(|channels| u16::try_from(channels).ok());
        if let Some(reason) = channels.and_then(|channels| self.refusal(channels))
            && is_refusal(outcome)
        {
            outcome.reason = reason;
        }
    }

    /// Why a recording of so many channels does not fit into the table.
    pub fn refusal(&self, channels: u16) -> Option<String> {
        let width = self.channels.first().filter(|width| width.value != channels)?;
        Some(format!(
            "{} where the table has {} (as {}). {ONE_WIDTH}",
            channels_text(channels),
            width.value,
            width.first
        ))
    }
}

/// Whether the width of the table depends on the number of channels.
fn depends_on_channels(config: &Config) -> bool {
    config.signal.channels == Channels::All
        && config.summary.as_ref().is_some_and(|summary| !summary.average_channels)
        && config.projection.is_none()
}

/// What the user can do.
const ONE_WIDTH: &str =
    "--set signal.channels=mean or --set summary.average_channels=true gives one width";

/// Whether a recording was refused for its channels.
fn is_refusal(outcome: &Outcome) -> bool {
    outcome.status == Status::Mismatch && outcome.reason.ends_with(ONE_WIDTH)
}

fn channels_text(channels: u16) -> String {
    format!("{channels} channel{}", if channels == 1 { "" } else { "s" })
}

/// The inputs by their value, the most frequent value first, else in the order of the list.
fn groups<'i, T: PartialEq>(values: impl Iterator<Item = (&'i Input, T)>) -> Vec<Group<T>> {
    let mut groups: Vec<Group<T>> = Vec::new();
    for (input, value) in values {
        match groups.iter_mut().find(|group| group.value == value) {
            Some(group) => group.count += 1,
            None => groups.push(Group { value, count: 1, first: input.id.clone() }),
        }
    }
    groups.sort_by_key(|group| std::cmp::Reverse(group.count));
    groups
}

/// `44100 Hz: 3, such as a`.
fn listed<T>(groups: &[Group<T>], name: impl Fn(&T) -> String) -> String {
    let one = |group: &Group<T>| match group.count {
        1 => format!("{}: {}", name(&group.value), group.first),
        count => format!("{}: {count}, such as {}", name(&group.value), group.first),
    };
    let mut parts: Vec<String> = groups.iter().take(NAMED).map(one).collect();
    if groups.len() > NAMED {
        parts.push(format!("and {} more", groups.len() - NAMED));
    }
    parts.join("; ")
}
