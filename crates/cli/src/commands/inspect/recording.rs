//! Inspection of a recording.

use std::fmt::Write as _;
use std::path::Path;
use std::process::ExitCode;

use corsmal_audio::{
    AudioError, AudioSpec, BlockSource, ChannelHealth, Health, HealthMeter, ReadReport, open,
};
use corsmal_plot::{to_png, to_svg};
use serde::Serialize;

use super::overview::Overview;
use super::{Picture, PictureFormat, Refusal, to_json};
use crate::failure::Failure;
use corsmal_files::draft;

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
    let name = path.display().to_string();
    let mut source = match open(path) {
        Ok(source) => source,
        Err(error) => return refuse(&name, &error, json),
    };
    let spec = source.spec().clone();
    let channels = usize::from(spec.channels);
    let mut meter = HealthMeter::new(channels, spec.sample_rate);
    let mut overview = match picture {
        Some(_) => Some(Overview::new(channels, spec.sample_rate)?),
        None => None,
    };
    let mut block = vec![0.0; BLOCK * channels];
    loop {
        let samples = match next(source.as_mut(), &mut block) {
            Ok([]) => break,
            Ok(samples) => samples,
            Err(error) => return refuse(&name, &error, json),
        };
        meter.push(samples);
        if let Some(overview) = &mut overview {
            overview.push(samples)?;
        }
    }
    let health = meter.finish();
    let seconds = health.frames as f64 / f64::from(spec.sample_rate);
    let reading = source.health();
    let report =
        Inspection { path: name, status: "ok", spec: &spec, seconds, reading, health: &health };
    print!("{}", if json { to_json(&report)? } else { report.text() });

    if let (Some(overview), Some(picture)) = (overview, picture) {
        let title = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let figure = overview.finish(title, report.facts())?;
        let bytes = match picture.format {
            PictureFormat::Png => to_png(&figure)?,
            PictureFormat::Svg => to_svg(&figure)?.into_bytes(),
        };
        draft::write(&picture.path, &bytes)?;
    }
    Ok(ExitCode::SUCCESS)
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
            counted((*channels).into(), "channel"),
            self.seconds,
            counted(self.health.frames, "frame")
        )
    }

    fn text(&self) -> String {
        let mut out = format!("{}\n  {}\n", self.path, self.facts());
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
                "  {i:>7}  {:>9}  {:>8}  {:>9.5}  {:>7}  {silence:>7}  {}",
                decibels(channel.peak_dbfs),
                decibels(channel.rms_dbfs),
                channel.dc_offset,
                channel.clipped_samples,
                self.notes(i, channel)
            );
            line(&mut out, format_args!("{}", row.trim_end()));
        }
        if let Some(text) = self.correlations() {
            line(&mut out, format_args!("\n  {text}"));
        }
        out
    }

    fn notes(&self, i: usize, channel: &ChannelHealth) -> String {
        let mut notes = Vec::new();
        if channel.dead && self.health.frames > 0 {
            notes.push("dead (constant)".to_owned());
        }
        if channel.clipped_runs > 0 {
            notes.push(format!("clipped in {}", counted(channel.clipped_runs, "place")));
        }
        if let Some((first, _)) = self.health.duplicates.iter().find(|(_, second)| *second == i) {
            notes.push(format!("same as channel {first}"));
        }
        if channel.non_finite > 0 {
            notes.push(format!("{} not finite", counted(channel.non_finite, "sample")));
        }
        notes.join(", ")
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

fn counted(count: u64, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

fn decibels(level: Option<f64>) -> String {
    level.map_or("-inf".into(), |db| format!("{db:.2}"))
}

/// Writing to a string cannot fail.
fn line(out: &mut String, text: std::fmt::Arguments<'_>) {
    let _ = writeln!(out, "{text}");
}
