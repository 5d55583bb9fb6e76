//! Several runs over the same recordings, each of which is read once for all of them.

use std::collections::BTreeMap;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use corsmal_audio::BlockSource;
use corsmal_files::outcome::Outcome;
use rayon::prelude::*;

use super::begun::{Begun, Ending, Open};
use super::error::RunError;
use super::options::{Progress, RunReport, mixed};
use super::output::{Finished, Output};
use super::recordings::pool;
use super::work::{self, broken, known_outcome_of, outcome_of};
use crate::engine::reading::{self, Part};
use crate::engine::together::{self as engine, Computed};
use crate::engine::{Decoders, Failed, Features, Planned, Plans, Recording, Watch};
use crate::inputs::Input;
use crate::survey::Survey;

/// Completes runs that have begun, all of which make statistics, with `jobs` threads. Inputs with the same number
/// that are stretches of the same recording are computed in one reading of it. Outputs and reports are those
/// of runs one after the other; only how many frames a recording with NaN or infinite samples had decoded when
/// it failed may differ, as blocks do. `progress` is told of each recording once, when all runs are done with it.
///
/// # Errors
/// [`RunError`], as [`run`](super::run()); [`RunError::NoSummary`]. What the runs have done until then can be
/// continued.
pub fn together(
    begun: Vec<Begun<'_>>,
    jobs: usize,
    progress: &dyn Progress,
    stop: &Arc<AtomicBool>,
) -> Result<Vec<RunReport>, RunError> {
    let pool = pool(jobs)?;
    let mut reports = Vec::with_capacity(begun.len());
    let mut members = Vec::with_capacity(begun.len());
    let mut outputs = Vec::with_capacity(begun.len());
    for begun in begun {
        match begun.open() {
            Err(report) => reports.push(Some(report)),
            Ok(Open { inputs, config, survey, output, ending }) => {
                if config.summary.is_none() {
                    return Err(RunError::NoSummary);
                }
                let plans = Plans::new(config.clone(), |warning| progress.warning(warning));
                let (folder, warned) = (ending.folder(), AtomicBool::new(false));
                outputs.push((output, ending, reports.len()));
                let decoders = Decoders::default();
                members.push(Member { inputs, survey, plans, decoders, folder, progress, warned });
                reports.push(None);
            }
        }
    }
    let all = members.iter().map(|member| member.inputs.len()).max().unwrap_or(0);
    let begins: Vec<usize> = outputs.iter().map(|(output, ..)| output.next).collect();
    let next = begins.iter().copied().min().unwrap_or(all);
    if !members.is_empty() {
        progress.start(all, next);
    }
    let writer = Mutex::new(Writer { members: &members, outputs, next, ready: BTreeMap::new() });
    let compute = |number: usize| {
        let asks = members.iter().enumerate().filter(|(run, _)| begins[*run] <= number);
        let asked = asks
            .filter_map(|(run, by)| by.inputs.get(number).map(|input| Asked { run, by, input }));
        let Some(found) = answers(asked.collect(), stop)? else {
            return Err(RunError::Interrupted);
        };
        // A fault while writing leaves the outputs in doubt: the runs end, their ledgers intact.
        let written = catch_unwind(AssertUnwindSafe(|| match writer.lock() {
            Ok(mut writer) => writer.write(number, found),
            Err(_) => Err(RunError::Broken),
        }));
        written.unwrap_or(Err(RunError::Broken))
    };
    // Taken one after the other, so that few wait for those before them.
    pool.install(|| (next..all).par_bridge().try_for_each(compute))?;
    let Writer { outputs, .. } = writer.into_inner().unwrap_or_else(|e| e.into_inner());
    for (output, ending, place) in outputs {
        let report = ending.publish(output, stop)?;
        mixed(&report.outcomes).iter().for_each(|warning| progress.warning(warning));
        reports[place] = Some(report);
    }
    Ok(reports.into_iter().flatten().collect())
}

/// Writes recordings in their order.
struct Writer<'a> {
    members: &'a [Member<'a>],
    /// Each with the place of its report.
    outputs: Vec<(Output, Ending<'a>, usize)>,
    next: usize,
    /// Computed before their turn.
    ready: BTreeMap<usize, Vec<(usize, Finished)>>,
}

impl Writer<'_> {
    /// Takes what the runs have made of a recording, and writes what is to be written next.
    fn write(&mut self, number: usize, found: Vec<(usize, Finished)>) -> Result<(), RunError> {
        self.ready.insert(number, found);
        while let Some(found) = self.ready.remove(&self.next) {
            let mut last = None;
            for (run, finished) in found {
                let (member, (output, ending, _)) = (&self.members[run], &mut self.outputs[run]);
                let outcome = output.write(&member.inputs[self.next], finished)?;
                check_errors(output, ending, &outcome)?;
                last = Some((member.progress, outcome));
            }
            last.iter().for_each(|(progress, outcome)| progress.done(outcome));
            self.next += 1;
        }
        Ok(())
    }
}

/// Ends a run of which more inputs have failed than it allows.
fn check_errors(output: &Output, ending: &Ending<'_>, last: &Outcome) -> Result<(), RunError> {
    let Some(limit) = ending.max_errors.filter(|_| !last.status.has_features()) else {
        return Ok(());
    };
    let failed = output.outcomes().iter().filter(|o| !o.status.has_features()).count();
    let last = format!("{}: {}", last.path, last.reason);
    if failed > limit { Err(RunError::TooManyErrors { failed, limit, last }) } else { Ok(()) }
}

/// One of the runs.
struct Member<'a> {
    inputs: &'a [Input],
    survey: Survey,
    plans: Plans<'a>,
    decoders: Decoders,
    folder: PathBuf,
    progress: &'a dyn Progress,
    /// Whether a recording shorter than a transform was met.
    warned: AtomicBool,
}

impl Member<'_> {
    fn warn_once(&self, warning: Option<String>) {
        if let Some(warning) = warning
            && !self.warned.swap(true, Ordering::Relaxed)
        {
            self.progress.warning(&warning);
        }
    }
}

/// What a run wants to know of a recording.
#[derive(Clone, Copy)]
struct Asked<'a> {
    /// Number of the run.
    run: usize,
    by: &'a Member<'a>,
    input: &'a Input,
}

/// What each run that asks makes of its input; `None` when the runs were stopped.
fn answers(
    mut asked: Vec<Asked<'_>>,
    stop: &Arc<AtomicBool>,
) -> Result<Option<Vec<(usize, Finished)>>, RunError> {
    let mut finished = Vec::with_capacity(asked.len());
    while let Some(Asked { input: first, .. }) = asked.first() {
        let same = |of: &Asked<'_>| of.input.source == first.source;
        let (alike, others): (Vec<_>, Vec<_>) = asked.into_iter().partition(same);
        let Some(found) = of_source(&alike, stop)? else { return Ok(None) };
        finished.extend(found);
        asked = others;
    }
    finished.sort_by_key(|(run, _)| *run);
    Ok(Some(finished))
}

/// The same where all ask about one recording.
fn of_source(
    asked: &[Asked<'_>],
    stop: &Arc<AtomicBool>,
) -> Result<Option<Vec<(usize, Finished)>>, RunError> {
    let Some(first) = asked.first() else { return Ok(Some(Vec::new())) };
    // Before anything is known of the bytes, so that another recording in its place is seen.
    let watch = Watch::begin(first.input);
    let mut outcomes: Vec<Outcome> = Vec::with_capacity(asked.len());
    for Asked { input, .. } in asked {
        let known = outcomes.first().map(|outcome| outcome.identity.clone());
        outcomes.push(match known {
            None => outcome_of(input),
            Some(identity) => known_outcome_of(input, identity),
        });
    }
    let computed = AssertUnwindSafe(|| shared(asked, &watch, &mut outcomes, stop));
    let found = match catch_unwind(computed).unwrap_or_else(|_| Err(broken())) {
        Ok(Some(found)) => found,
        Ok(None) => return Ok(None),
        Err(failed) => {
            let mut all: Vec<_> = asked.iter().map(|_| Err(failed.same())).collect();
            if let Some(first) = all.first_mut() {
                *first = Err(failed);
            }
            all
        }
    };
    let mut finished = Vec::with_capacity(asked.len());
    for ((Asked { run, by, input }, mut outcome), found) in asked.iter().zip(outcomes).zip(found) {
        let row = match found {
            Ok(Row { values, planned, total }) => {
                by.warn_once(work::short(&planned.plan, total, &outcome));
                Some((values, planned.plan.summary_names()))
            }
            Err(Failed { temporary: Some(source), .. }) => {
                return Err(RunError::Temporary { path: by.folder.clone(), source });
            }
            Err(_) if input.source.waits() && stop.load(Ordering::Relaxed) => return Ok(None),
            Err(failed) => {
                work::note(&mut outcome, failed);
                None
            }
        };
        finished.push((*run, Finished { outcome, arrays: Vec::new(), row }));
    }
    Ok(Some(finished))
}

/// A row of a table, with what it was computed, and of how many samples.
struct Row {
    values: Vec<f32>,
    planned: Planned,
    total: u64,
}

/// What all runs that ask make of one recording, read once where its reader allows; `None` when the runs were
/// stopped. Their outcomes learn what they would have learned alone.
fn shared(
    asked: &[Asked<'_>],
    watch: &Watch,
    outcomes: &mut [Outcome],
    stop: &Arc<AtomicBool>,
) -> Result<Option<Vec<Result<Row, Failed>>>, Failed> {
    let Some(first) = asked.first() else { return Ok(Some(Vec::new())) };
    let one_by_one = |outcomes: &mut [Outcome]| {
        let each = asked.iter().zip(outcomes);
        each.map(|(asked, outcome)| alone(asked, outcome, stop)).collect()
    };
    if first.input.source.comes_once() {
        return Ok(one_by_one(outcomes));
    }
    let opened = watch.settle(reading::open(first.input, watch, Part::Whole, stop));
    if let Some(identity) = watch.identity() {
        outcomes.iter_mut().for_each(|outcome| outcome.identity.clone_from(&identity));
    }
    let mut source = opened?;
    if !engine::can_share(source.as_ref()) {
        drop(source);
        return Ok(one_by_one(outcomes));
    }
    let mut wanted = Vec::with_capacity(asked.len());
    let mut plan = |(Asked { by, input, .. }, outcome): (&Asked<'_>, &mut Outcome)| {
        let (times, rate) = ((input.start, input.end), source.spec().sample_rate);
        let crop = reading::crop(by.plans.signal(), times, rate);
        reading::describe(outcome, source.as_ref(), &crop);
        let one = work::wanted(input, source.as_ref(), (&by.plans, &by.survey), outcome)?;
        let planned = one.planned.clone();
        wanted.push(one);
        Ok(planned)
    };
    let plans: Vec<Result<Planned, Failed>> =
        asked.iter().zip(&mut *outcomes).map(&mut plan).collect();
    let places: Vec<usize> = (0..asked.len()).filter(|&place| plans[place].is_ok()).collect();
    let mut computed: Vec<Option<Result<Recording, Failed>>> = asked.iter().map(|_| None).collect();
    let done =
        |number: usize, Computed { recording, decoded }: Computed, source: &dyn BlockSource| {
            let place = places[number];
            outcomes[place].decoded_frames += decoded;
            reading::describe(&mut outcomes[place], source, &wanted[number].crop);
            computed[place] = Some(watch.settle(recording));
        };
    if !engine::compute(source.as_mut(), &wanted, &first.by.folder, stop, done)? {
        return Ok(None);
    }
    let each = asked.iter().zip(outcomes).zip(plans.into_iter().zip(computed));
    let rows = each.map(|((asked, outcome), (planned, recording))| {
        let planned = planned?;
        let recording = recording.unwrap_or_else(|| Err(broken()))?;
        asked.row(planned, watch, recording, outcome)
    });
    Ok(Some(rows.collect()))
}

/// The same for one run.
fn alone(
    asked: &Asked<'_>,
    outcome: &mut Outcome,
    stop: &Arc<AtomicBool>,
) -> Option<Result<Row, Failed>> {
    let Asked { by, input, .. } = asked;
    let watch = Watch::begin(input);
    // The recording may be another than the one that the run before has read.
    if !input.source.is_stored() {
        outcome.identity = input.source.identity();
    }
    let with = (&watch, Some(&by.decoders));
    let opened = work::open(input, with, (&by.plans, &by.survey), stop, outcome);
    let computed = opened.and_then(|opened| {
        let planned = opened.planned.clone();
        let recording = work::whole(opened, (&watch, &by.decoders), &by.folder, stop, outcome)?;
        Ok(recording.map(|recording| (planned, recording)))
    });
    let (planned, recording) = match computed.transpose()? {
        Ok(computed) => computed,
        Err(failed) => return Some(Err(failed)),
    };
    Some(asked.row(planned, &watch, recording, outcome))
}

impl Asked<'_> {
    /// The statistics of a recording that is read.
    fn row(
        &self,
        planned: Planned,
        watch: &Watch,
        recording: Recording,
        outcome: &mut Outcome,
    ) -> Result<Row, Failed> {
        match work::complete(self.input, (&planned, watch), Ok(recording), outcome)? {
            (Features::Summary(row), total) => Ok(Row { values: row, planned, total }),
            (Features::Frames(_), _) => Err(broken()),
        }
    }
}
