//! The four rule sets.
//!
//! | | `paper` | `toolkit-2020-10` | `toolkit-2021-11` | `toolkit` |
//! |---|---|---|---|---|
//! | labels compared | by value | as text | as text | as text |
//! | density for the mass | of the estimated type | of the estimated type | annotated | annotated |
//! | weight of the mass | tasks/3 | tasks/3 | 0 or 1 | tasks/3 |
//! | added to the mass | 0 | 0.00493 | 0.047505 | 0.047505 training, 0.004339 public, 0.004338 private |
//! | overall | – | – | mean of ten x tasks/5 | (s1+s2+s3+(s4+s5+s6)/3+s7+s8+(s9+s10) tasks/5)/8 |
//!
//! Text comparison means that a column with any decimal point (`1.0`) matches nothing.

use super::density::DensityTable;
use super::mass::{MassInput, object_weight};
use super::regression;
use super::rule_set::{RuleSet, Scores};
use corsmal_models::scores::ConfusionMatrix;

use crate::dataset::{Annotation, Annotations, Filling, FillingLevel, FillingType};
use crate::error::{CcmError, Result};
use crate::submission::{Estimates, Submission};

/// Scores a submission.
///
/// `containers` restricts the scoring to the recordings of some containers. `baseline` stands in
/// for whole tasks that the submission does not address, in the filling mass only.
///
/// # Errors
/// [`CcmError`] when the submission or the baseline has missing or extra rows, or when annotations
/// needed by the rules are withheld.
pub fn evaluate(
    submission: &Submission,
    annotations: &Annotations,
    baseline: &Submission,
    rules: RuleSet,
    containers: Option<&[u8]>,
) -> Result<Scores> {
    let wanted = match containers {
        Some(list) => annotations.of_containers(list),
        None => annotations.clone(),
    };
    let aligned = submission.align(&wanted, annotations)?;
    let truth = Truth::new(&wanted, &aligned, rules)?;
    let input = MassInput::new(&aligned, &baseline.align(&wanted, annotations)?);
    let mut scores = match rules {
        RuleSet::Paper => truth.paper(&aligned, &input),
        RuleSet::Toolkit202010 => truth.toolkit_2020(&aligned, &input)?,
        RuleSet::Toolkit202111 | RuleSet::Toolkit => truth.toolkit(&aligned, &input, rules)?,
    };
    for (_, value) in &mut scores.values {
        // Adding zero turns the -0 of an empty sum into 0.
        *value = *value * 100.0 + 0.0;
    }
    if let Some(error) = (rules == RuleSet::Paper).then(|| truth.weight_error(&aligned, &input)) {
        scores.values.extend(error.map(|e| ("weight_error_N", e)));
    }
    scores.notes.extend(aligned.notes);
    if input.addressed < 3 {
        scores.notes.push(format!(
            "addresses {} of the 3 tasks of the filling mass; the rest is taken from {}",
            input.addressed,
            baseline.path.display()
        ));
    }
    Ok(scores)
}

/// The annotated columns.
struct Truth<'a> {
    annotations: &'a Annotations,
    fillings: Vec<Filling>,
    capacity: Vec<f64>,
    filling_mass: Vec<f64>,
}

impl<'a> Truth<'a> {
    fn new(annotations: &'a Annotations, s: &Submission, rules: RuleSet) -> Result<Self> {
        let refuse = |text: String| {
            Err(CcmError::Request(format!("{}: {text}", annotations.path.display())))
        };
        if annotations.rows.is_empty() {
            return refuse("no annotated recording is left to score".into());
        }
        // What an estimate is compared with: an amount that is withheld would score it, too.
        let is_toolkit = matches!(rules, RuleSet::Toolkit | RuleSet::Toolkit202111);
        let sizes = [&s.width_top, &s.width_bottom, &s.height];
        let by_size = is_toolkit && sizes.iter().any(|estimates| estimates.addressed());
        let by_mass = is_toolkit && s.container_mass.addressed();
        let lacking = |row: &Annotation| {
            let size = row.dimensions.as_ref().map(|d| [d.width_top, d.width_bottom, d.height]);
            [
                (row.filling.is_none(), "filling"),
                (row.capacity_ml <= 0.0, "capacity"),
                (row.filling_mass_g < 0.0 && rules != RuleSet::Paper, "filling mass"),
                (row.density < 0.0 && is_toolkit, "filling density"),
                (row.container_mass_g <= 0.0 && by_mass, "container mass"),
                (by_size && size.is_none_or(|size| size.iter().any(|s| *s < 0.0)), "size"),
            ]
            .into_iter()
            .find_map(|(is_lacking, what)| is_lacking.then_some(what))
        };
        let mut fillings = Vec::with_capacity(annotations.rows.len());
        for row in &annotations.rows {
            let what = lacking(row);
            let (Some(filling), None) = (row.filling, what) else {
                return refuse(format!(
                    "the {} of container {} is withheld, so rules '{}' cannot be applied; \
                     choose containers with published labels",
                    what.unwrap_or("filling"),
                    row.container,
                    rules.name()
                ));
            };
            fillings.push(filling);
        }
        Ok(Self {
            annotations,
            fillings,
            capacity: annotations.rows.iter().map(|r| r.capacity_ml).collect(),
            filling_mass: annotations.rows.iter().map(|r| r.filling_mass_g).collect(),
        })
    }

    /// A container of which a mass is withheld.
    fn withheld_mass(&self, is_withheld: impl Fn(&Annotation) -> bool) -> Option<u8> {
        self.annotations.rows.iter().find(|row| is_withheld(row)).map(|row| row.container)
    }

    fn level_f1(&self, estimate: impl Fn(usize) -> Option<usize>) -> f64 {
        let pairs = self.fillings.iter().enumerate();
        ConfusionMatrix::new(
            FillingLevel::ALL.len(),
            pairs.map(|(i, f)| (f.level() as usize, estimate(i))),
        )
        .weighted_f1()
    }

    fn kind_f1(&self, estimate: impl Fn(usize) -> Option<usize>) -> f64 {
        let pairs = self.fillings.iter().enumerate();
        ConfusionMatrix::new(
            FillingType::ALL.len(),
            pairs.map(|(i, f)| (f.kind() as usize, estimate(i))),
        )
        .weighted_f1()
    }

    fn joint_f1(&self, estimate: impl Fn(usize) -> Option<usize>) -> f64 {
        let pairs = self.fillings.iter().enumerate();
        ConfusionMatrix::new(Filling::COUNT, pairs.map(|(i, f)| (f.joint(), estimate(i))))
            .weighted_f1()
    }

    fn paper(&self, s: &Submission, input: &MassInput) -> Scores {
        let mut values = vec![
            ("T1", self.level_f1(|i| level_class(s.level.values[i]))),
            ("T2", self.kind_f1(|i| kind_class(s.kind.values[i]))),
            ("T3", regression::amount(&self.capacity, &s.capacity.values)),
        ];
        let withheld = self.withheld_mass(|row| row.filling_mass_g < 0.0);
        if withheld.is_none() {
            // exp(-m) would be more than 1.
            let none = |mass: f64| if mass < 0.0 { -1.0 } else { mass };
            let masses: Vec<f64> = self.masses_of_estimates(input).into_iter().map(none).collect();
            let mass = regression::filling_mass(&self.filling_mass, &masses);
            values.push(("mass", mass * input.addressed as f64 / 3.0));
        }
        let joint = |i| joint_class(kind_class(s.kind.values[i]), level_class(s.level.values[i]));
        values.push(("joint", self.joint_f1(joint)));
        let mut scores = self.scores(RuleSet::Paper, values);
        scores.notes.extend(
            withheld.map(|c| format!("no score of the mass: that of container {c} is withheld")),
        );
        scores
    }

    fn toolkit_2020(&self, s: &Submission, input: &MassInput) -> Result<Scores> {
        let densities = DensityTable::average_2020();
        let unknown = |c: u8| densities.density(c, FillingType::None).is_none();
        if let Some(row) = self.annotations.rows.iter().find(|r| unknown(r.container)) {
            return Err(CcmError::Request(format!(
                "rules 'toolkit-2020-10' have densities for containers 1 to 9 only, not for {}; \
                 use --containers 1-9 or rules 'paper'",
                row.container
            )));
        }
        let masses = self.masses_by_estimated_type(input, &densities, Some(0.0));
        let mass = regression::filling_mass(&self.filling_mass, &masses) + 0.00493;
        // Labels are compared as text with however the annotations are written.
        let percent = self.annotations.levels_in_percent;
        let level = |value: f64| match (value, percent) {
            (0.0, _) => Some(0),
            (1.0, false) | (50.0, true) => Some(1),
            (2.0, false) | (90.0, true) => Some(2),
            _ => None,
        };
        Ok(self.scores(
            RuleSet::Toolkit202010,
            vec![
                ("T1", self.level_f1(|i| as_text(&s.level, i).and_then(level))),
                ("T2", self.kind_f1(|i| as_text(&s.kind, i).and_then(kind_class))),
                ("T3", regression::amount(&self.capacity, &s.capacity.values)),
                ("mass", mass * input.addressed as f64 / 3.0),
            ],
        ))
    }

    fn toolkit(&self, s: &Submission, input: &MassInput, rules: RuleSet) -> Result<Scores> {
        let rows = &self.annotations.rows;
        let s1 = self.level_f1(|i| as_text(&s.level, i).and_then(level_class));
        let s2 = self.kind_f1(|i| as_text(&s.kind, i).and_then(kind_class));
        let s3 = regression::amount(&self.capacity, &s.capacity.values);
        let size = |estimates: &Estimates, pick: fn(&crate::dataset::Dimensions) -> f64| {
            let truth: Vec<_> =
                rows.iter().map(|r| r.dimensions.as_ref().map_or(-1.0, pick)).collect();
            regression::dimension(&truth, &estimates.values)
        };
        let s4 = size(&s.width_top, |d| d.width_top);
        let s5 = size(&s.width_bottom, |d| d.width_bottom);
        let s6 = size(&s.height, |d| d.height);
        let mass: Vec<_> = rows.iter().map(|r| r.container_mass_g).collect();
        let s7 = regression::amount(&mass, &s.container_mass.values);

        // The estimated type never enters: the annotated density decides, so that empty
        // containers are right whatever is estimated.
        let masses = input.masses(|row, _| Some(rows[row].density));
        let offset = self.offset(rules)?;
        let weight = match (input.addressed, rules) {
            (0, _) => 0.0,
            (_, RuleSet::Toolkit202111) => 1.0,
            (n, _) => n as f64 / 3.0,
        };
        let s8 = (regression::filling_mass(&self.filling_mass, &masses) + offset) * weight;
        let s9 = regression::safety(&s.safety.values);
        let s10 = regression::delivery(&s.distance.values, &s.angle.values);

        let tasks = [&s.level, &s.kind, &s.capacity, &s.container_mass]
            .into_iter()
            .map(Estimates::addressed)
            .chain([[&s.width_top, &s.width_bottom, &s.height].iter().any(|e| e.addressed())])
            .filter(|&addressed| addressed)
            .count() as f64
            / 5.0;
        let overall = if rules == RuleSet::Toolkit202111 {
            (s1 + s2 + s3 + s4 + s5 + s6 + s7 + s8 + s9 + s10) / 10.0 * tasks
        } else {
            (s1 + s2 + s3 + (s4 + s5 + s6) / 3.0 + s7 + s8 + (s9 + s10) * tasks) / 8.0
        };
        // Levels 1 and 2 count as 50 and 90 only if some row says 2: without any "full", half-full
        // rows match nothing.
        let some_full = s.level.values.iter().copied().fold(f64::MIN, f64::max) == 2.0;
        let joint_level = |value: f64| match value {
            1.0 | 2.0 if !some_full => None,
            other => level_class(other),
        };
        let joint = self.joint_f1(|i| {
            joint_class(kind_class(s.kind.values[i]), joint_level(s.level.values[i]))
        });
        Ok(self.scores(
            rules,
            vec![
                ("s1", s1),
                ("s2", s2),
                ("s3", s3),
                ("s4", s4),
                ("s5", s5),
                ("s6", s6),
                ("s7", s7),
                ("s8", s8),
                ("s9", s9),
                ("s10", s10),
                ("overall", overall),
                ("JFLT", joint),
                ("CMD", s3 / 2.0 + (s4 + s5 + s6) / 6.0),
            ],
        ))
    }

    /// What the evaluators add to the filling mass score so that the truth scores 100.
    fn offset(&self, rules: RuleSet) -> Result<f64> {
        let containers = self.annotations.rows.iter().map(|r| r.container);
        let (first, last) = containers.fold((u8::MAX, 0), |(a, b), c| (a.min(c), b.max(c)));
        match (first, last) {
            _ if rules == RuleSet::Toolkit202111 => Ok(0.047505),
            (1.., ..=9) => Ok(0.047505),
            (10.., ..=12) => Ok(0.004339),
            (10.., ..=15) => Ok(0.004338),
            _ => Err(CcmError::Request(format!(
                "rules 'toolkit' score either training containers (1 to 9) or test containers \
                 (10 to 15) at a time; these are {first} to {last}"
            ))),
        }
    }

    /// Masses by the estimated type; `missing` is the density where there is none.
    fn masses_by_estimated_type(
        &self,
        input: &MassInput,
        densities: &DensityTable,
        missing: Option<f64>,
    ) -> Vec<f64> {
        input.masses(|row, kind| {
            let Some(kind) = kind else { return missing };
            let container = self.annotations.rows[row].container;
            let kind = FillingType::ALL.get(kind);
            Some(kind.and_then(|&kind| densities.density(container, kind)).unwrap_or(0.0))
        })
    }

    /// Masses of rows whose level, capacity and type are all estimated.
    fn masses_of_estimates(&self, input: &MassInput) -> Vec<f64> {
        let densities = DensityTable::with_annotations(self.annotations);
        self.masses_by_estimated_type(input, &densities, None)
    }

    /// Mean absolute error of the object's weight in N over rows with both masses estimated.
    fn weight_error(&self, s: &Submission, input: &MassInput) -> Option<f64> {
        let is_withheld =
            |row: &Annotation| row.filling_mass_g < 0.0 || row.container_mass_g <= 0.0;
        let is_addressed = input.addressed == 3 && s.container_mass.addressed();
        if !is_addressed || self.withheld_mass(is_withheld).is_some() {
            return None;
        }
        let masses = self.masses_of_estimates(input);
        let errors: Vec<f64> = (0..masses.len())
            .filter(|&i| masses[i] > -1.0 && s.container_mass.values[i] > -1.0)
            .map(|i| {
                let row = &self.annotations.rows[i];
                let truth = object_weight(row.container_mass_g, row.filling_mass_g);
                (object_weight(s.container_mass.values[i], masses[i]) - truth).abs()
            })
            .collect();
        (!errors.is_empty()).then(|| errors.iter().sum::<f64>() / errors.len() as f64)
    }

    fn scores(&self, rules: RuleSet, values: Vec<(&'static str, f64)>) -> Scores {
        Scores { rules, rows: self.fillings.len(), values, notes: Vec::new() }
    }
}

/// The value of a label where the evaluators compare text: nothing in a column of floats.
fn as_text(estimates: &Estimates, row: usize) -> Option<f64> {
    (!estimates.float).then(|| estimates.values[row])
}

fn kind_class(value: f64) -> Option<usize> {
    FillingType::from_number(value as i64).map(|k| k as usize)
}

fn level_class(value: f64) -> Option<usize> {
    FillingLevel::from_number(value as i64).map(|l| l as usize)
}

fn joint_class(kind: Option<usize>, level: Option<usize>) -> Option<usize> {
    Filling::new(FillingType::ALL[kind?], FillingLevel::ALL[level?]).map(Filling::joint)
}
