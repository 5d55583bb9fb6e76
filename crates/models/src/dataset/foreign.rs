//! An `.npz` that `extract` did not write.

use std::collections::HashSet;
use std::path::Path;

use corsmal_files::npy::{Kind, NpyError};
use corsmal_files::npz::{NpzError, NpzFile};
use ndarray::Ix2;
use serde_json::Value;

use super::error::{DatasetError, Result};
use super::table::LabelledTable;

/// Where features and ids are in an `.npz` of another program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemberNames {
    /// the member with the features, rows x features
    pub x: String,
    /// the member with one id per row; else rows are numbered from 0
    pub ids: Option<String>,
}

impl Default for MemberNames {
    fn default() -> Self {
        Self { x: "X".into(), ids: None }
    }
}

/// Every one-dimensional member with as many values as there are rows is a label column.
pub(super) fn read(path: &Path, npz: &mut NpzFile, members: &MemberNames) -> Result<LabelledTable> {
    let fault = |reason: String| DatasetError::content(path, reason);
    if !npz.contains(&members.x) {
        let choices = corsmal_names::choices(&members.x, npz.names().iter().map(String::as_str));
        return Err(fault(format!("no member {:?} (--x): {choices}", members.x)));
    }
    let x = npz.f64(&members.x)?;
    let shape = x.shape().to_vec();
    let x = x.into_dimensionality::<Ix2>().map_err(|_| {
        fault(format!("member {:?} has shape {shape:?}, expected rows x features", members.x))
    })?;
    let mut columns: Vec<(String, Vec<String>)> = Vec::new();
    for name in npz.names().to_vec() {
        let header = match npz.header(&name) {
            // Objects and dates are of no use here, and nobody asked for them.
            Err(NpzError::Npy { source: NpyError::DType { .. } | NpyError::Pickled, .. })
                if members.ids.as_ref() != Some(&name) =>
            {
                continue;
            }
            header => header?,
        };
        if header.shape == [x.nrows() as u64] && header.dtype.kind != Kind::Complex {
            let values = match header.dtype.kind {
                Kind::Text | Kind::Bytes => npz.strings(&name)?,
                // With a point: 1.0 is not a class.
                Kind::Float => npz.f64(&name)?.iter().map(|v| format!("{v:?}")).collect(),
                _ => npz.integers(&name)?.iter().map(i128::to_string).collect(),
            };
            columns.push((name, values));
        }
    }
    let ids = match &members.ids {
        None => (0..x.nrows()).map(|row| row.to_string()).collect(),
        Some(name) => match columns.iter().find(|(column, _)| column == name) {
            Some((_, ids)) => ids.clone(),
            None => return Err(fault(format!("no member {name:?} (--ids) with one id per row"))),
        },
    };
    let mut seen = HashSet::new();
    if let Some(twice) = ids.iter().find(|id| !seen.insert(id.as_str())) {
        return Err(fault(format!("id {twice:?} occurs twice")));
    }
    let names_fit =
        npz.contains("feature_names") && npz.header("feature_names")?.shape == [x.ncols() as u64];
    let feature_names = if names_fit { npz.strings("feature_names")? } else { Vec::new() };
    Ok(LabelledTable {
        path: path.into(),
        x: x.as_standard_layout().into_owned(),
        feature_names,
        ids,
        outcomes: Vec::new(),
        config: Value::Null,
        config_hash: String::new(),
        columns,
    })
}
