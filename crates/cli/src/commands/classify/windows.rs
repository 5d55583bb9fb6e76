//! A prediction for each window of a recording or of an endless stream, or one from all of them.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_extract::engine::{Features, SignalError, Signals, Windowing, Windows};
use corsmal_extract::inputs::Input;
use corsmal_files::outcome::Status;
use corsmal_models::ModelError;
use corsmal_models::fusion::WindowVotes;
use corsmal_models::model_file::Model;
use ndarray::ArrayView2;
use rayon::prelude::*;

use super::{Args, End, configuration, delivered, recordings};
use crate::failure::Failure;
use crate::prediction_lines::{Line, PredictionLines};
use crate::voting::Rule;

/// Recordings of each worker whose lines wait to be written in order.
const AHEAD: usize = 4;

/// Predicts window by window.
pub fn run(
    args: &Args,
    model: &Model,
    window: f64,
    vote: Option<Rule>,
    lines: &mut PredictionLines<'_>,
) -> Result<End, Failure> {
    let hop = args.hop.unwrap_or(window / 2.0);
    let windowing = Windowing::new(window, hop).ok_or_else(|| {
        Failure::new(format!("--window {window} --hop {hop}: 0.01 to 600 seconds are possible"))
    })?;
    let signals = Signals::new(configuration(args, model)?);
    let found = recordings(args)?;
    let predictor = Predictor { model, signals, windowing, vote, stop: crate::interrupt::flag() };
    let mut write = |found: Found<'_>| {
        if let Some(reason) = found.reason.filter(|_| !args.quiet) {
            eprintln!("{}: {}: {reason}", found.line.id, found.line.status.name());
        }
        delivered(lines.write(&found.line))
    };
    if let [only] = found.as_slice() {
        // A stream may never end: what is predicted is written at once.
        let mut unread = false;
        predictor.predict(only, &mut |line| {
            unread = !write(line)?;
            Ok(!unread)
        })?;
        return Ok(if unread { End::Unread } else { predictor.end() });
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(args.jobs()).build()?;
    for part in found.chunks(AHEAD * args.jobs()) {
        let predicted: Vec<Result<Vec<Found<'_>>, Failure>> = pool.install(|| {
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
struct Found<'a> {
    line: Line<'a>,
    reason: Option<String>,
}

struct Predictor<'a> {
    model: &'a Model,
    signals: Signals,
    windowing: Windowing,
    vote: Option<Rule>,
    stop: &'static Arc<AtomicBool>,
}

/// Class and probabilities.
type Prediction = (usize, Option<Vec<f64>>);

impl Predictor<'_> {
    fn end(&self) -> End {
        if self.stopped() { End::Interrupted } else { End::Done }
    }

    fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// Hands each line on as it comes, until there are no more or `each` says `false`.
    fn predict<'i>(
        &self,
        input: &'i Input,
        each: &mut dyn FnMut(Found<'i>) -> Result<bool, Failure>,
    ) -> Result<(), Failure> {
        let path = Self::path(input);
        let line = |span, windows, status: Status, found: Option<Prediction>| {
            let (class, proba) = found.map_or((None, None), |(c, p)| (Some(c), p));
            Line { id: &input.id, path, span, windows, status, class, proba }
        };
        let failed = |span, error: SignalError| Found {
            line: line(span, 0, error.status, None),
            reason: Some(error.reason),
        };
        let opened = Windows::open(input, &self.signals, self.windowing, self.stop);
        let mut windows = match opened {
            Ok(windows) => windows,
            Err(_) if self.stopped() => return Ok(()),
            Err(error) => return each(failed(None, error)).map(|_| ()),
        };
        let mut votes = WindowVotes::new(self.model.header().labels.len());
        let mut trouble: Option<SignalError> = None;
        let mut failures = 0;
        for window in &mut windows {
            if self.stopped() {
                return Ok(());
            }
            let (span, features) = match window {
                Ok(window) => (Some((window.start, window.end)), window.features),
                Err(error) => (None, Err(error)),
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
                    let line = line(span, 1, Status::Ok, Some((class, proba)));
                    if !each(Found { line, reason: None })? {
                        return Ok(());
                    }
                }
            }
        }
        let Some(rule) = self.vote.filter(|_| !self.stopped()) else { return Ok(()) };
        let found = match (rule.decide(&votes)?, trouble) {
            (None, Some(error)) => failed(None, error),
            (decision, Some(error)) => {
                let reason = format!("{failures} windows failed, the first: {}", error.reason);
                let line = line(None, votes.windows(), error.status, decision);
                Found { line, reason: Some(reason) }
            }
            (decision, None) => {
                let truncated = windows.is_truncated();
                let status = if truncated { Status::Truncated } else { Status::Ok };
                Found { line: line(None, votes.windows(), status, decision), reason: None }
            }
        };
        each(found).map(|_| ())
    }

    fn path(input: &Input) -> &str {
        match &input.source {
            corsmal_extract::inputs::InputSource::File(path) => path.to_str().unwrap_or(&input.id),
            corsmal_extract::inputs::InputSource::Stdin => "-",
        }
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
                "{} features, the model was trained on {known}: another number of channels?",
                row.len()
            );
            return refuse(Status::Mismatch, reason);
        }
        if let Some(value) = row.iter().find(|v| !v.is_finite()) {
            return refuse(Status::NonFinite, format!("a feature is {value}"));
        }
        Ok(row.into_iter().map(f64::from).collect())
    }

    fn classify(&self, row: &[f64]) -> Result<Prediction, Failure> {
        let x = ArrayView2::from_shape((1, row.len()), row)?;
        let class = self.model.predict(x)?[0];
        match self.model.predict_proba(x) {
            Ok(proba) => Ok((class, Some(proba.row(0).to_vec()))),
            Err(ModelError::NoProbability { .. }) => Ok((class, None)),
            Err(e) => Err(e.into()),
        }
    }
}
