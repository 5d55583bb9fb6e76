//! Prediction files of other methods.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::results::{Estimate, Rows, Target};
use crate::capacity;
use crate::dataset::{Container, Dimensions, Subset};
use crate::error::{CcmError, Result};
use crate::predictions::Named;
use crate::submission::{RowKey, Submission, listed};
use crate::table::Table;

/// Predictions that join the tables.
pub struct Added {
    name: String,
    path: PathBuf,
    by_name: HashMap<Named, Estimate>,
}

/// Predictions for the parts of a data set that their file covers.
pub(super) struct Placed {
    /// Name in the tables.
    pub(super) name: String,
    pub(super) training: Option<Vec<Estimate>>,
    /// For each test part of the data set.
    pub(super) tests: Vec<Option<Vec<Estimate>>>,
}

impl Placed {
    /// Whether any part is covered.
    pub(super) fn is_any(&self) -> bool {
        self.training.is_some() || self.tests.iter().any(Option::is_some)
    }

    /// How many capacities are priors or missing, in words; `None` where all are estimates.
    pub(super) fn unmeasured(&self) -> Option<String> {
        let parts = self.training.iter().chain(self.tests.iter().flatten());
        let all: Vec<&Estimate> = parts.flatten().collect();
        let priors = all.iter().filter(|estimate| estimate.has_prior_capacity).count();
        let missing = all.iter().filter(|estimate| estimate.capacity_ml.is_none()).count();
        (priors + missing > 0).then(|| {
            let (name, count) = (&self.name, all.len());
            format!("{name}: of {count} capacities, priors instead of estimates: {priors}; missing: {missing}.")
        })
    }

    /// Whether it estimates any capacity.
    pub(super) fn has_capacities(&self) -> bool {
        let mut parts = self.training.iter().chain(self.tests.iter().flatten());
        parts.any(|part| part.iter().any(|estimate| estimate.capacity_ml.is_some()))
    }
}

impl Added {
    /// Reads a submission in an official format, or capacity estimates with columns `fileName`
    /// (`id10_0000.png`: container and sequence number) and `capacity[mL]`.
    ///
    /// # Errors
    /// [`CcmError`] as [`Submission::read`].
    pub fn read(name: &str, path: &Path) -> Result<Self> {
        let table = Table::read(path)?;
        let by_name = if table.find("fileName").is_some() {
            return Self::capacities(name, path);
        } else {
            submission(&Submission::from_table(&table)?)
        };
        Ok(Self { name: name.to_string(), path: path.to_path_buf(), by_name })
    }

    /// Reads a table of `corsmal-feat capacity`, or another with the columns `fileName` and `capacity[mL]`.
    ///
    /// # Errors
    /// [`CcmError`] as [`capacity::read`].
    pub fn capacities(name: &str, path: &Path) -> Result<Self> {
        let estimate = |measured: capacity::Measured| Estimate {
            capacity_ml: measured.capacity_ml,
            has_prior_capacity: measured.is_prior,
            dimensions: measured.dimensions,
            execution_ms: measured.execution_ms,
            ..Estimate::default()
        };
        let rows = capacity::read(path)?.into_iter();
        let by_name = rows.map(|(named, measured)| (named, estimate(measured))).collect();
        Ok(Self { name: name.to_string(), path: path.to_path_buf(), by_name })
    }

    /// The estimates for each part of a data set, where there are any.
    ///
    /// # Errors
    /// [`CcmError::Rows`] where a part is covered only partly, and for rows that a part of the data
    /// set cannot have; [`CcmError::Request`] where ids may mean either of two parts.
    pub(super) fn place(&self, rows: &Rows) -> Result<Placed> {
        let mut parts = vec![Part::new(self, Subset::Training, &rows.training)];
        parts.extend(rows.tests.iter().map(|t| Part::new(self, t.subset, &t.rows)));
        let nowhere = |named: &Named| matches!(named.key, RowKey::Id(_)) && named.part.is_none();
        if self.by_name.keys().any(nowhere) {
            self.choose(&mut parts)?;
        }
        for part in &parts {
            self.refuse_unless_whole(part)?;
        }
        let mut found = parts.into_iter().map(Part::estimates);
        Ok(Placed {
            name: self.name.clone(),
            training: found.next().flatten(),
            tests: found.collect(),
        })
    }

    /// Ids start at 0 in every part: a file of ids is about the one part that it fits, or fits best
    /// by its number of rows.
    fn choose(&self, parts: &mut Vec<Part<'_>>) -> Result<()> {
        let fits = |part: &Part<'_>| part.is_whole() && part.unknown.is_empty();
        let mut fitting: Vec<Subset> = parts.iter().filter(|p| fits(p)).map(|p| p.subset).collect();
        let count = self.by_name.len();
        if fitting.len() > 1 {
            let exact = |p: &&Part<'_>| fits(p) && p.targets.len() == count;
            let exact: Vec<Subset> = parts.iter().filter(exact).map(|p| p.subset).collect();
            fitting.retain(|&subset| match exact.is_empty() {
                true => size(subset) == count,
                false => exact.contains(&subset),
            });
        }
        match fitting.as_slice() {
            [one] => {
                let there = parts.iter().find(|p| p.subset == *one).map_or(0, |p| p.targets.len());
                // What fits in part may be of another part, of which recordings are missing.
                if count != there && count != size(*one) {
                    return Err(CcmError::Request(format!(
                        "{}: only {there} of its {count} ids are {} recordings of the data folder; give these alone, or \
                         all {} of the part",
                        self.path.display(),
                        one.name(),
                        size(*one)
                    )));
                }
                let others = parts.iter_mut().filter(|p| p.subset != *one);
                others.for_each(Part::clear);
                Ok(())
            }
            [] if !parts.iter().any(fits) => {
                // What is said of the part that is covered best says most.
                let best = parts.iter().map(Part::covered).max().unwrap_or(0);
                let others = parts.iter_mut().filter(|p| p.covered() < best);
                others.for_each(Part::clear);
                Ok(())
            }
            _ => Err(CcmError::Request(format!(
                "{}: its ids fit several parts of the data set; name recordings by container and \
                 sequence, or give a data folder without the other parts",
                self.path.display()
            ))),
        }
    }

    fn refuse_unless_whole(&self, part: &Part<'_>) -> Result<()> {
        let fault = |problem, keys: &[RowKey]| CcmError::Rows {
            path: self.path.clone(),
            problem,
            rows: listed(&keys.iter().collect::<Vec<_>>()),
            expected: format!("the {} {} recordings", part.targets.len(), part.subset.name()),
        };
        if !part.unknown.is_empty() && !part.targets.is_empty() {
            return Err(fault("rows that the data set lacks", &part.unknown));
        }
        if part.covered() > 0 && !part.is_whole() {
            let pairs = part.targets.iter().zip(&part.found);
            let missing: Vec<_> = pairs.filter(|(_, f)| f.is_none()).map(|(t, _)| t.key).collect();
            return Err(fault("missing rows", &missing));
        }
        Ok(())
    }
}

/// A part of the data set and what a file has for it.
struct Part<'a> {
    subset: Subset,
    targets: &'a [Target],
    /// For each target.
    found: Vec<Option<Estimate>>,
    /// Rows that name no recording of the part, there or not.
    unknown: Vec<RowKey>,
}

impl<'a> Part<'a> {
    fn new(added: &Added, subset: Subset, targets: &'a [Target]) -> Self {
        let of_part = added.by_name.iter().filter(|(n, _)| n.part.is_none_or(|p| p == subset));
        let mut left: HashMap<&RowKey, &Estimate> = of_part.map(|(n, e)| (&n.key, e)).collect();
        let mut take = |target: &Target| {
            let by_id = target.recording.id.map(RowKey::Id);
            left.remove(&target.key).or_else(|| left.remove(&by_id?)).cloned()
        };
        let found = targets.iter().map(&mut take).collect();
        let foreign = |key: &RowKey| match *key {
            RowKey::Id(id) => id as usize >= size(subset),
            // Containers above 15 are of other data sets, such as ACC's own.
            RowKey::Sequence(number, sequence) => Container::new(number)
                .filter(|container| container.subset() == subset)
                .is_some_and(|container| usize::from(sequence) >= container.recordings()),
        };
        let mut unknown: Vec<RowKey> = left.into_keys().copied().filter(foreign).collect();
        unknown.sort_unstable();
        Self { subset, targets, found, unknown }
    }

    fn covered(&self) -> usize {
        self.found.iter().flatten().count()
    }

    fn is_whole(&self) -> bool {
        self.covered() == self.targets.len()
    }

    fn clear(&mut self) {
        self.found = vec![None; self.targets.len()];
        self.unknown.clear();
    }

    fn estimates(self) -> Option<Vec<Estimate>> {
        self.found.into_iter().collect()
    }
}

/// Recordings of a whole part.
fn size(subset: Subset) -> usize {
    subset.containers().map(Container::recordings).sum()
}

fn submission(submission: &Submission) -> HashMap<Named, Estimate> {
    let class = |value: f64| (value >= 0.0).then_some(value as usize);
    let rows = submission.keys.iter().enumerate().map(|(row, &key)| {
        let level = match submission.level.values[row] {
            50.0 => 1.0,
            90.0 => 2.0,
            other => other,
        };
        let amount = |value: f64| (value > -1.0).then_some(value);
        let [width_top, width_bottom, height] =
            [&submission.width_top, &submission.width_bottom, &submission.height]
                .map(|column| amount(column.values[row]));
        let estimate = Estimate {
            kind: class(submission.kind.values[row]),
            level: class(level),
            capacity_ml: amount(submission.capacity.values[row]),
            container_mass_g: amount(submission.container_mass.values[row]),
            dimensions: width_top.zip(width_bottom).zip(height).map(|((top, bottom), height)| {
                Dimensions { width_top: top, width_bottom: bottom, height }
            }),
            ..Estimate::default()
        };
        (Named::alone(key), estimate)
    });
    rows.collect()
}
