//! Recordings a few at a time, outside a run: for engines that decide themselves what is computed where
//! and when. Same features and outcomes as in a run.

use std::collections::VecDeque;
use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_audio::{AudioSpec, SampleEncoding};
use corsmal_files::outcome::{Outcome, Status};
use rayon::prelude::*;

use super::check::require_jobs;
use super::error::RunError;
use super::output::other_width;
use super::work::{self, broken, outcome_of};
use crate::config::Config;
use crate::engine::{Decoders, Failed, FeatureArray, Features, Plan, Planned, Plans, Watch};
use crate::inputs::Input;
use crate::survey::Survey;

/// Where a configuration does not say: a rate and channels that most features can be planned for.
const USUAL_RATE: f64 = 44_100.0;
const USUAL_CHANNELS: [u16; 5] = [1, 2, 4, 8, 64];

/// Recordings of each thread whose features are held in memory until they are asked for.
const AHEAD: usize = 2;

/// Computes recordings by one configuration; transforms and filter banks are made once per sample rate
/// and number of channels.
pub struct Recordings {
    config: Arc<Config>,
    plans: Plans<'static>,
    folder: PathBuf,
}

/// What recordings gave, in their order.
#[derive(Default)]
pub struct Batch {
    /// One for each recording.
    pub outcomes: Vec<Outcome>,
    /// Names of the summary's columns; empty without a summary.
    pub names: Vec<String>,
    /// Summary rows of the recordings that have features, one after the other.
    pub values: Vec<f32>,
    /// Plan and frames of each recording; `None` with a summary, and where there are no features.
    pub frames: Vec<Option<(Arc<Plan>, Vec<FeatureArray>)>>,
}

/// The samples of a recording, from the start of its stretch, at which the frames of a piece are anchored;
/// `None` for the whole recording.
pub type Piece = Option<Range<u64>>;

type Computed = Option<(Arc<Plan>, Features)>;

impl Recordings {
    /// Recordings by `config`. What does not fit in memory goes to the system's temporary folder.
    pub fn new(config: Arc<Config>) -> Self {
        let plans = Plans::new(config.clone(), |_| {});
        Self { config, plans, folder: std::env::temp_dir() }
    }

    /// The configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The number of channels that most of `inputs` have, where the width of a summary depends on it. Their
    /// headers are read with `jobs` threads, those of objects with more.
    ///
    /// # Errors
    /// The threads cannot be started, or `stop` was set.
    pub fn usual_channels(
        &self,
        inputs: &[Input],
        jobs: usize,
        stop: &Arc<AtomicBool>,
    ) -> Result<Option<u16>, RunError> {
        let survey = pool(jobs)?.install(|| Survey::of(inputs, &self.config, stop));
        match stop.load(Ordering::Relaxed) {
            true => Err(RunError::Interrupted),
            false => Ok(survey.channels()),
        }
    }

    /// Why this configuration has no frames of pieces of recordings; `None` where it has, as far as can be
    /// said before a recording is opened.
    pub fn piece_refusal(&self) -> Option<String> {
        let planned = USUAL_CHANNELS.into_iter().find_map(|channels| self.usual(channels));
        planned.and_then(|planned| planned.plan.piece_refusal())
    }

    /// Computes recordings with `jobs` threads; of those with a piece, the frames that are anchored at its
    /// samples, as the whole recording has them. A summary is as wide as recordings of `channels`
    /// channels make it; `None` is the number that most of these have, as in a run.
    ///
    /// # Errors
    /// A temporary file fails, or `stop` was set; whatever is wrong with a recording is in its
    /// outcome.
    pub fn extract(
        &self,
        (inputs, pieces): (&[Input], &[Piece]),
        channels: Option<u16>,
        jobs: usize,
        stop: &Arc<AtomicBool>,
    ) -> Result<Batch, RunError> {
        let computed: Result<Vec<(Outcome, Computed)>, RunError> = pool(jobs)?.install(|| {
            let survey = match channels {
                Some(channels) => Survey::of_channels(channels, &self.config),
                None => Survey::of(inputs, &self.config, stop),
            };
            // They do not outlive the call: a process that is forked later must not share their files.
            let decoders = Decoders::default();
            let each = inputs.par_iter().enumerate();
            each.map(|(i, input)| {
                let piece = pieces.get(i).and_then(Option::as_ref);
                self.recording((input, piece), (&survey, &decoders), stop)
            })
            .collect()
        });
        Ok(self.batch(computed?, channels))
    }

    /// Computes recordings with `jobs` threads and gives them one by one, in their order; few are
    /// held in memory. A summary is as wide as in a run.
    ///
    /// # Errors
    /// The threads cannot be started.
    pub fn in_order<'a>(
        &'a self,
        inputs: &'a [Input],
        jobs: usize,
        stop: &'a Arc<AtomicBool>,
    ) -> Result<InOrder<'a>, RunError> {
        let pool = pool(jobs)?;
        let survey = pool.install(|| Survey::of(inputs, &self.config, stop));
        let ready = VecDeque::new();
        let decoders = Decoders::default();
        Ok(InOrder { recordings: self, rest: inputs, ready, pool, survey, decoders, stop })
    }

    fn recording(
        &self,
        (input, piece): (&Input, Option<&Range<u64>>),
        with: (&Survey, &Decoders),
        stop: &Arc<AtomicBool>,
    ) -> Result<(Outcome, Computed), RunError> {
        let watch = Watch::begin(input);
        let mut outcome = outcome_of(input);
        let computed = catch_unwind(AssertUnwindSafe(|| {
            self.features((input, piece), &watch, with, stop, &mut outcome)
        }));
        match computed.unwrap_or_else(|_| Err(broken())) {
            Ok(None) => Err(RunError::Interrupted),
            Err(_) if input.source.is_stored() && stop.load(Ordering::Relaxed) => {
                Err(RunError::Interrupted)
            }
            Ok(features) => Ok((outcome, features)),
            Err(Failed { temporary: Some(source), .. }) => {
                Err(RunError::Temporary { path: self.folder.clone(), source })
            }
            Err(failed) => {
                work::note(&mut outcome, failed);
                Ok((outcome, None))
            }
        }
    }

    fn features(
        &self,
        (input, piece): (&Input, Option<&Range<u64>>),
        watch: &Watch,
        (survey, decoders): (&Survey, &Decoders),
        stop: &Arc<AtomicBool>,
        outcome: &mut Outcome,
    ) -> Result<Computed, Failed> {
        // A piece ends before its stretch, and its reader tells nothing of what lies after.
        let usable = piece.is_none().then_some(decoders);
        let opened = work::open(input, (watch, usable), (&self.plans, survey), stop, outcome)?;
        let planned = opened.planned.clone();
        if let Some(piece) = piece {
            let found = work::piece(opened, piece, (watch, &self.folder), stop, outcome)?;
            return Ok(found.map(|features| (planned.plan, features)));
        }
        let with = (watch, decoders);
        let Some(recording) = work::whole(opened, with, &self.folder, stop, outcome)? else {
            return Ok(None);
        };
        let (features, _) = work::complete(input, (&planned, watch), Ok(recording), outcome)?;
        Ok(Some((planned.plan, features)))
    }

    fn batch(&self, computed: Vec<(Outcome, Computed)>, channels: Option<u16>) -> Batch {
        let mut batch = Batch::default();
        for (mut outcome, features) in computed {
            let mut frames = None;
            match features {
                None => {}
                Some((plan, Features::Frames(arrays))) => frames = Some((plan, arrays)),
                Some((plan, Features::Summary(row))) => {
                    let names = plan.summary_names();
                    if batch.names.is_empty() {
                        batch.names = names.to_vec();
                        batch.values.extend(row);
                    } else if batch.names == *names {
                        batch.values.extend(row);
                    } else {
                        outcome.status = Status::Mismatch;
                        outcome.reason = other_width(names.len(), batch.names.len());
                    }
                }
            }
            batch.outcomes.push(outcome);
            batch.frames.push(frames);
        }
        if batch.names.is_empty() {
            batch.names = self.summary_names(channels);
        }
        batch
    }

    /// Names of the summary's columns where no recording has told them: those for `channels`, or for
    /// whatever number the configuration can be planned for.
    fn summary_names(&self, channels: Option<u16>) -> Vec<String> {
        if self.config.summary.is_none() {
            return Vec::new();
        }
        let names =
            |channels| self.usual(channels).map(|planned| planned.plan.summary_names().to_vec());
        let found = match channels {
            Some(channels) => names(channels),
            None => USUAL_CHANNELS.into_iter().find_map(names),
        };
        found.unwrap_or_default()
    }

    /// The plan for usual recordings of so many channels, where there is one.
    fn usual(&self, channels: u16) -> Option<Planned> {
        let rate = self.config.signal.sample_rate;
        let rate = if rate > 0.0 { rate } else { USUAL_RATE };
        let spec = AudioSpec {
            sample_rate: rate as u32,
            channels,
            format: "none".into(),
            encoding: SampleEncoding::Float { bytes: 4 },
            declared_frames: None,
        };
        self.plans.of(&spec).ok()
    }
}

/// Recordings one by one, in their order.
pub struct InOrder<'a> {
    recordings: &'a Recordings,
    rest: &'a [Input],
    ready: VecDeque<Recorded<'a>>,
    pool: rayon::ThreadPool,
    survey: Survey,
    decoders: Decoders,
    stop: &'a Arc<AtomicBool>,
}

/// A recording that was computed.
pub struct Recorded<'a> {
    /// The recording.
    pub input: &'a Input,
    /// What became of it.
    pub outcome: Outcome,
    /// Its features; `None` where the outcome says that it has none.
    pub features: Option<Features>,
}

impl<'a> Iterator for InOrder<'a> {
    /// An error where a temporary file fails, or `stop` was set; nothing follows it.
    type Item = Result<Recorded<'a>, RunError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.ready.is_empty() {
            let together = self.rest.len().min(AHEAD * self.pool.current_num_threads());
            let (part, rest) = self.rest.split_at(together);
            self.rest = rest;
            let compute = |input: &'a Input| {
                let with = (&self.survey, &self.decoders);
                let (outcome, found) = self.recordings.recording((input, None), with, self.stop)?;
                let features = found.map(|(_, features)| features);
                Ok(Recorded { input, outcome, features })
            };
            match self.pool.install(|| part.par_iter().map(compute).collect::<Result<Vec<_>, _>>())
            {
                Ok(found) => self.ready = found.into(),
                Err(error) => {
                    self.rest = &[];
                    return Some(Err(error));
                }
            }
        }
        self.ready.pop_front().map(Ok)
    }
}

/// Threads of one call alone: they cannot be missing in a process that was forked.
pub(super) fn pool(jobs: usize) -> Result<rayon::ThreadPool, RunError> {
    require_jobs(jobs)?;
    rayon::ThreadPoolBuilder::new()
        .num_threads(jobs)
        .build()
        .map_err(|e| RunError::Jobs { jobs, why: e.to_string() })
}
