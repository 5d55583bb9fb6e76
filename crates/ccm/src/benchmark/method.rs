//! The lines of the tables: methods with their estimates.

use super::added::Placed;
use super::baselines::Variant;
use super::interval::bootstrap;
use super::names::file_name;
use super::predicted::Predicted;
use super::results::{Estimate, PartScores, Rows, Target, score};
use crate::capacity::PRIOR_MASS_G;
use crate::dataset::{Filling, FillingLevel, FillingType, Subset};
use crate::paper::Task;
use crate::scores::ConfusionMatrix;
use crate::submission::pseudo_random;
use corsmal_report::{Cell, Source};

/// A method with its estimates.
pub(super) struct Method {
    pub(super) name: String,
    /// Name of its files; none where nothing of it is kept.
    pub(super) slug: Option<String>,
    pub(super) inputs: String,
    pub(super) protocol: String,
    pub(super) source: Source,
    /// What it is scored at: one that only completes another has its rows in the filling mass alone.
    pub(super) tasks: &'static [Task],
    /// Estimates of training recordings that were not trained on, by row number.
    training: Vec<(usize, Estimate)>,
    /// Estimates of each test part, where there are any.
    tests: Vec<Option<Vec<Estimate>>>,
}

/// What [`Method::addressed`] says of one that estimates all three tasks.
const ALL_ADDRESSED: &str = "level, type, capacity";

/// Name of the recordings of training that were not trained on.
pub(super) const HELD_OUT: &str = "held-out training containers";

/// A part of the recordings.
#[derive(Clone, Copy)]
pub(super) enum Part {
    Training,
    Test(Subset),
    Combined,
}

type Pairs<'a> = Vec<(&'a Target, &'a Estimate)>;

impl Method {
    /// The recordings of a part with their estimates; `None` where a part has none, or where only
    /// one of two test parts is there to be combined.
    fn pairs<'a>(&'a self, rows: &'a Rows, part: Part) -> Option<Pairs<'a>> {
        let mut pairs: Pairs = Vec::new();
        match part {
            Part::Training => {
                pairs.extend(self.training.iter().map(|(row, e)| (&rows.training[*row], e)));
            }
            Part::Test(_) | Part::Combined => {
                for (test, estimates) in rows.tests.iter().zip(&self.tests) {
                    if matches!(part, Part::Test(subset) if subset != test.subset) {
                        continue;
                    }
                    pairs.extend(test.rows.iter().zip(estimates.as_ref()?));
                }
                // Only one of the two test parts is not a combination.
                if matches!(part, Part::Combined) && rows.tests.len() < 2 {
                    return None;
                }
            }
        }
        Some(pairs)
    }

    /// Scores over the recordings of a part that `keep` takes; `None` where nothing is known.
    pub(super) fn scores(
        &self,
        rows: &Rows,
        part: Part,
        seed: u64,
        keep: &dyn Fn(&Target) -> bool,
    ) -> Option<PartScores> {
        let mut pairs = self.pairs(rows, part)?;
        pairs.retain(|(target, _)| keep(target));
        let (targets, estimates): (Vec<_>, Vec<_>) =
            pairs.into_iter().map(|(t, e)| (t, e.clone())).unzip();
        score(&targets, &estimates, seed)
    }

    /// Estimates of training recordings that were not trained on, by row number.
    pub(super) fn training(&self) -> &[(usize, Estimate)] {
        &self.training
    }

    /// Estimates of each test part, where there are any.
    pub(super) fn tests(&self) -> &[Option<Vec<Estimate>>] {
        &self.tests
    }

    /// Whether it estimates level, type and capacity.
    pub(super) fn addresses_all(&self) -> bool {
        self.addressed() == ALL_ADDRESSED
    }

    /// Whether it completes another method with capacities.
    pub(super) fn completes(&self) -> bool {
        self.tasks.len() < Task::ALL.len()
    }

    /// The recordings whose capacity is known, with their estimates.
    pub(super) fn with_capacity<'a>(&'a self, rows: &'a Rows) -> Vec<(&'a Target, f64, f64)> {
        let training = self.training.iter().map(|(row, e)| (&rows.training[*row], e));
        let tests = rows.tests.iter().zip(&self.tests);
        let tests = tests.flat_map(|(part, e)| part.rows.iter().zip(e.iter().flatten()));
        let known = training.chain(tests).filter_map(|(target, estimate)| {
            let truth = target.annotation.as_ref().map(|a| a.capacity_ml).filter(|c| *c > 0.0)?;
            Some((target, truth, estimate.capacity_ml?))
        });
        known.collect()
    }

    /// The scores of the first part that is labelled and estimated, and its name.
    pub(super) fn first_scores(
        &self,
        rows: &Rows,
        seed: u64,
    ) -> Option<(&'static str, PartScores)> {
        let parts = [
            (Part::Training, HELD_OUT),
            (Part::Combined, "both test parts"),
            (Part::Test(Subset::Public), "public test part"),
            (Part::Test(Subset::Private), "private test part"),
        ];
        parts
            .into_iter()
            .find_map(|(part, name)| Some((name, self.scores(rows, part, seed, &|_| true)?)))
    }

    /// The tasks of which it estimates something.
    pub(super) fn addressed(&self) -> String {
        let tests = self.tests.iter().flatten().flatten();
        let all: Vec<&Estimate> = self.training.iter().map(|(_, e)| e).chain(tests).collect();
        let has = |known: fn(&Estimate) -> bool| all.iter().any(|e| known(e));
        let tasks = [
            ("level", has(|e| e.level.is_some())),
            ("type", has(|e| e.kind.is_some())),
            ("capacity", has(|e| e.capacity_ml.is_some())),
        ];
        let named: Vec<&str> =
            tasks.iter().filter(|(_, any)| *any).map(|(name, _)| *name).collect();
        named.join(", ")
    }

    /// The score of a task on a part, with its interval where it is a classification: by resampling
    /// whole containers in the training part, recordings in the test parts, whose three containers
    /// are too few.
    pub(super) fn cell(&self, rows: &Rows, part: Part, task: Task, seed: u64) -> Cell {
        if !self.tasks.contains(&task) {
            return Cell::None;
        }
        let scores = self.scores(rows, part, seed, &|_| true);
        match scores.and_then(|s| of_task(task, &s)) {
            Some(value) => Cell::Score(value, self.interval(rows, part, task, seed)),
            None => Cell::None,
        }
    }

    fn interval(&self, rows: &Rows, part: Part, task: Task, seed: u64) -> Option<(f64, f64)> {
        let pairs = self.pairs(rows, part)?;
        let class = |(target, estimate): &(&Target, &Estimate)| {
            let filling = target.filling?;
            Some(match task {
                Task::Level => (filling.level() as usize, estimate.level),
                Task::Type => (filling.kind() as usize, estimate.kind),
                Task::Capacity | Task::Mass => return None,
            })
        };
        let classes: Vec<(usize, Option<usize>)> =
            pairs.iter().map(class).collect::<Option<_>>()?;
        let count =
            if task == Task::Level { FillingLevel::ALL.len() } else { FillingType::ALL.len() };
        let mut groups: Vec<Vec<usize>> = Vec::new();
        match part {
            Part::Training => {
                let container = |t: &Target| t.recording.container.map_or(0, |c| c.number());
                let mut numbers: Vec<u8> = pairs.iter().map(|(t, _)| container(t)).collect();
                numbers.sort_unstable();
                numbers.dedup();
                for number in numbers {
                    let of = |row: &usize| container(pairs[*row].0) == number;
                    groups.push((0..pairs.len()).filter(of).collect());
                }
            }
            Part::Test(_) | Part::Combined => groups.extend((0..pairs.len()).map(|row| vec![row])),
        }
        bootstrap(&groups, seed, |rows| {
            let sample = rows.iter().map(|row| classes[*row]);
            100.0 * ConfusionMatrix::new(count, sample).weighted_f1()
        })
    }
}

pub(super) fn of_task(task: Task, scores: &PartScores) -> Option<f64> {
    match task {
        Task::Level => scores.level,
        Task::Type => scores.kind,
        Task::Capacity => scores.capacity,
        Task::Mass => scores.mass,
    }
}

/// All methods: baselines, systems, pseudo-random estimates, files that were added.
pub(super) fn methods(rows: &Rows, predicted: &Predicted<'_>, seed: u64) -> Vec<Method> {
    let outcomes = predicted.outcomes.iter();
    let mut list: Vec<Method> = outcomes
        .map(|o| Method {
            name: o.baseline.name(),
            slug: Some(format!("{}-{}", o.baseline.slug(), o.variant.name())),
            inputs: "audio".into(),
            protocol: match o.variant {
                Variant::Published => "published".into(),
                Variant::Corrected => "corrected".into(),
            },
            source: Source::Ours,
            tasks: &Task::ALL,
            training: o.held_out.clone(),
            tests: o.tests.iter().cloned().map(Some).collect(),
        })
        .collect();
    list.extend(predicted.runs.iter().map(|run| Method {
        name: run.name.clone(),
        slug: Some(run.slug.clone()),
        inputs: run.inputs.clone(),
        protocol: "corrected".into(),
        source: Source::Ours,
        tasks: &Task::ALL,
        training: run.held_out.clone(),
        tests: run.tests.iter().cloned().map(Some).collect(),
    }));
    let random = |targets: &[Target]| -> Vec<Estimate> {
        let keys: Vec<_> = targets.iter().map(|t| t.key).collect();
        pseudo_random(&keys, seed).into_iter().map(Estimate::from).collect()
    };
    list.push(Method {
        name: "Random".into(),
        slug: None,
        inputs: String::new(),
        protocol: format!("seed {seed}"),
        source: Source::Ours,
        tasks: &Task::ALL,
        training: random(&rows.training).into_iter().enumerate().collect(),
        tests: rows.tests.iter().map(|t| Some(random(&t.rows))).collect(),
    });
    list.extend(predicted.added.iter().filter(|a| a.is_any()).map(|a| Method {
        name: a.name.clone(),
        slug: None,
        inputs: String::new(),
        protocol: "given".into(),
        source: Source::Added,
        tasks: &Task::ALL,
        training: a.training.iter().flatten().cloned().enumerate().collect(),
        tests: a.tests.clone(),
    }));
    list.extend(predicted.capacities.iter().filter(|(a, _)| a.is_any()).map(|(a, own)| Method {
        name: a.name.clone(),
        slug: None,
        inputs: own.unwrap_or_default().into(),
        protocol: if own.is_some() { "corrected" } else { "given" }.into(),
        source: if own.is_some() { Source::Ours } else { Source::Added },
        tasks: &Task::ALL,
        training: a.training.iter().flatten().cloned().enumerate().collect(),
        tests: a.tests.clone(),
    }));
    let completed: Vec<Method> = list
        .iter()
        .filter(|m| m.protocol == "corrected" && m.slug.is_some())
        .flat_map(|m| predicted.capacities.iter().filter_map(|(c, _)| m.completed(c)))
        .collect();
    list.extend(completed);
    list
}

impl Method {
    /// Type and level of this method with the capacities and sizes of a table, where it covers the same parts;
    /// container masses are the training containers' median.
    fn completed(&self, capacities: &Placed) -> Option<Self> {
        let both = |own: &Estimate, measured: &Estimate| Estimate {
            capacity_ml: measured.capacity_ml,
            dimensions: measured.dimensions,
            execution_ms: measured.execution_ms,
            container_mass_g: Some(PRIOR_MASS_G),
            ..own.clone()
        };
        let all = capacities.training.as_deref();
        let training: Vec<(usize, Estimate)> = match all {
            Some(all) => self.training.iter().map(|(row, e)| (*row, both(e, &all[*row]))).collect(),
            None => Vec::new(),
        };
        let tests = self.tests.iter().zip(&capacities.tests).map(|(own, measured)| {
            let (own, measured) = (own.as_ref()?, measured.as_ref()?);
            Some(own.iter().zip(measured).map(|(e, m)| both(e, m)).collect())
        });
        let tests: Vec<Option<Vec<Estimate>>> = tests.collect();
        if training.is_empty() && tests.iter().all(Option::is_none) {
            return None;
        }
        Some(Self {
            name: format!("{}, capacity {}", self.name, capacities.name),
            slug: self.slug.as_ref().map(|slug| format!("{slug}-{}", file_name(&capacities.name))),
            inputs: self.inputs.clone(),
            protocol: self.protocol.clone(),
            source: self.source,
            tasks: &[Task::Mass],
            training,
            tests,
        })
    }
}

pub(super) fn level_names() -> Vec<String> {
    FillingLevel::ALL.map(|l| l.name().to_string()).to_vec()
}

pub(super) fn kind_names() -> Vec<String> {
    FillingType::ALL.map(|k| k.name().to_string()).to_vec()
}

pub(super) fn joint_names() -> Vec<String> {
    Filling::all().map(Filling::name).collect()
}
