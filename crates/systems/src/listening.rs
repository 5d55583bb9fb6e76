//! Classes of recordings by a trained network, from all of a recording or window by window.

use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use corsmal_extract::config::{Config, ConfigError};
use corsmal_extract::engine::{Signals, Windowing, Windows};
use corsmal_extract::inputs::Input;
use corsmal_extract::run::Recordings;
use corsmal_files::outcome::Status;
use corsmal_models::argmax;
use corsmal_models::fusion::WindowVotes;
use corsmal_models::model_file::{FormatRule, Lengths, TrainedOn};
use corsmal_models::voting::{Decision, VotingRule};
use corsmal_nets::NetError;
use corsmal_nets::front_end::{FrontEnd, Tensor};
use corsmal_nets::items::{Column, Items};
use corsmal_nets::model::NetModel;
use corsmal_nets::networks;

use crate::error::{Result, SystemError};
use crate::recordings;

/// Which recordings a network is applied to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Formats {
    /// Those of the sample rates and channels that it was trained on, where these matter.
    AsTrained,
    /// All.
    Any,
}

/// What a network says of a recording, or of a window of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// start and end of the window in seconds; `None` for all of the recording
    pub span: Option<(f64, f64)>,
    /// windows that were decided from
    pub windows: usize,
    /// as in the outcomes of an extraction
    pub status: Status,
    /// class and probabilities; `None` where the reason says why
    pub decision: Option<Decision>,
    /// why there is no decision, or one from a part of the windows only
    pub reason: Option<String>,
    /// the length in seconds of the recording, or its first window, that is far from those trained on
    pub unlike: Option<f64>,
    /// names of the repairs that its reader made; of a stream they are not known
    pub repairs: Vec<String>,
}

impl Answer {
    fn of(
        span: Option<(f64, f64)>,
        windows: usize,
        status: Status,
        decision: Option<Decision>,
    ) -> Self {
        Self { span, windows, status, decision, reason: None, unlike: None, repairs: Vec::new() }
    }

    fn none(span: Option<(f64, f64)>, trouble: Trouble) -> Self {
        let Trouble { status, reason } = trouble;
        Self { reason: Some(reason), ..Self::of(span, 0, status, None) }
    }
}

/// Why a recording, or a window of it, has no decision.
struct Trouble {
    status: Status,
    reason: String,
}

/// Probabilities of a stretch of sound, and the frames that it covers where a network takes
/// windows.
type Heard = (Option<Range<usize>>, Vec<f64>);

/// A trained network that hears recordings.
pub struct Listener<'a> {
    model: &'a NetModel,
    front_end: FrontEnd,
    config: Arc<Config>,
    formats: FormatRule,
    /// of the recordings trained on, where the network hears them as a whole
    lengths: Option<Lengths>,
    jobs: usize,
    pool: rayon::ThreadPool,
    losses: Mutex<Vec<(String, String)>>,
}

impl<'a> Listener<'a> {
    /// A network with the features that it was trained on; `changes` of `signal` bring recordings to
    /// their format. It works with `jobs` threads.
    ///
    /// # Errors
    /// A network that cannot make its inputs from recordings; changes that it does not take.
    pub fn new(
        model: &'a NetModel,
        changes: &[String],
        formats: Formats,
        jobs: usize,
    ) -> Result<Self> {
        let header = &model.header;
        let front_end = recordings::front_end(networks::named(&header.network)?)?;
        let own = &header.feature_config;
        if own.is_null() {
            return Err(SystemError::TrainedOnInputs { network: header.network.clone() });
        }
        let config = Config::from_tree(own.clone(), changes)?;
        let rate = own["signal"]["sample_rate"].as_f64().filter(|rate| *rate > 0.0);
        if let Some(rate) = rate.filter(|rate| *rate != config.signal.sample_rate)
            && front_end.windows.is_some()
        {
            let message = format!("must be {rate} as in training: windows have a fixed duration");
            return Err(ConfigError::key("signal.sample_rate", message).into());
        }
        let trained: Option<TrainedOn> =
            serde_json::from_value(header.provenance["trained_on"].clone())
                .map_err(|reason| SystemError::TrainedOn { reason })?;
        let hears_short = front_end.windows.is_none_or(|windows| windows.fill.is_some());
        let lengths = trained.as_ref().and_then(|trained| trained.seconds).filter(|_| hears_short);
        let formats = match trained.filter(|_| formats == Formats::AsTrained) {
            Some(trained) => trained.rule(own, &config.to_value())?.of_fixed_features(),
            None => FormatRule::default(),
        };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build()?;
        let (config, losses) = (Arc::new(config), Mutex::default());
        Ok(Self { model, front_end, config, formats, lengths, jobs, pool, losses })
    }

    /// Whether a recording of this length is far from those trained on: for a network that takes windows, so much
    /// shorter that most of a window is filled up.
    fn is_unlike(&self, seconds: f64) -> bool {
        let is_short = |lengths: Lengths| {
            self.front_end.windows.is_none_or(|windows| {
                2.0 * seconds < windows.seconds(windows.frames).min(lengths.shortest)
            })
        };
        self.lengths.is_some_and(|lengths| lengths.differ_from(seconds) && is_short(lengths))
    }

    /// That recordings are far from those trained on, given by name and [`Answer::unlike`], in words.
    pub fn length_warning(&self, given: &[(String, f64)]) -> Option<String> {
        self.lengths?.warning(given.iter().map(|(name, seconds)| (name.as_str(), *seconds)))
    }

    /// The ids of recordings that were heard in windows and lack samples, and why.
    pub fn losses(&self) -> Vec<(String, String)> {
        self.losses.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Whether the network takes windows of a recording one by one.
    pub fn takes_windows(&self) -> bool {
        self.front_end.windows.is_some()
    }

    /// Hears each recording as a whole. A network that takes windows gives a answer for each of them,
    /// or with `vote` one of all. `each` is told them in the order of the recordings, and ends the work
    /// by returning false. False where `stop` ended it.
    ///
    /// # Errors
    /// A fault of the network; an error of `each`.
    pub fn recordings<E: From<SystemError>>(
        &self,
        inputs: &[Input],
        vote: Option<VotingRule>,
        stop: &Arc<AtomicBool>,
        each: &mut dyn FnMut(&Input, Answer) -> std::result::Result<bool, E>,
    ) -> std::result::Result<bool, E> {
        let engine = Recordings::new(self.config.clone());
        let recordings = engine.in_order(inputs, self.jobs, stop).map_err(SystemError::from)?;
        for recorded in recordings {
            let recorded = match recorded.map_err(SystemError::from) {
                Err(SystemError::Interrupted) => return Ok(false),
                recorded => recorded?,
            };
            if stop.load(Ordering::Relaxed) {
                return Ok(false);
            }
            let (input, outcome) = (recorded.input, recorded.outcome);
            let fits = self.check(outcome.sample_rate, outcome.channels);
            let seconds = outcome.seconds();
            let heard = match (recorded.features.map(recordings::tensor), fits) {
                (None, _) => Err(Trouble { status: outcome.status, reason: outcome.reason }),
                (Some(_), Err(trouble)) => Err(trouble),
                (Some(Err(reason)), _) => Err(Trouble { status: Status::Io, reason }),
                (Some(Ok(tensor)), Ok(())) => self.hear(tensor)?,
            };
            let unlike = seconds.filter(|seconds| self.is_unlike(*seconds));
            let answer = |span, windows, decision| Answer {
                unlike,
                ..Answer::of(span, windows, outcome.status, decision)
            };
            let verdicts = match (heard, vote) {
                (Err(trouble), _) => vec![Answer::none(None, trouble)],
                (Ok(heard), Some(rule)) => {
                    let votes = self.votes(&heard)?;
                    let decision = rule.decide(&votes).map_err(SystemError::from)?;
                    vec![answer(None, votes.windows(), decision)]
                }
                (Ok(heard), None) => {
                    let start = input.start.unwrap_or(0.0);
                    let windows = self.front_end.windows;
                    let second = |frame: usize| start + windows.map_or(0.0, |w| w.seconds(frame));
                    // A window may be filled up after the end.
                    let end = seconds.map_or(f64::INFINITY, |seconds| start + seconds);
                    let one = |(frames, proba): Heard| {
                        let span = frames.map(|f| (second(f.start), second(f.end).min(end)));
                        answer(span, usize::from(span.is_some()), Some(decided(proba)))
                    };
                    heard.into_iter().map(one).collect()
                }
            };
            let mut repairs = outcome.repairs;
            for answer in verdicts {
                // With the first answer of the recording.
                let answer = Answer { repairs: std::mem::take(&mut repairs), ..answer };
                if !each(input, answer)? {
                    return Ok(true);
                }
            }
        }
        Ok(true)
    }

    /// Hears windows of recordings or of a stream, each as soon as it is complete. With `vote` there is
    /// one answer for each recording, from all of its windows. False where `stop` ended it.
    ///
    /// # Errors
    /// As [`Self::recordings`].
    pub fn windows<E: From<SystemError>>(
        &self,
        inputs: &[Input],
        (windowing, vote): (Windowing, Option<VotingRule>),
        stop: &Arc<AtomicBool>,
        each: &mut dyn FnMut(&Input, Answer) -> std::result::Result<bool, E>,
    ) -> std::result::Result<bool, E> {
        let signals = Signals::new(self.config.clone());
        let stopped = || stop.load(Ordering::Relaxed);
        for input in inputs {
            let opened = Windows::open(input, &signals, windowing, stop);
            if stopped() {
                return Ok(false);
            }
            let opened = opened
                .map_err(|e| Trouble { status: e.status, reason: e.reason })
                .and_then(|windows| {
                    let (rate, channels) = windows.format();
                    self.check(Some(rate), Some(channels)).map(|()| windows)
                });
            let mut windows = match opened {
                Ok(windows) => windows,
                Err(trouble) => match each(input, Answer::none(None, trouble))? {
                    true => continue,
                    false => return Ok(true),
                },
            };
            let mut votes = WindowVotes::new(self.model.header.labels.len());
            let (mut trouble, mut failures) = (None, 0);
            // Of a recording, the first window that is far from the recordings trained on.
            let mut unlike = None;
            for window in &mut windows {
                if stopped() {
                    break;
                }
                let (span, loss, features) = match window {
                    Ok(window) => (Some((window.start, window.end)), window.loss, window.features),
                    Err(e) => (None, None, Err(e)),
                };
                let status = if loss.is_some() { Status::Truncated } else { Status::Ok };
                let seconds = span.map(|(start, end)| end - start).filter(|_| unlike.is_none());
                let first = seconds.filter(|s| self.takes_windows() && self.is_unlike(*s));
                unlike = unlike.or(first);
                let heard = match features.map(recordings::tensor) {
                    Err(e) => Err(Trouble { status: e.status, reason: e.reason }),
                    Ok(Err(reason)) => Err(Trouble { status: Status::Io, reason }),
                    Ok(Ok(tensor)) => self.hear(tensor)?,
                };
                let answer = match (heard, vote) {
                    (Err(found), Some(_)) => {
                        failures += 1;
                        trouble.get_or_insert(found);
                        continue;
                    }
                    (Ok(heard), Some(_)) => {
                        // As without a vote: of what the network hears in a window, the mean.
                        if let Some(proba) = self.votes(&heard)?.mean() {
                            votes.add(argmax(&proba), Some(&proba)).map_err(SystemError::from)?;
                        }
                        continue;
                    }
                    (Err(trouble), None) => Answer::none(span, trouble),
                    (Ok(heard), None) => {
                        let mean = self.votes(&heard)?.mean();
                        let decision = mean.map(decided);
                        Answer { unlike: first, ..Answer::of(span, heard.len(), status, decision) }
                    }
                };
                if !each(input, answer)? {
                    return Ok(true);
                }
            }
            let loss = windows.loss();
            let is_truncated = loss.is_some();
            let mut losses = self.losses.lock().unwrap_or_else(PoisonError::into_inner);
            losses.extend(loss.map(|loss| (input.id.clone(), loss)));
            drop(losses);
            if stopped() {
                return Ok(false);
            }
            let Some(rule) = vote else { continue };
            let decision = rule.decide(&votes).map_err(SystemError::from)?;
            let answer = match (decision, trouble) {
                (None, Some(trouble)) => Answer::none(None, trouble),
                (decision, trouble) => {
                    let status = match &trouble {
                        Some(trouble) => trouble.status,
                        None if is_truncated => Status::Truncated,
                        None => Status::Ok,
                    };
                    let reason = trouble.map(|trouble| {
                        let windows = if failures == 1 { "window" } else { "windows" };
                        format!("{failures} {windows} failed, the first: {}", trouble.reason)
                    });
                    Answer { reason, unlike, ..Answer::of(None, votes.windows(), status, decision) }
                }
            };
            if !each(input, answer)? {
                return Ok(true);
            }
        }
        Ok(true)
    }

    /// Refuses a recording of a format that the network was not trained on.
    fn check(&self, rate: Option<u32>, channels: Option<u32>) -> std::result::Result<(), Trouble> {
        let refused = self.formats.check(rate, channels);
        refused.map_err(|reason| Trouble { status: Status::Mismatch, reason })
    }

    /// Probabilities of each window that the network takes of a stretch of sound, or of all of it.
    fn hear(&self, tensor: Tensor) -> Result<std::result::Result<Vec<Heard>, Trouble>> {
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

    fn votes(&self, heard: &[Heard]) -> Result<WindowVotes> {
        let mut votes = WindowVotes::new(self.model.header.labels.len());
        for (_, proba) in heard {
            votes.add(argmax(proba), Some(proba))?;
        }
        Ok(votes)
    }
}

/// The answer on a recording that a network cannot take; `None` where the recording is not at fault.
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
    (argmax(&proba), Some(proba))
}
