//! Predictions of a trained network: from recordings through its front end, or from its inputs.

use std::ops::Range;
use std::sync::Arc;

use corsmal_ccm::CcmError;
use corsmal_extract::config::Config;
use corsmal_extract::engine::{Signals, Windowing, Windows};
use corsmal_extract::inputs::Input;
use corsmal_files::outcome::Status;
use corsmal_models::fusion::WindowVotes;
use corsmal_models::labels::Labels;
use corsmal_models::model_file::TrainedOn;
use corsmal_models::predictions::{Record, Unit};
use corsmal_models::voting::{Decision, VotingRule};
use corsmal_nets::NetError;
use corsmal_nets::dataset::Dataset;
use corsmal_nets::fit;
use corsmal_nets::front_end::{FrontEnd, Tensor};
use corsmal_nets::items::{Column, Items};
use corsmal_nets::model::NetModel;
use corsmal_nets::networks;
use corsmal_systems::recordings;

use super::args::{Args, changed, recordings as named};
use super::records::{End, Records, delivered, path_of};
use crate::failure::Failure;
use crate::networks::front_end;

/// Seconds from one frame of a windowed network to the next.
const FRAME: f64 = 0.01;

/// Predicts.
pub fn run(args: &Args, model: &NetModel) -> Result<(End, Option<Records>), Failure> {
    let labels = Labels::new(model.header.labels.clone())?;
    let vote = args.vote.rule(&labels)?;
    if let Some(path) = &args.features {
        if vote.is_some() {
            return Err(Failure::new("--vote works on windows of recordings, not on --features"));
        }
        let names = args.members.names();
        let ids = names.ids.as_deref();
        let data = Dataset::read_members(path, &model.network, &names.x, ids)?;
        return of_inputs(args, model, &labels, &data);
    }
    args.members.refuse()?;
    let listener = Listener::new(args, model, vote)?;
    let windowed = args.window.is_some() || listener.front_end.windows.is_some();
    let unit = match (windowed, vote) {
        (false, Some(_)) => {
            return Err(Failure::new("--vote needs --window"));
        }
        (false, None) => Unit::Recording,
        (true, None) => Unit::Window,
        (true, Some(_)) => Unit::Vote,
    };
    let found = named(args)?;
    let columns: Vec<String> =
        found.iter().take(1).flat_map(|f| &f.labels).map(|(column, _)| column.clone()).collect();
    let mut records = args.records(&labels, &model.header.target, unit, &columns)?;
    let end = match args.window {
        None => listener.whole(&found, &mut records)?,
        Some(window) => listener.windows(window, &found, &mut records)?,
    };
    let nothing = matches!(end, End::Interrupted) && records.written == 0;
    Ok((end, (!nothing).then_some(records)))
}

/// Predicts the items of a file of the network's inputs.
fn of_inputs(
    args: &Args,
    model: &NetModel,
    labels: &Labels,
    data: &Dataset,
) -> Result<(End, Option<Records>), Failure> {
    let proba = args.jobs.pool()?.install(|| model.predict_proba(&data.items))?;
    let columns: Vec<String> = data.columns.iter().map(|(name, _)| name.clone()).collect();
    let mut records = args.records(labels, &model.header.target, Unit::Recording, &columns)?;
    for (row, (class, proba)) in fit::labels(&proba).into_iter().zip(&proba).enumerate() {
        let record = Record {
            id: &data.ids[row],
            path: "",
            span: None,
            windows: 0,
            status: Status::Ok,
            labels: data.columns.iter().map(|(_, values)| values[row].as_str()).collect(),
            class: Some(class),
            proba: Some(proba.clone()),
        };
        if !delivered(records.write(&record))? {
            return Ok((End::Unread, Some(records)));
        }
    }
    Ok((End::Done, Some(records)))
}

/// Why a recording, or a window of it, has no prediction.
struct Trouble {
    status: Status,
    reason: String,
}

/// Probabilities of a stretch of sound, and the frames that it covers where a network takes
/// windows.
type Heard = (Option<Range<usize>>, Vec<f64>);

/// A network that hears recordings.
struct Listener<'a> {
    args: &'a Args,
    model: &'a NetModel,
    front_end: FrontEnd,
    config: Arc<Config>,
    /// the formats that recordings may have, where they matter to the features
    rates: Option<Vec<u32>>,
    channels: Option<Vec<u32>>,
    vote: Option<VotingRule>,
    pool: rayon::ThreadPool,
}

impl<'a> Listener<'a> {
    fn new(args: &'a Args, model: &'a NetModel, vote: Option<VotingRule>) -> Result<Self, Failure> {
        let place = args.model.display();
        let header = &model.header;
        let front_end = front_end(networks::named(&header.network)?)?;
        if header.feature_config.is_null() {
            return Err(Failure::new(format!(
                "{place}: {} was trained on inputs that came from a file, and cannot make them from \
                 recordings; give --features, or train it on recordings",
                header.network
            )));
        }
        let config = changed(args, &header.feature_config)?;
        let tree = config.to_value();
        let trained: Option<TrainedOn> =
            serde_json::from_value(header.provenance["trained_on"].clone()).unwrap_or_default();
        let own_rate = tree["signal"]["sample_rate"].as_f64() == Some(0.0);
        let every_channel = tree["signal"]["channels"] == "all";
        let trained = trained.filter(|_| !args.any_rate);
        let rates = trained.as_ref().filter(|_| own_rate).map(|t| t.sample_rates.clone());
        let channels = trained.filter(|_| every_channel).map(|t| t.channels);
        let pool = args.jobs.pool()?;
        Ok(Self { args, model, front_end, config, rates, channels, vote, pool })
    }

    /// Refuses a recording of a format that the network was not trained on.
    fn check(&self, rate: Option<u32>, channels: Option<u32>) -> Result<(), Trouble> {
        let all = |known: &[u32]| known.iter().map(u32::to_string).collect::<Vec<_>>().join(", ");
        let known = [
            (
                rate,
                &self.rates,
                "Hz",
                "--set signal.sample_rate resamples them, --any-rate takes them",
            ),
            (channels, &self.channels, "channels", "the network takes each of them"),
        ];
        for (found, known, unit, way) in known {
            if let (Some(found), Some(known)) = (found, known)
                && !known.contains(&found)
            {
                let reason = format!("{found} {unit}, trained on {} {unit}; {way}", all(known));
                return Err(Trouble { status: Status::Mismatch, reason });
            }
        }
        Ok(())
    }

    /// Probabilities of each window of a stretch of sound, or of all of it.
    fn hear(&self, tensor: Tensor) -> Result<Result<Vec<Heard>, Trouble>, Failure> {
        let items = self.front_end.items(&self.model.network, tensor);
        let found: corsmal_nets::Result<Vec<Heard>> = items.and_then(|items| {
            let column = Column::of(items.iter().map(|item| item.values.as_slice()));
            let columns = vec![column];
            let proba = self.pool.install(|| self.model.predict_proba(&Items { columns }))?;
            Ok(items.into_iter().map(|item| item.frames).zip(proba).collect())
        });
        match found {
            Ok(heard) => Ok(Ok(heard)),
            Err(error) => match status_of(&error) {
                Some(status) => Ok(Err(Trouble { status, reason: error.to_string() })),
                None => Err(error.into()),
            },
        }
    }

    /// Writes a line; `false` where nobody reads any more.
    fn write(
        &self,
        records: &mut Records,
        input: &Input,
        span: Option<(f64, f64)>,
        found: Result<(Status, usize, Option<Decision>), Trouble>,
    ) -> Result<bool, Failure> {
        let (status, windows, decision) = match found {
            Ok(found) => found,
            Err(Trouble { status, reason }) => {
                if !self.args.quiet {
                    eprintln!("{}: {}: {reason}", input.id, status.name());
                }
                (status, 0, None)
            }
        };
        let (class, proba) = decision.map_or((None, None), |(c, p)| (Some(c), p));
        let labels = input.labels.iter().map(|(_, value)| value.as_str()).collect();
        let (id, path) = (&input.id, path_of(input));
        delivered(records.write(&Record { id, path, span, windows, status, labels, class, proba }))
    }

    /// Recordings as a whole: windows are those that the network takes.
    fn whole(&self, found: &[Input], records: &mut Records) -> Result<End, Failure> {
        let (jobs, stop) = (self.args.jobs.count(), crate::interrupt::flag());
        let mut kept = match recordings::temporary(found, &self.config, jobs, stop) {
            Err(CcmError::Interrupted) => return Ok(End::Interrupted),
            kept => kept?,
        };
        let outcomes = std::mem::take(&mut kept.outcomes);
        for (input, outcome) in found.iter().zip(outcomes) {
            if stop.load(std::sync::atomic::Ordering::Relaxed) {
                return Ok(End::Interrupted);
            }
            let fits = self.check(outcome.sample_rate, outcome.channels);
            let heard = match (outcome.status.has_features(), fits) {
                (false, _) => Err(Trouble { status: outcome.status, reason: outcome.reason }),
                (true, Err(trouble)) => Err(trouble),
                (true, Ok(())) => self.hear(kept.tensor(&input.id)?)?,
            };
            let goes_on = match (heard, self.vote) {
                (Err(trouble), _) => self.write(records, input, None, Err(trouble))?,
                (Ok(heard), Some(rule)) => {
                    let votes = self.votes(&heard)?;
                    let decision = rule.decide(&votes)?;
                    let found = (outcome.status, votes.windows(), decision);
                    self.write(records, input, None, Ok(found))?
                }
                (Ok(heard), None) => {
                    let mut goes_on = true;
                    for (frames, proba) in heard {
                        let start = input.start.unwrap_or(0.0);
                        let second = |frame: usize| start + frame as f64 * FRAME;
                        let span = frames.map(|f| (second(f.start), second(f.end)));
                        let windows = usize::from(span.is_some());
                        let found = (outcome.status, windows, Some(decided(proba)));
                        goes_on = goes_on && self.write(records, input, span, Ok(found))?;
                    }
                    goes_on
                }
            };
            if !goes_on {
                return Ok(End::Unread);
            }
        }
        Ok(End::Done)
    }

    fn votes(&self, heard: &[Heard]) -> Result<WindowVotes, Failure> {
        let mut votes = WindowVotes::new(self.model.header.labels.len());
        for (_, proba) in heard {
            votes.add(decided(proba.clone()).0, Some(proba))?;
        }
        Ok(votes)
    }

    /// Windows of so many seconds, as they come.
    fn windows(&self, window: f64, found: &[Input], records: &mut Records) -> Result<End, Failure> {
        let hop = self.args.hop.unwrap_or(window / 2.0);
        let windowing = Windowing::new(window, hop).ok_or_else(|| {
            Failure::new(format!("--window {window} --hop {hop}: each must be 0.01 to 600 seconds"))
        })?;
        if self.front_end.windows.is_none() && !self.args.quiet {
            eprintln!(
                "warning: {} was trained on whole recordings: it may do worse on windows of {window} s",
                self.model.header.network
            );
        }
        let (signals, stop) = (Signals::new(self.config.clone()), crate::interrupt::flag());
        let stopped = || stop.load(std::sync::atomic::Ordering::Relaxed);
        for input in found {
            let mut windows = match Windows::open(input, &signals, windowing, stop) {
                Ok(windows) => windows,
                Err(_) if stopped() => return Ok(End::Interrupted),
                Err(e) => {
                    if !self.write(records, input, None, refuse(e.status, e.reason))? {
                        return Ok(End::Unread);
                    }
                    continue;
                }
            };
            let (rate, channels) = windows.format();
            if let Err(trouble) = self.check(Some(rate), Some(channels)) {
                if !self.write(records, input, None, Err(trouble))? {
                    return Ok(End::Unread);
                }
                continue;
            }
            let mut all: Vec<Heard> = Vec::new();
            let mut trouble = None;
            for window in &mut windows {
                if stopped() {
                    return Ok(End::Interrupted);
                }
                let (span, features) = match window {
                    Ok(window) => (Some((window.start, window.end)), window.features),
                    Err(e) => (None, Err(e)),
                };
                let heard = match features {
                    Err(e) => refuse(e.status, e.reason),
                    Ok(features) => match recordings::tensor(features) {
                        Err(reason) => refuse(Status::Io, reason),
                        Ok(tensor) => self.hear(tensor)?,
                    },
                };
                match (heard, self.vote) {
                    (Err(e), Some(_)) => trouble = trouble.or(Some(e)),
                    (Err(e), None) => {
                        if !self.write(records, input, span, Err(e))? {
                            return Ok(End::Unread);
                        }
                    }
                    (Ok(heard), Some(_)) => all.extend(heard),
                    (Ok(heard), None) => {
                        let found = (Status::Ok, heard.len(), Some(decided(mean(&heard))));
                        if !self.write(records, input, span, Ok(found))? {
                            return Ok(End::Unread);
                        }
                    }
                }
            }
            let Some(rule) = self.vote.filter(|_| !stopped()) else { continue };
            let votes = self.votes(&all)?;
            let found = match (rule.decide(&votes)?, trouble) {
                (None, Some(trouble)) => Err(trouble),
                (decision, trouble) => {
                    let status = match (trouble, windows.is_truncated()) {
                        (Some(trouble), _) => trouble.status,
                        (None, true) => Status::Truncated,
                        (None, false) => Status::Ok,
                    };
                    Ok((status, votes.windows(), decision))
                }
            };
            if !self.write(records, input, None, found)? {
                return Ok(End::Unread);
            }
        }
        Ok(if stopped() { End::Interrupted } else { End::Done })
    }
}

fn refuse<T>(status: Status, reason: String) -> Result<T, Trouble> {
    Err(Trouble { status, reason })
}

/// The verdict on a recording that a network cannot take; `None` where the recording is not at fault.
fn status_of(error: &NetError) -> Option<Status> {
    match error {
        NetError::TooShort { .. } => Some(Status::TooShort),
        NetError::InputShape { .. } => Some(Status::Mismatch),
        NetError::NonFinite { .. } | NetError::Output { .. } => Some(Status::NonFinite),
        _ => None,
    }
}

/// The most probable class and the probabilities.
fn decided(proba: Vec<f64>) -> Decision {
    let class = fit::labels(std::slice::from_ref(&proba))[0];
    (class, Some(proba))
}

/// Mean probabilities of the windows that a network takes in a longer one.
fn mean(heard: &[Heard]) -> Vec<f64> {
    let classes = heard.first().map_or(0, |(_, proba)| proba.len());
    let of = |class: usize| heard.iter().map(|(_, p)| p[class]).sum::<f64>() / heard.len() as f64;
    (0..classes).map(of).collect()
}
