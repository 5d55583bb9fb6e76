//! A prediction for each window of a recording or of an endless stream, or one from all of them.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use corsmal_extract::config::SignalConfig;
use corsmal_extract::engine::{Features, SignalError, Signals, Windowing, Windows};
use corsmal_extract::inputs::Input;
use corsmal_files::outcome::Status;
use corsmal_models::classifiers::Predicted;
use corsmal_models::fusion::WindowVotes;
use corsmal_models::model_file::{FormatRule, Lengths, Model};
use corsmal_models::predictions::Record;
use corsmal_models::voting::{Decision, VotingRule};
use linfa::traits::Predict;
use ndarray::ArrayView2;
use rayon::prelude::*;

use super::args::{Args, configuration, recordings};
use super::records::{End, Records, delivered, path_of};
use crate::failure::Failure;
use crate::recordings::warn;

/// Recordings of each worker whose lines wait to be written in order.
const AHEAD: usize = 4;

/// Predicts window by window.
pub fn run(
    args: &Args,
    model: &Model,
    windowing: Windowing,
    vote: Option<VotingRule>,
) -> Result<(End, Option<Records>), Failure> {
    let config = configuration(args, model)?;
    cropped(&config.signal, windowing.window()).iter().for_each(|warning| warn(warning));
    let config_value = config.to_value();
    let formats = args.rule(model, &config_value)?;
    let signals = Signals::new(config);
    let found = recordings(args)?;
    let columns: Vec<String> =
        found.iter().take(1).flat_map(|f| &f.labels).map(|(column, _)| column.clone()).collect();
    let header = model.header();
    let mut records = args.records(&header.labels, &header.target, args.unit(vote), &columns)?;
    let stop = crate::interrupt::flag();
    let lengths = Mutex::new(model.lengths(&config_value));
    let predictor = Predictor { model, formats, lengths, signals, windowing, vote, stop };
    let end = predict(args, &found, &predictor, &mut records)?;
    let nothing = matches!(end, End::Interrupted) && records.written == 0;
    Ok((end, (!nothing).then_some(records)))
}

/// That features leave out a part of each window of so many seconds, if they do.
fn cropped(signal: &SignalConfig, window: f64) -> Option<String> {
    let SignalConfig { start, end, .. } = signal;
    let start = (*start > 0.0).then(|| format!("signal.start = {start}"));
    let end = (*end > 0.0 && *end < window).then(|| format!("signal.end = {end}"));
    let keys: Vec<String> = start.into_iter().chain(end).collect();
    (!keys.is_empty()).then(|| {
        format!(
            "{}: the model's features leave out a part of each window, as they did of each training recording; to use \
             whole windows, train without these settings",
            keys.join(", ")
        )
    })
}

fn predict(
    args: &Args,
    found: &[Input],
    predictor: &Predictor<'_>,
    records: &mut Records,
) -> Result<End, Failure> {
    let mut write = |line: Line<'_>| {
        if let Some(reason) = line.reason {
            eprintln!("{}: {}: {reason}", line.record.id, line.record.status.name());
        }
        delivered(records.write(&line.record))
    };
    if let [only] = found {
        // A stream may never end: what is predicted is written at once.
        let mut unread = false;
        predictor.predict(only, &mut |line| {
            unread = !write(line)?;
            Ok(!unread)
        })?;
        return Ok(if unread { End::Unread } else { predictor.end() });
    }
    let pool = args.jobs.pool()?;
    for part in found.chunks(AHEAD * args.jobs.count()) {
        let predicted: Vec<Result<Vec<Line<'_>>, Failure>> = pool.install(|| {
            let each = part.par_iter().map(|input| {
                let mut all = Vec::new();
                predictor.predict(input, &mut |line| {
                    all.push(line);
                    Ok(true)
                })?;
                Ok(all)
            });
            each.collect()
        });
        if predictor.stopped() {
            break;
        }
        for line in predicted.into_iter().collect::<Result<Vec<_>, _>>()?.into_iter().flatten() {
            if !write(line)? {
                return Ok(End::Unread);
            }
        }
    }
    Ok(predictor.end())
}

/// A line, and in words why it has no prediction or one from a part of the windows only.
struct Line<'a> {
    record: Record<'a>,
    reason: Option<String>,
}

struct Predictor<'a> {
    model: &'a Model,
    formats: FormatRule,
    /// those of the training, until a window was found that is of another length
    lengths: Mutex<Option<Lengths>>,
    signals: Signals,
    windowing: Windowing,
    vote: Option<VotingRule>,
    stop: &'static Arc<AtomicBool>,
}

impl Predictor<'_> {
    fn end(&self) -> End {
        if self.stopped() { End::Interrupted } else { End::Done }
    }

    /// Warns of the first window that is of another length than the recordings of the training.
    fn check_length(&self, id: &str, seconds: f64) {
        let mut lengths = self.lengths.lock().unwrap_or_else(|e| e.into_inner());
        if let Some(known) = lengths.take_if(|known| known.differ_from(seconds)) {
            let name = format!("a window of {id}");
            known.warning([(&*name, seconds)]).iter().for_each(|warning| warn(warning));
        }
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Hands each line on as it comes, until there are no more or `each` says `false`.
    fn predict<'i>(
        &self,
        input: &'i Input,
        each: &mut dyn FnMut(Line<'i>) -> Result<bool, Failure>,
    ) -> Result<(), Failure> {
        let path = path_of(input);
        let record = |span, windows, status: Status, found: Option<Decision>| {
            let (class, proba) = found.map_or((None, None), |(c, p)| (Some(c), p));
            let labels = input.labels.iter().map(|(_, value)| value.as_str()).collect();
            Record { id: &input.id, path, span, windows, status, labels, class, proba }
        };
        let failed = |span, error: SignalError| Line {
            record: record(span, 0, error.status, None),
            reason: Some(error.reason),
        };
        let opened = Windows::open(input, &self.signals, self.windowing, self.stop);
        let mut windows = match opened {
            Ok(windows) => windows,
            Err(_) if self.stopped() => return Ok(()),
            Err(error) => return each(failed(None, error)).map(|_| ()),
        };
        let (rate, channels) = windows.format();
        if let Err(reason) = self.formats.check(Some(rate), Some(channels)) {
            let error = SignalError { status: Status::Mismatch, reason };
            return each(failed(None, error)).map(|_| ());
        }
        let mut votes = WindowVotes::new(self.model.header().labels.len());
        let mut trouble: Option<SignalError> = None;
        let mut failures = 0;
        for window in &mut windows {
            if self.stopped() {
                break;
            }
            let (span, status, features) = match window {
                Ok(window) => {
                    self.check_length(&input.id, window.end - window.start);
                    let whole = window.loss.is_none();
                    let status = if whole { Status::Ok } else { Status::Truncated };
                    (Some((window.start, window.end)), status, window.features)
                }
                Err(error) => (None, error.status, Err(error)),
            };
            match (features.and_then(|f| self.row(f)), self.vote) {
                (Err(error), Some(_)) => {
                    failures += 1;
                    trouble.get_or_insert(error);
                }
                (Err(error), None) => {
                    if !each(failed(span, error))? {
                        return Ok(());
                    }
                }
                (Ok(row), vote) => {
                    let (class, proba) = self.classify(&row)?;
                    if vote.is_some() {
                        votes.add(class, proba.as_deref())?;
                        continue;
                    }
                    let record = record(span, 1, status, Some((class, proba)));
                    if !each(Line { record, reason: None })? {
                        return Ok(());
                    }
                }
            }
        }
        let loss = windows.loss();
        if let Some(loss) = &loss {
            warn(&format!("{}: truncated: {loss}", input.id));
        }
        let Some(rule) = self.vote.filter(|_| !self.stopped()) else { return Ok(()) };
        let found = match (rule.decide(&votes)?, trouble) {
            (None, Some(error)) => failed(None, error),
            (decision, Some(error)) => {
                let windows = if failures == 1 { "window" } else { "windows" };
                let reason = format!("{failures} {windows} failed, the first: {}", error.reason);
                let record = record(None, votes.windows(), error.status, decision);
                Line { record, reason: Some(reason) }
            }
            (decision, None) => {
                let status = if loss.is_some() { Status::Truncated } else { Status::Ok };
                Line { record: record(None, votes.windows(), status, decision), reason: None }
            }
        };
        each(found).map(|_| ())
    }

    /// The row that the model takes.
    fn row(&self, features: Features) -> Result<Vec<f64>, SignalError> {
        let refuse = |status, reason| Err(SignalError { status, reason });
        let row = match features {
            Features::Summary(row) => row,
            Features::Frames(_) => {
                let reason = "the model's configuration has no [summary]".into();
                return refuse(Status::Mismatch, reason);
            }
        };
        let known = self.model.n_features();
        if row.len() != known {
            let reason = format!(
                "gives {} features; the model was trained on {known}, from recordings with \
                 another number of channels",
                row.len()
            );
            return refuse(Status::Mismatch, reason);
        }
        if let Some(value) = row.iter().find(|v| !v.is_finite()) {
            return refuse(Status::NonFinite, format!("a feature is {value}"));
        }
        Ok(row.into_iter().map(f64::from).collect())
    }

    fn classify(&self, row: &[f64]) -> Result<Decision, Failure> {
        let x = ArrayView2::from_shape((1, row.len()), row)?;
        let predicted: corsmal_models::Result<Predicted> = Predict::predict(self.model, &x);
        let Predicted { classes, proba } = predicted?;
        Ok((classes[0], proba.map(|proba| proba.row(0).to_vec())))
    }
}
