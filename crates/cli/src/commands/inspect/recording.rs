//! Inspection of a recording.

use std::fmt::Write as _;
use std::path::Path;
use std::process::ExitCode;

use corsmal_audio::{
    AudioError, AudioSpec, BlockSource, Health, HealthMeter, ReadReport, Repair, open,
};
use corsmal_extract::engine::LARGEST_SAMPLE;
use corsmal_files::quote::printable_line;
use corsmal_report::Overview;
use serde::Serialize;

use super::picture::Picture;
use super::refusal::{Refusal, to_json};
use crate::failure::Failure;
use crate::plural::plural;

/// Frames read at once.
const BLOCK: usize = 8192;

/// Everything that is printed; its JSON form is the output of `--json`.
#[derive(Serialize)]
struct Inspection<'a> {
    path: String,
    status: &'static str,
    #[serde(flatten)]
    spec: &'a AudioSpec,
    seconds: f64,
    #[serde(flatten)]
    reading: &'a ReadReport,
    health: &'a Health,
}

/// Reads the recording once and prints its report.
pub fn inspect(path: &Path, picture: Option<&Picture>, json: bool) -> Result<ExitCode, Failure> {
    if let Some(picture) = picture {
        picture.takes("a recording", &Picture::OF_RECORDINGS)?;
    }
    let name = path.display().to_string();
    let mut source = match open(path) {
        Ok(source) => source,
        Err(error) => return refuse(&name, &error, json),
    };
    let spec = source.spec().clone();
    let channels = usize::from(spec.channels);
    let mut meter = HealthMeter::new(channels, spec.sample_rate);
    let mut drawn = picture.map(|picture| Excerpt::new(picture, &spec)).transpose()?;
    let mut block = vec![0.0; BLOCK * channels];
    loop {
        let samples = match next(source.as_mut(), &mut block) {
            Ok([]) => break,
            Ok(samples) => samples,
            Err(error) => return refuse(&name, &error, json),
        };
        meter.push(samples);
        if let Some(drawn) = &mut drawn {
            drawn.push(samples)?;
        }
    }
    let health = meter.finish();
    let seconds = health.frames as f64 / f64::from(spec.sample_rate);
    let reading = source.health();
    let status = status(reading.loss(), &health);
    let report = Inspection { path: name, status, spec: &spec, seconds, reading, health: &health };
    print!("{}", if json { to_json(&report)? } else { report.text() });
    if let Some(drawn) = drawn {
        let file = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        drawn.save(file, report.facts())?;
    }
    Ok(ExitCode::SUCCESS)
}

/// What `extract` says of a recording that can be read.
pub(super) fn status(loss: Option<&Repair>, health: &Health) -> &'static str {
    let channels = || health.channels.iter();
    let is_huge = |dbfs: f64| dbfs > 20.0 * f64::from(LARGEST_SAMPLE).log10();
    match loss {
        _ if health.frames == 0 => "empty",
        _ if channels().any(|channel| channel.non_finite > 0) => "non_finite",
        _ if channels().any(|channel| channel.peak_dbfs.is_some_and(is_huge)) => "unsupported",
        Some(_) => "truncated",
        None => "ok",
    }
}

/// The stretch of a recording that is drawn, with the health of that stretch.
struct Excerpt<'a> {
    picture: &'a Picture,
    overview: Overview,
    meter: HealthMeter,
    channels: usize,
    /// Frames still to pass over, and then to take.
    before: u64,
    left: u64,
}

impl<'a> Excerpt<'a> {
    fn new(picture: &'a Picture, spec: &AudioSpec) -> Result<Self, Failure> {
        let channels = usize::from(spec.channels);
        picture.check_channels(channels)?;
        let rate = f64::from(spec.sample_rate);
        // Beyond the largest whole number a conversion saturates, later than any recording ends.
        let before = (picture.view.start * rate).round() as u64;
        let left = picture.end.map_or(u64::MAX, |end| (end * rate).round() as u64 - before);
        Ok(Self {
            picture,
            overview: Overview::new(channels, spec.sample_rate, picture.view.clone())?,
            meter: HealthMeter::new(channels, spec.sample_rate),
            channels,
            before,
            left,
        })
    }

    fn push(&mut self, samples: &[f32]) -> Result<(), Failure> {
        let frames = (samples.len() / self.channels) as u64;
        let skip = self.before.min(frames);
        let take = (frames - skip).min(self.left);
        self.before -= skip;
        self.left -= take;
        let [skip, take] = [skip, take].map(|n| n as usize * self.channels);
        let samples = &samples[skip..skip + take];
        self.meter.push(samples);
        self.overview.push(samples)?;
        Ok(())
    }

    fn save(self, file: String, facts: String) -> Result<(), Failure> {
        let health = self.meter.finish();
        if health.frames == 0 && self.before > 0 {
            let start = self.picture.view.start;
            return Err(Failure::new(format!("--start {start}: {file} ends before that")));
        }
        let title = self.picture.title.clone().unwrap_or(file);
        let figure = self.overview.finish(title, facts, |channel| health.notes(channel))?;
        self.picture.save(&figure)
    }
}

/// The next samples; none at the end.
fn next<'a>(source: &mut dyn BlockSource, block: &'a mut [f32]) -> Result<&'a [f32], AudioError> {
    let frames = source.read(block)?;
    Ok(&block[..frames * usize::from(source.spec().channels)])
}

fn refuse(path: &str, error: &AudioError, json: bool) -> Result<ExitCode, Failure> {
    let (status, reason) = (error.verdict().name(), &error.to_string());
    Refusal { path, status, byte: error.offset(), reason }.print(json)
}

impl Inspection<'_> {
    /// Format, size and length in one line.
    fn facts(&self) -> String {
        let AudioSpec { sample_rate, channels, format, .. } = self.spec;
        format!(
            "{format} · {} · {sample_rate} Hz · {:.3} s ({})",
            plural(*channels, "channel"),
            self.seconds,
            plural(self.health.frames, "frame")
        )
    }

    fn text(&self) -> String {
        let mut out = format!("{}\n  {}\n", printable_line(&self.path), self.facts());
        for repair in &self.reading.repairs {
            line(&mut out, format_args!("  {}: {repair}", repair.name()));
        }
        line(&mut out, format_args!(""));
        line(
            &mut out,
            format_args!(
                "  {:>7}  {:>9}  {:>8}  {:>9}  {:>7}  {:>7}  notes",
                "channel", "peak dBFS", "RMS dBFS", "DC offset", "clipped", "silence"
            ),
        );
        for (i, channel) in self.health.channels.iter().enumerate() {
            let silence = format!("{:.1}%", channel.silence * 100.0);
            let row = format!(
                "  {i:>7}  {:>9}  {:>8}  {:>9}  {:>7}  {silence:>7}  {}",
                decibels(channel.peak_dbfs),
                decibels(channel.rms_dbfs),
                offset(channel.dc_offset),
                channel.clipped_samples,
                self.health.notes(i).join(", ")
            );
            line(&mut out, format_args!("{}", row.trim_end()));
        }
        if let Some(text) = self.correlations() {
            line(&mut out, format_args!("\n  {text}"));
        }
        out
    }

    /// The least and the most correlated pair of channels.
    fn correlations(&self) -> Option<String> {
        let live = |i: &usize| !self.health.channels[*i].dead;
        let live: Vec<usize> = (0..self.health.channels.len()).filter(live).collect();
        let pairs = live.iter().flat_map(|&i| live.iter().map(move |&j| (i, j)));
        let pairs: Vec<_> = pairs.filter(|(i, j)| i < j).collect();
        let r = |&(i, j): &(usize, usize)| self.health.correlation[i][j];
        let least = pairs.iter().min_by(|a, b| r(a).total_cmp(&r(b)))?;
        let most = pairs.iter().max_by(|a, b| r(a).total_cmp(&r(b)))?;
        Some(format!(
            "correlation of channels: {:.3} ({} and {}) to {:.3} ({} and {})",
            r(least),
            least.0,
            least.1,
            r(most),
            most.0,
            most.1
        ))
    }
}

/// Five decimals, without a sign where they are all zero.
fn offset(mean: f64) -> String {
    let text = format!("{mean:.5}");
    if text == "-0.00000" { "0.00000".into() } else { text }
}

/// A level, `-inf` for none.
pub fn decibels(level: Option<f64>) -> String {
    level.map_or("-inf".into(), |db| format!("{db:.2}"))
}

/// A length of time with its units.
pub fn length(seconds: f64) -> String {
    if seconds < 60.0 {
        return format!("{seconds:.2} s");
    }
    let whole = seconds.round() as u64;
    match whole / 3600 {
        0 => format!("{} min {:02} s", whole / 60, whole % 60),
        hours => format!("{hours} h {:02} min {:02} s", whole / 60 % 60, whole % 60),
    }
}

/// Writing to a string cannot fail.
fn line(out: &mut String, text: std::fmt::Arguments<'_>) {
    let _ = writeln!(out, "{text}");
}
