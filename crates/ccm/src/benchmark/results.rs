//! What is predicted for which recordings.

use crate::dataset::{
    Annotation, Annotations, DataSet, Dimensions, Filling, FillingLevel, FillingType, Recording,
    Subset,
};
use crate::error::{CcmError, Result};
use crate::scores::{self, ConfusionMatrix, RuleSet};
use crate::submission::{Format, RowKey, Submission, SubmissionRow, pseudo_random};

/// A recording to train on or to predict.
pub(super) struct Target {
    pub(super) recording: Recording,
    /// How submissions name it.
    pub(super) key: RowKey,
    /// Type and level, where known.
    pub(super) filling: Option<Filling>,
    /// All that is annotated.
    pub(super) annotation: Option<Annotation>,
}

/// A test part.
pub(super) struct TestPart {
    pub(super) subset: Subset,
    pub(super) rows: Vec<Target>,
}

impl TestPart {
    /// Whether all its recordings have labels, without which it has no scores.
    pub(super) fn is_labelled(&self) -> bool {
        self.rows.iter().all(|target| target.filling.is_some())
    }

    /// Why it has no scores, or none of capacity and mass, though some of its recordings have labels; in words.
    pub(super) fn unscored(&self) -> Option<String> {
        let (name, all) = (self.subset.name(), self.rows.len());
        let labelled = self.rows.iter().filter(|target| target.filling.is_some()).count();
        if (1..all).contains(&labelled) {
            return Some(format!(
                "{name}: {labelled} of {all} recordings have labels, so it is not scored."
            ));
        }
        let annotated = |t: &&Target| t.annotation.as_ref().is_some_and(|a| a.capacity_ml > 0.0);
        let known = self.rows.iter().filter(annotated).count();
        (1..all).contains(&known).then(|| {
            format!("{name}: {known} of {all} recordings have an annotated capacity, so neither capacity nor mass is scored.")
        })
    }
}

/// The recordings of a data set by what they are used for.
pub(super) struct Rows {
    /// Labelled recordings of containers 1 to 9, in the order of the 2020 scripts.
    pub(super) training: Vec<Target>,
    /// Test parts that have recordings.
    pub(super) tests: Vec<TestPart>,
}

impl Rows {
    pub(super) fn of(set: &DataSet) -> Result<Self> {
        if let Some(odd) = set.contradictions.first() {
            return Err(CcmError::Request(format!("{} {}", odd.path.display(), odd.what)));
        }
        let (mut training, mut public, mut private) = (Vec::new(), Vec::new(), Vec::new());
        for recording in &set.recordings {
            let sequence = recording.container.zip(recording.sequence);
            let key = match (sequence, recording.id) {
                (Some((container, sequence)), _) => RowKey::Sequence(container.number(), sequence),
                // Which container a flat test file shows is withheld.
                (None, Some(id)) if recording.part != Subset::Training => RowKey::Id(id),
                _ => continue,
            };
            let target = Target {
                recording: recording.clone(),
                key,
                filling: recording.filling(),
                annotation: set.annotation(recording).cloned(),
            };
            match recording.part {
                Subset::Training if target.filling.is_some() => training.push(target),
                Subset::Training => {}
                Subset::Public => public.push(target),
                Subset::Private => private.push(target),
            }
        }
        if training.is_empty() {
            return Err(CcmError::Request(format!(
                "{}: no labelled training recording (containers 1 to 9); see `corsmal-feat \
                 dataset check`",
                set.root.display()
            )));
        }
        let tests = [(Subset::Public, public), (Subset::Private, private)]
            .into_iter()
            .filter(|(_, rows)| !rows.is_empty())
            .map(|(subset, rows)| TestPart { subset, rows })
            .collect();
        Ok(Self { training, tests })
    }

    /// Joint classes of the training recordings.
    pub(super) fn joint(&self) -> Vec<usize> {
        self.training.iter().filter_map(|t| t.filling.map(Filling::joint)).collect()
    }
}

/// Estimates for a recording, as class numbers.
#[derive(Clone, Debug, Default)]
pub struct Estimate {
    /// Number of the type.
    pub kind: Option<usize>,
    /// Number of the level.
    pub level: Option<usize>,
    /// Probability of each type.
    pub kind_probabilities: Option<[f64; 4]>,
    /// Probability of each level.
    pub level_probabilities: Option<[f64; 3]>,
    /// Capacity in mL.
    pub capacity_ml: Option<f64>,
    /// Whether the capacity is a prior that stands for a measurement.
    pub has_prior_capacity: bool,
    /// Mass of the empty container in g.
    pub container_mass_g: Option<f64>,
    /// Widths and height in mm.
    pub dimensions: Option<Dimensions>,
    /// Time that the estimate took, in ms.
    pub execution_ms: Option<f64>,
}

impl Estimate {
    /// From a joint class and, where the classifier has them, its probabilities.
    pub fn joint(class: usize, probabilities: Option<&[f64]>) -> Self {
        let filling = Filling::from_joint(class);
        let mut kinds = [0.0; 4];
        let mut levels = [0.0; 3];
        for (p, f) in probabilities.into_iter().flatten().zip(Filling::all()) {
            kinds[f.kind() as usize] += p;
            levels[f.level() as usize] += p;
        }
        Self {
            kind: filling.map(|f| f.kind() as usize),
            level: filling.map(|f| f.level() as usize),
            kind_probabilities: probabilities.map(|_| kinds),
            level_probabilities: probabilities.map(|_| levels),
            ..Self::default()
        }
    }

    /// As it is submitted under the name `key`.
    pub(super) fn prediction(&self, key: RowKey) -> SubmissionRow {
        SubmissionRow {
            kind: self.kind.and_then(|k| FillingType::from_number(k as i64)),
            level: self.level.and_then(|l| FillingLevel::from_number(l as i64)),
            kind_probabilities: self.kind_probabilities,
            level_probabilities: self.level_probabilities,
            capacity_ml: self.capacity_ml,
            container_mass_g: self.container_mass_g,
            dimensions: self.dimensions,
            execution_ms: self.execution_ms,
            key,
        }
    }
}

impl From<SubmissionRow> for Estimate {
    fn from(p: SubmissionRow) -> Self {
        Self {
            kind: p.kind.map(|k| k as usize),
            level: p.level.map(|l| l as usize),
            kind_probabilities: p.kind_probabilities,
            level_probabilities: p.level_probabilities,
            capacity_ml: p.capacity_ml,
            has_prior_capacity: false,
            container_mass_g: p.container_mass_g,
            dimensions: p.dimensions,
            execution_ms: p.execution_ms,
        }
    }
}

/// Scores in percent over a list of recordings; a task without any estimate has none.
#[derive(Clone, Debug)]
pub(super) struct PartScores {
    pub(super) level: Option<f64>,
    pub(super) kind: Option<f64>,
    pub(super) joint: Option<f64>,
    pub(super) capacity: Option<f64>,
    pub(super) mass: Option<f64>,
    /// Mean absolute error of the object's weight in N, the container's mass being known.
    pub(super) weight_error: Option<f64>,
    pub(super) level_matrix: ConfusionMatrix,
    pub(super) kind_matrix: ConfusionMatrix,
    pub(super) joint_matrix: ConfusionMatrix,
}

/// Scores estimates by the paper's rules; `None` unless every target is labelled and estimated.
pub(super) fn score(targets: &[&Target], estimates: &[Estimate], seed: u64) -> Option<PartScores> {
    if targets.is_empty() || targets.len() != estimates.len() {
        return None;
    }
    let fillings: Vec<Filling> = targets.iter().map(|t| t.filling).collect::<Option<_>>()?;
    let pairs = || fillings.iter().zip(estimates);
    let level_matrix = ConfusionMatrix::new(
        FillingLevel::ALL.len(),
        pairs().map(|(f, e)| (f.level() as usize, e.level)),
    );
    let kind_matrix = ConfusionMatrix::new(
        FillingType::ALL.len(),
        pairs().map(|(f, e)| (f.kind() as usize, e.kind)),
    );
    let joint_matrix = ConfusionMatrix::new(
        Filling::COUNT,
        pairs().map(|(f, e)| {
            let kind = e.kind.and_then(|k| FillingType::from_number(k as i64));
            let level = e.level.and_then(|l| FillingLevel::from_number(l as i64));
            let both = kind.zip(level).and_then(|(k, l)| Filling::new(k, l));
            (f.joint(), both.map(Filling::joint))
        }),
    );
    let has_level = estimates.iter().any(|e| e.level.is_some());
    let has_kind = estimates.iter().any(|e| e.kind.is_some());
    let has_capacity = estimates.iter().any(|e| e.capacity_ml.is_some());
    let official = by_paper(targets, estimates, seed);
    let of = |name: &str| official.as_ref().and_then(|s| s.get(name));
    Some(PartScores {
        level: has_level.then(|| 100.0 * level_matrix.weighted_f1()),
        kind: has_kind.then(|| 100.0 * kind_matrix.weighted_f1()),
        joint: (has_level && has_kind).then(|| 100.0 * joint_matrix.weighted_f1()),
        capacity: of("T3").filter(|_| has_capacity),
        mass: of("mass"),
        weight_error: of("weight_error_N"),
        level_matrix,
        kind_matrix,
        joint_matrix,
    })
}

/// Capacity and mass need annotated capacities, which names do not tell.
fn by_paper(targets: &[&Target], estimates: &[Estimate], seed: u64) -> Option<scores::Scores> {
    let mut rows: Vec<Annotation> =
        targets.iter().map(|t| t.annotation.clone()).collect::<Option<_>>()?;
    // Named by place: ids of several parts may be the same.
    let keys: Vec<RowKey> = (0..rows.len() as u32).map(RowKey::Id).collect();
    rows.iter_mut().zip(0..).for_each(|(row, place)| row.id = Some(place));
    let annotations = Annotations { path: "annotations".into(), rows, levels_in_percent: false };
    // The weight of an object takes the container's mass as known, as the paper does.
    let known = |a: &Annotation| a.container_mass_g >= 0.0 && a.filling_mass_g >= 0.0;
    let known = annotations.rows.iter().all(known);
    let named = estimates.iter().zip(&annotations.rows).zip(&keys);
    let predictions: Vec<_> = named
        .map(|((estimate, row), &key)| SubmissionRow {
            container_mass_g: known.then_some(row.container_mass_g),
            ..estimate.prediction(key)
        })
        .collect();
    let submission = Submission::from_predictions("estimates", Format::Y2022, &predictions);
    let random = pseudo_random(&keys, seed);
    let baseline = Submission::from_predictions("random", Format::Y2022, &random);
    scores::evaluate(&submission, &annotations, &baseline, RuleSet::Paper, None).ok()
}
