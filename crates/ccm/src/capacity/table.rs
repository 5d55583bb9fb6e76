//! The table of estimates: one row per recording.

use std::collections::HashMap;
use std::path::Path;

use corsmal_files::draft;
use corsmal_vision::lode::PRIOR_ML;

use super::methods::Estimate;
use super::options::{CapacityOptions, Method};
use super::problem::Problem;
use crate::dataset::{Dimensions, Subset};
use crate::error::{CcmError, Result};
use crate::predictions::{Named, read_capacities, row_name};
use crate::submission::{RowKey, SubmissionRow};
use crate::table::Table;

/// Columns of the table; the first two are those of M5's published files.
const HEADER: [&str; 16] = [
    "fileName",
    "capacity[mL]",
    "low[mL]",
    "high[mL]",
    "height[mm]",
    "width[mm]",
    "width top[mm]",
    "width bottom[mm]",
    "frames",
    "execution[ms]",
    "method",
    "status",
    "reason",
    "tool_version",
    "config_hash",
    "part",
];

/// What became of a recording.
#[derive(Clone, Debug)]
pub struct Row {
    /// The recording.
    pub key: RowKey,
    /// Its part of the data set, in which its id is its own.
    pub part: Subset,
    /// The estimate, or why there is none.
    pub estimate: std::result::Result<Estimate, Problem>,
    /// Time it took, in ms.
    pub execution_ms: f64,
}

impl Row {
    /// `ok`, `prior` for a substitute, `none` where nothing can be measured, `failed` for damaged files.
    pub fn status(&self) -> &'static str {
        match &self.estimate {
            Ok(Estimate { substitute: None, .. }) => "ok",
            Ok(_) => "prior",
            Err(Problem::Missing(_)) => "none",
            Err(Problem::Damaged(_)) => "failed",
        }
    }

    /// Capacity in mL, -1 without an estimate.
    pub fn capacity(&self) -> f64 {
        self.estimate.as_ref().map_or(-1.0, |e| e.capacity)
    }

    fn cells(&self, method: &str, config_hash: &str) -> Vec<String> {
        let number = |v: Option<f64>| v.map_or(String::new(), |v| v.to_string());
        let estimate = self.estimate.as_ref().ok();
        let sizes = estimate.and_then(|e| e.sizes);
        let band = estimate.and_then(|e| e.band);
        let reason = match &self.estimate {
            Ok(estimate) => estimate.substitute.clone().unwrap_or_default(),
            Err(Problem::Missing(reason) | Problem::Damaged(reason)) => reason.clone(),
        };
        vec![
            file_name(self.key),
            self.capacity().to_string(),
            number(band.map(|b| b[0])),
            number(band.map(|b| b[1])),
            number(sizes.map(|s| s.height)),
            number(sizes.map(|s| s.width)),
            number(sizes.map(|s| s.width_top)),
            number(sizes.map(|s| s.width_bottom)),
            estimate.map_or("0".into(), |e| e.frames.to_string()),
            format!("{:.1}", self.execution_ms),
            method.into(),
            self.status().into(),
            reason,
            env!("CARGO_PKG_VERSION").into(),
            config_hash.into(),
            self.part.name().into(),
        ]
    }
}

/// `id10_0003.png` as M5 names recordings, `id000123.png` for those of the flat release.
pub(super) fn file_name(key: RowKey) -> String {
    match key {
        RowKey::Sequence(container, sequence) => format!("id{container}_{sequence:04}.png"),
        RowKey::Id(id) => format!("id{id:06}.png"),
    }
}

/// Median mass in g of the nine training containers: what is written where none is measured.
pub const PRIOR_MASS_G: f64 = 15.0;

/// What a table says of a recording; `None` where it has no estimate or no such column.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Capacity in mL.
    pub capacity_ml: Option<f64>,
    /// Whether it stands for a measurement: a row of status `prior`, or M5's published prior.
    pub is_prior: bool,
    /// Widths and height in mm.
    pub dimensions: Option<Dimensions>,
    /// Time it took, in ms.
    pub execution_ms: Option<f64>,
}

impl Measured {
    /// Fills in a recording's prediction.
    pub fn complete(&self, prediction: &mut SubmissionRow) {
        prediction.capacity_ml = self.capacity_ml;
        prediction.dimensions = self.dimensions;
        prediction.execution_ms = self.execution_ms;
    }
}

/// Reads a table of [`write()`], or another with the columns `fileName` and `capacity[mL]`.
///
/// # Errors
/// As [`read_capacities`], and for cells that are no numbers.
pub fn read(path: &Path) -> Result<HashMap<Named, Measured>> {
    let capacities = read_capacities(path)?;
    let table = Table::read(path)?;
    let has = |name: &str| table.header().iter().any(|h| h == name);
    let names = ["width top[mm]", "width bottom[mm]", "height[mm]", "execution[ms]"];
    let columns = if names.iter().all(|name| has(name)) {
        let columns = names.map(|name| table.column(name));
        Some(columns.into_iter().collect::<Result<Vec<_>>>()?)
    } else {
        None
    };
    let file = table.column("fileName")?;
    let mut measured = HashMap::with_capacity(capacities.len());
    for row in 0..table.rows() {
        let named = row_name(&table, row, file)?;
        let capacity_ml = capacities.get(&named).copied().flatten();
        let cell = |i: usize| match &columns {
            Some(columns) if !table.text(row, columns[i]).is_empty() => {
                table.number(row, columns[i]).map(Some)
            }
            _ => Ok(None),
        };
        let sizes = [cell(0)?, cell(1)?, cell(2)?];
        let dimensions = match sizes {
            [Some(width_top), Some(width_bottom), Some(height)] => {
                Some(Dimensions { width_top, width_bottom, height })
            }
            _ => None,
        };
        let is_prior = is_prior(&table, row, capacity_ml);
        let execution_ms = cell(3)?;
        measured.insert(named, Measured { capacity_ml, is_prior, dimensions, execution_ms });
    }
    Ok(measured)
}

/// Whether a capacity stands for a measurement.
fn is_prior(table: &Table, row: usize, capacity_ml: Option<f64>) -> bool {
    let says_so = table.find("status").is_some_and(|status| table.text(row, status) == "prior");
    capacity_ml.is_some() && (says_so || capacity_ml == Some(PRIOR_ML))
}

/// Reads the measured capacities of such a table; `None` for a recording without. Other columns are not read.
///
/// # Errors
/// As [`read_capacities`].
pub(super) fn read_measured(path: &Path) -> Result<HashMap<Named, Option<f64>>> {
    let mut capacities = read_capacities(path)?;
    let table = Table::read(path)?;
    let file = table.column("fileName")?;
    for row in 0..table.rows() {
        if let Some(capacity) = capacities.get_mut(&row_name(&table, row, file)?) {
            *capacity = capacity.filter(|&ml| !is_prior(&table, row, Some(ml)));
        }
    }
    Ok(capacities)
}

/// Between the methods of a combined table.
pub(super) const AND: &str = "+";

/// The methods that made a table of [`write()`], or of several such combined, as far as it says; of those
/// recordings only that are of this part, or may be, if one is given.
pub(crate) fn methods_of(path: &Path, part: Option<Subset>) -> Result<Vec<Method>> {
    let table = Table::read(path)?;
    let Some(column) = table.find("method") else { return Ok(Vec::new()) };
    let file = table.column("fileName")?;
    let mut found = Vec::new();
    for row in 0..table.rows() {
        let own = row_name(&table, row, file)?.part;
        if own.zip(part).is_some_and(|(own, part)| own != part) {
            continue;
        }
        for name in table.text(row, column).split(AND) {
            let method = Method::ALL.into_iter().find(|method| method.name() == name);
            found.extend(method.filter(|method| !found.contains(method)));
        }
    }
    Ok(found)
}

/// Writes the table of what [`run`](super::run) made by these options; the file appears only when complete.
///
/// # Errors
/// [`CcmError`] when it cannot be written.
pub fn write(path: &Path, options: &CapacityOptions, rows: &[Row]) -> Result<()> {
    let config_hash = options.config_hash();
    let mut writer = csv::Writer::from_writer(Vec::new());
    let fault = |e: csv::Error| CcmError::Request(format!("{}: {e}", path.display()));
    writer.write_record(HEADER).map_err(fault)?;
    for row in rows {
        writer.write_record(row.cells(options.method.name(), &config_hash)).map_err(fault)?;
    }
    let bytes =
        writer.into_inner().map_err(|e| CcmError::Request(format!("{}: {e}", path.display())))?;
    draft::write(path, &bytes).map_err(CcmError::Write)
}
