//! One estimate from those of several frames.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};

use corsmal_files::draft;

use super::table::{self, file_name};
use crate::dataset::Subset;
use crate::error::{CcmError, Result};
use crate::predictions::Named;
use crate::submission::RowKey;

/// Writes the mean of the files' estimates of each recording, `prior` where none has one; what has the
/// status `prior`, equals M5's prior or `prior`, or is -1, is not an estimate. Returns the recordings and how many
/// have the prior.
///
/// # Errors
/// [`CcmError`] for unreadable files, recordings that a file lacks, a prior that is no capacity, and an output that
/// cannot be written.
pub fn combine_files(inputs: &[PathBuf], prior: f64, out: &Path) -> Result<(usize, usize)> {
    if !prior.is_finite() || (prior < 0.0 && prior != -1.0) {
        return Err(CcmError::Request(format!(
            "a prior of {prior}; expected a number of mL of at least 0, or -1 for none"
        )));
    }
    let mut estimates: BTreeMap<Named, Vec<f64>> = BTreeMap::new();
    let (mut tables, mut methods) = (Vec::with_capacity(inputs.len()), Vec::new());
    for path in inputs {
        let table = table::read_measured(path)?;
        for (&key, measured) in &table {
            estimates.entry(key).or_default().extend(measured.filter(|&ml| ml != prior));
        }
        for method in table::methods_of(path, None)? {
            if !methods.contains(&method.name()) {
                methods.push(method.name());
            }
        }
        tables.push((path, table));
    }
    for (path, table) in &tables {
        let missing: Vec<_> = estimates.keys().filter(|key| !table.contains_key(key)).collect();
        if let Some(first) = missing.first() {
            return Err(CcmError::Rows {
                path: path.to_path_buf(),
                problem: "missing rows",
                rows: format!("{first} ({} in all)", missing.len()),
                expected: format!("{} recordings of the other files", estimates.len()),
            });
        }
    }
    // M5's columns, what became of a recording and by which methods; and the part of an id, which is one of
    // every part.
    let by_part = |named: &Named| matches!(named.key, RowKey::Id(_)) && named.part.is_some();
    let several = estimates.keys().any(by_part);
    let mut text = String::from("fileName,capacity[mL],status,method");
    let methods = methods.join(table::AND);
    text += if several { ",part\n" } else { "\n" };
    let mut without = 0;
    for (named, values) in &estimates {
        let (value, status) = if values.is_empty() {
            without += 1;
            (prior, if prior == -1.0 { "none" } else { "prior" })
        } else {
            (values.iter().sum::<f64>() / values.len() as f64, "ok")
        };
        let _ = write!(text, "{},{value},{status},{methods}", file_name(named.key));
        if several {
            let _ = write!(text, ",{}", named.part.map_or("", Subset::name));
        }
        text.push('\n');
    }
    draft::write(out, text.as_bytes()).map_err(CcmError::Write)?;
    Ok((estimates.len(), without))
}
