//! Inspection of folders and of several recordings: a line for each, and what they have in common.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use corsmal_extract::inputs::InputSource;
use corsmal_files::quote::printable_line;
use corsmal_report::{Look, ReportError, look};
use rayon::prelude::*;
use serde::Serialize;

use super::recording::{decibels, length, status};
use super::refusal::to_json;
use crate::failure::{FAILED_FILES, Failure};
use crate::plural::plural;
use crate::recordings;

/// The line of one recording.
#[derive(Serialize)]
struct Line {
    path: String,
    status: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    reason: Option<String>,
    #[serde(flatten)]
    sound: Option<Sound>,
}

/// What is known of a recording that can be read.
#[derive(Serialize)]
struct Sound {
    format: String,
    sample_rate: u32,
    channels: u16,
    seconds: f64,
    peak_dbfs: Option<f64>,
    /// Share of silent blocks in the least silent channel.
    silence: f64,
    repairs: usize,
    notes: Vec<String>,
}

/// Prints a line for each recording that `paths` stand for.
pub fn inspect(paths: &[PathBuf], json: bool) -> Result<ExitCode, Failure> {
    let mut files: Vec<PathBuf> = Vec::new();
    for input in recordings::named(paths, recordings::warn)? {
        match input.source {
            InputSource::File(path) => files.push(path),
            InputSource::Member(member) => {
                return Err(Failure::new(format!(
                    "{}: inspect looks at files; extract and classify read recordings in tars",
                    member.path.display()
                )));
            }
            InputSource::Object(object) => {
                return Err(Failure::new(format!(
                    "{object}: inspect looks at files; extract and classify read objects in stores"
                )));
            }
            source => {
                return Err(Failure::new(format!(
                    "{source}: inspect looks at files, and reads them more than once: name a file"
                )));
            }
        }
    }
    let lines: Vec<Line> = files.par_iter().map(|path| Line::of(path)).collect();
    let failed = lines.iter().filter(|line| line.sound.is_none()).count();
    print!("{}", if json { to_json(&lines)? } else { text(&lines) });
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}

impl Line {
    fn of(path: &Path) -> Self {
        let name = path.display().to_string();
        match look(path, Vec::new()) {
            Ok(look) => {
                let status = status(look.loss.as_ref(), &look.health);
                let mut sound = Sound::of(look);
                // Notes of channels say where samples are not finite.
                if !matches!(status, "ok" | "non_finite") {
                    sound.notes.push(status.into());
                }
                Self { path: name, status, reason: None, sound: Some(sound) }
            }
            Err(error) => {
                let status = match &error {
                    ReportError::Audio { source, .. } => source.verdict().name(),
                    _ => "error",
                };
                let text = error.to_string();
                let reason = text.strip_prefix(&format!("{name}: ")).unwrap_or(&text).to_owned();
                Self { path: name, status, reason: Some(reason), sound: None }
            }
        }
    }
}

impl Sound {
    fn of(look: Look) -> Self {
        Self {
            seconds: look.seconds(),
            peak_dbfs: look.peak_dbfs(),
            silence: look.health.channels.iter().map(|c| c.silence).fold(1.0, f64::min),
            repairs: look.repairs,
            notes: look.notes(),
            sample_rate: look.spec.sample_rate,
            channels: look.spec.channels,
            format: look.spec.format,
        }
    }
}

fn text(lines: &[Line]) -> String {
    let width = lines
        .iter()
        .map(|l| printable_line(&l.path).chars().count())
        .max()
        .unwrap_or(4)
        .clamp(4, 60);
    let lengths = lines.iter().filter_map(|l| l.sound.as_ref()).map(|s| length(s.seconds).len());
    let long = lengths.max().unwrap_or(0).max(9);
    let mut out = format!(
        "{:width$}  {:>long$}  {:>6}  {:>2}  {:>9}  {:>7}  notes\n",
        "file", "length", "Hz", "ch", "peak dBFS", "silence"
    );
    for line in lines {
        let row = match (&line.sound, &line.reason) {
            (Some(sound), _) => {
                let repaired = (sound.repairs > 0).then(|| format!("{} repaired", sound.repairs));
                let notes: Vec<_> = sound.notes.iter().cloned().chain(repaired).collect();
                format!(
                    "{:width$}  {:>long$}  {:>6}  {:>2}  {:>9}  {:>7}  {}",
                    printable_line(&line.path),
                    length(sound.seconds),
                    sound.sample_rate,
                    sound.channels,
                    decibels(sound.peak_dbfs),
                    format!("{:.1}%", 100.0 * sound.silence),
                    notes.join("; ")
                )
            }
            (None, reason) => {
                format!(
                    "{:width$}  {}",
                    printable_line(&line.path),
                    reason.as_deref().unwrap_or(line.status)
                )
            }
        };
        out.push_str(row.trim_end());
        out.push('\n');
    }
    out + "\n" + &summary(lines)
}

/// How many, how long, and what differs among them.
fn summary(lines: &[Line]) -> String {
    let sounds: Vec<&Sound> = lines.iter().filter_map(|l| l.sound.as_ref()).collect();
    let failed = lines.len() - sounds.len();
    let mut counts: BTreeMap<(u32, u16), u64> = BTreeMap::new();
    for sound in &sounds {
        *counts.entry((sound.sample_rate, sound.channels)).or_default() += 1;
    }
    let kinds: Vec<String> = counts
        .iter()
        .map(|((rate, channels), n)| format!("{n} at {rate} Hz, {}", plural(*channels, "channel")))
        .collect();
    let total: f64 = sounds.iter().map(|s| s.seconds).sum();
    let shortest = sounds.iter().map(|s| s.seconds).fold(f64::INFINITY, f64::min);
    let longest = sounds.iter().map(|s| s.seconds).fold(0.0, f64::max);
    let noted = sounds.iter().filter(|s| !s.notes.is_empty()).count();
    let mut out = format!("{}: {}", plural(sounds.len(), "recording"), length(total + 0.0));
    if sounds.len() > 1 {
        let (shortest, longest) = (length(shortest), length(longest));
        match shortest == longest {
            true => out.push_str(&format!(" in all, {longest} each")),
            false => out.push_str(&format!(" in all, {shortest} to {longest}")),
        }
    }
    out.push('\n');
    if !kinds.is_empty() {
        out.push_str(&format!("{}\n", kinds.join("; ")));
    }
    if noted > 0 {
        out.push_str(&format!("{} with notes\n", plural(noted, "recording")));
    }
    if failed > 0 {
        out.push_str(&format!("{} cannot be read\n", plural(failed, "file")));
    }
    out
}
