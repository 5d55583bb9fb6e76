//! What a run tells on standard error: a bar on a terminal, lines for failures, a summary.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Mutex;
use std::time::{Duration, Instant};

use clap::ValueEnum;
use corsmal_extract::run::{Progress, RunReport};
use corsmal_files::outcome::Outcome;
use corsmal_files::quote::{printable, printable_line};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde_json::{Value, json};

use crate::plural::plural;
use crate::streams::err_lines;

/// Form of messages.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// For people.
    Text,
    /// One JSON object per line.
    Json,
}

/// A bar for work without outcomes, on a terminal only.
pub fn bar(total: usize, noun: &str, quiet: bool) -> ProgressBar {
    let target = match quiet {
        false => ProgressDrawTarget::stderr_with_hz(8),
        true => ProgressDrawTarget::hidden(),
    };
    let bar = ProgressBar::with_draw_target(Some(total as u64), target);
    bar.set_style(style(&format!("{{bar:20}} {{pos}} of {{len}} {noun}{{left}}")));
    bar
}

/// A style with the time that remains, once it can be told.
fn style(template: &str) -> ProgressStyle {
    let left = |state: &ProgressState, out: &mut dyn std::fmt::Write| {
        if state.pos() > 0 && state.len().is_some_and(|len| state.pos() < len) {
            let _ = write!(out, ", {} left", human(state.eta()));
        }
    };
    let style = ProgressStyle::with_template(template);
    style.unwrap_or_else(|_| ProgressStyle::default_bar()).with_key("left", left)
}

/// Progress of a run on standard error.
pub struct Meter {
    format: LogFormat,
    /// Only recordings without features are told.
    quiet: bool,
    bar: ProgressBar,
    started: Instant,
    /// Seconds of audio read.
    seconds: Mutex<f64>,
    /// Recordings without features by what is wrong.
    faults: Mutex<BTreeMap<String, usize>>,
}

/// Recordings that are named of those with the same fault.
const NAMED: usize = 10;

impl Meter {
    /// Draws a bar only on a terminal, and only where not `quiet`.
    pub fn new(format: LogFormat, quiet: bool) -> Self {
        let target = match format {
            LogFormat::Text if !quiet => ProgressDrawTarget::stderr_with_hz(8),
            _ => ProgressDrawTarget::hidden(),
        };
        let bar = ProgressBar::with_draw_target(None, target);
        bar.set_style(style("{bar:20} {pos} of {len} recordings{msg}{left}"));
        Self {
            format,
            quiet,
            bar,
            started: Instant::now(),
            seconds: Mutex::default(),
            faults: Mutex::default(),
        }
    }

    fn line(&self, text: &str) {
        self.bar.suspend(|| eprintln!("{text}"));
    }

    /// Says why a recording has no result, unless that was said of many others.
    pub fn refused(&self, path: &str, fault: &str) {
        let mut faults = self.faults.lock().unwrap_or_else(|e| e.into_inner());
        let count = faults.entry(fault.into()).or_default();
        *count += 1;
        if *count <= NAMED {
            self.line(&format!("{path}: {fault}"));
        }
    }

    /// Says of how many others it was not said.
    pub fn rest(&self) {
        let faults = self.faults.lock().unwrap_or_else(|e| e.into_inner());
        for (fault, count) in faults.iter().filter(|(_, count)| **count > NAMED) {
            eprintln!("and {} more: {}", count - NAMED, fault);
        }
    }

    /// The one line of a run that was only checked.
    pub fn checked(&self, inputs: usize, config_hash: &str) {
        if self.quiet {
            return;
        }
        match self.format {
            LogFormat::Json => {
                let line = json!({
                    "event": "checked", "inputs": inputs, "config_hash": config_hash,
                });
                event_line(&line);
            }
            LogFormat::Text => eprintln!(
                "{}, configuration {}, nothing was read or written",
                plural(inputs as u64, "recording"),
                &config_hash[..12]
            ),
        }
    }

    /// Why a run ended before its last recording.
    pub fn stopped(format: LogFormat, event: &str, message: &str) {
        match format {
            LogFormat::Json => event_line(&json!({"event": event, "message": printable(message)})),
            LogFormat::Text if event == "error" => {
                err_lines(&format!("error: {}", printable(message)));
            }
            LogFormat::Text => err_lines(&printable(message)),
        }
    }

    /// Seconds of the recordings that are done.
    fn audio(&self) -> f64 {
        *self.seconds.lock().unwrap_or_else(|e| e.into_inner())
    }

    /// What a run has done, for programs.
    pub fn summary(&self, report: &RunReport, out: &Path) -> Value {
        json!({
            "out": out.display().to_string(), "statuses": counts(&report.outcomes),
            "repairs": repairs(&report.outcomes), "resumed": report.resumed,
            "up_to_date": report.up_to_date, "elapsed_s": self.started.elapsed().as_secs_f64(),
            // Durations of many recordings are summed: what rounding adds is left out.
            "audio_s": (self.audio() * 1e6).round() / 1e6,
        })
    }

    /// The last lines of a run.
    pub fn finish(&self, report: &RunReport, out: &Path) {
        self.bar.finish_and_clear();
        self.rest();
        if self.quiet {
            return;
        }
        if self.format == LogFormat::Json {
            let mut line = self.summary(report, out);
            line["event"] = "finished".into();
            event_line(&line);
            return;
        }
        let out = out.display();
        let elapsed = self.started.elapsed();
        let seconds = self.audio();
        let statuses = counts(&report.outcomes);
        if report.up_to_date {
            eprintln!("{out}: up to date, nothing to do");
            return;
        }
        let mut counts: Vec<String> = statuses.iter().map(|(s, n)| format!("{n} {s}")).collect();
        if counts.is_empty() {
            counts.push("no recordings".into());
        }
        eprintln!(
            "{out}: {} in {} ({:.0} s of audio, {:.0} x real time){}",
            counts.join(", "),
            human(elapsed),
            seconds,
            seconds / elapsed.as_secs_f64().max(1e-9),
            if report.resumed > 0 {
                format!(", {} resumed", report.resumed)
            } else {
                String::new()
            },
        );
        if let Some(repaired) = repaired(report.outcomes.iter().map(|o| &o.repairs)) {
            eprintln!("{out}: {repaired}");
        }
    }
}

impl Progress for Meter {
    fn start(&self, inputs: usize, done: usize) {
        self.bar.set_length(inputs as u64);
        self.bar.set_position(done as u64);
        if self.format == LogFormat::Json && !self.quiet {
            event_line(&json!({"event": "started", "inputs": inputs, "resumed": done}));
        }
    }

    fn done(&self, outcome: &Outcome) {
        let total = {
            let mut seconds = self.seconds.lock().unwrap_or_else(|e| e.into_inner());
            *seconds += outcome.seconds().unwrap_or(0.0);
            *seconds
        };
        self.bar.inc(1);
        let speed = total / self.started.elapsed().as_secs_f64().max(1e-9);
        self.bar.set_message(format!(", {speed:.0} x real time"));
        if self.quiet && outcome.status.has_features() {
            return;
        }
        match self.format {
            LogFormat::Json => {
                let value = serde_json::to_value(outcome).unwrap_or_default();
                event_line(&json!({"event": "file", "outcome": value}));
            }
            LogFormat::Text if !outcome.status.has_features() => {
                self.refused(&outcome.path, &fault(outcome));
            }
            LogFormat::Text => {}
        }
    }

    fn warning(&self, message: &str) {
        match self.format {
            LogFormat::Text => self.line(&format!("warning: {message}")),
            LogFormat::Json => {
                event_line(&json!({"event": "warning", "message": printable(message)}))
            }
        }
    }
}

/// Says what happened to a program, which reads JSON, in a line that is never cut.
fn event_line(event: &Value) {
    err_lines(&event.to_string());
}

/// Path, status and reason of a recording without features.
pub fn failure_line(outcome: &Outcome) -> String {
    printable_line(&format!("{}: {}", outcome.path, fault(outcome)))
}

/// Status and reason of a recording without features.
pub fn fault(outcome: &Outcome) -> String {
    let place = outcome
        .byte_offset
        .filter(|_| !outcome.reason.contains("byte"))
        .map_or(String::new(), |b| format!(" (byte {b})"));
    let reason = outcome.reason.strip_prefix(&format!("{}: ", outcome.path));
    let reason = reason.unwrap_or(&outcome.reason);
    let status = match outcome.status.name() {
        said if reason.starts_with(said) => String::new(),
        unsaid => format!("{unsaid}: "),
    };
    format!("{status}{reason}{place}")
}

/// Number of inputs by status.
pub fn counts(outcomes: &[Outcome]) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    for outcome in outcomes {
        *counts.entry(outcome.status.name()).or_default() += 1;
    }
    counts
}

/// How many inputs were repaired, and how, given the repairs of each; `None` where none was.
pub fn repaired<'r>(each: impl Iterator<Item = &'r Vec<String>>) -> Option<String> {
    let (mut inputs, mut counts) = (0, BTreeMap::<&str, usize>::new());
    for repairs in each.filter(|repairs| !repairs.is_empty()) {
        inputs += 1;
        repairs.iter().for_each(|name| *counts.entry(name).or_default() += 1);
    }
    let named: Vec<_> = counts.iter().map(|(name, n)| format!("{n} {name}")).collect();
    (inputs > 0).then(|| format!("{inputs} repaired: {}", named.join(", ")))
}

/// Number of inputs by repair.
fn repairs(outcomes: &[Outcome]) -> BTreeMap<&str, usize> {
    let mut counts = BTreeMap::new();
    for name in outcomes.iter().flat_map(|outcome| &outcome.repairs) {
        *counts.entry(name.as_str()).or_default() += 1;
    }
    counts
}

/// A duration for people.
fn human(duration: Duration) -> String {
    let seconds = duration.as_secs();
    match seconds {
        0..10 => format!("{:.1} s", duration.as_secs_f64()),
        10..60 => format!("{seconds} s"),
        60..3600 => format!("{} min {:02} s", seconds / 60, seconds % 60),
        _ => format!("{} h {:02} min", seconds / 3600, seconds / 60 % 60),
    }
}
