//! An `.npz` or a Parquet table that `extract` did not write, or that another program wrote over.

use std::path::Path;

use corsmal_files::feature_file::FeatureFileError;
use corsmal_files::npy::{Kind, NpyError};
use corsmal_files::npz::{NpzError, NpzFile};
use corsmal_files::parquet::{NumericTable, ParquetFile};
use corsmal_files::statistic;
use corsmal_files::table::{ID, ID_NAMES, RESERVED};
use ndarray::{Axis, Ix2};
use serde_json::Value;

use super::error::{DatasetError, Result};
use super::ids::not_an_id;
use super::table::LabelledTable;

/// Where features and ids are in a file of another program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MemberNames {
    /// in an `.npz`, the member with the features, rows x features
    pub x: String,
    /// the member or the column with one id per row; else one called `id` or `ids` that has another
    /// value in every row; else rows are numbered from 0
    pub ids: Option<String>,
}

impl Default for MemberNames {
    fn default() -> Self {
        Self { x: "X".into(), ids: None }
    }
}

/// The member that names the features.
const FEATURE_NAMES: &str = "feature_names";

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
    let mut unread = Vec::new();
    for name in npz.names().to_vec() {
        let header = match npz.header(&name) {
            // Objects and dates are of no use here; they are said where one is asked for.
            Err(NpzError::Npy {
                source: source @ (NpyError::DType { .. } | NpyError::Pickled),
                ..
            }) if members.ids.as_ref() != Some(&name) => {
                unread.push((name, source.to_string()));
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
        } else if name != members.x && name != FEATURE_NAMES {
            let (shape, rows) = (&header.shape, x.nrows());
            let reason = match header.dtype.kind {
                Kind::Complex => "has complex numbers, which are no labels".into(),
                _ => format!("has shape {shape:?}, expected [{rows}], one value for each row"),
            };
            unread.push((name, reason));
        }
    }
    let ids = match &members.ids {
        None => take_ids(&mut columns),
        Some(name) => match columns.iter().position(|(column, _)| column == name) {
            Some(at) => Some(columns.remove(at).1),
            None => {
                let why = unread.iter().find(|(member, _)| member == name);
                let why = why.map(|(_, why)| format!(": it {why}")).unwrap_or_default();
                return Err(fault(format!("no member {name:?} (--ids) with one id per row{why}")));
            }
        },
    };
    let (ids, numbered) = named(path, ids, x.nrows())?;
    let names_fit =
        npz.contains(FEATURE_NAMES) && npz.header(FEATURE_NAMES)?.shape == [x.ncols() as u64];
    let feature_names = if names_fit { npz.strings(FEATURE_NAMES)? } else { Vec::new() };
    Ok(LabelledTable {
        path: path.into(),
        x: x.as_standard_layout().into_owned(),
        feature_names,
        ids,
        outcomes: Vec::new(),
        config: Value::Null,
        config_hash: String::new(),
        columns,
        unread,
        numbered,
        added: Vec::new(),
        unmatched: None,
    })
}

/// Columns that a message names.
const SHOWN: usize = 8;

/// Why a column of a Parquet table is neither feature nor label.
const UNREAD: &str = "has neither numbers nor text: dates, lists, decimals and bytes are not read";

/// Takes the column of ids out, if one of a usual name has another value in every row.
fn take_ids(columns: &mut Vec<(String, Vec<String>)>) -> Option<Vec<String>> {
    let at = |name: &str| {
        columns.iter().position(|(column, ids)| column == name && not_an_id(ids).is_none())
    };
    let at = ID_NAMES.into_iter().find_map(at)?;
    Some(columns.remove(at).1)
}

/// The ids, or numbers if rows have none, and whether it is so.
fn named(path: &Path, ids: Option<Vec<String>>, rows: usize) -> Result<(Vec<String>, bool)> {
    let Some(ids) = ids else {
        return Ok(((0..rows).map(|row| row.to_string()).collect(), true));
    };
    match not_an_id(&ids) {
        None => Ok((ids, false)),
        Some(reason) => Err(DatasetError::content(path, reason)),
    }
}

/// Columns of decimal numbers are features, all others label columns: so pandas and polars leave a
/// table of ours. Where all values of a column are whole, they may make it one of integers: names
/// such as `mfcc[0].mean` stay features.
pub(super) fn read_parquet(
    path: &Path,
    parquet: &ParquetFile,
    members: &MemberNames,
) -> Result<LabelledTable> {
    let fault = |reason: String| DatasetError::content(path, reason);
    if members.x != MemberNames::default().x {
        return Err(fault(
            "--x is for an .npz: the features of a Parquet table are columns".into(),
        ));
    }
    let NumericTable { ids, names, types, values, mut texts, skipped } =
        parquet.numbers().map_err(FeatureFileError::from)?;
    // Whole numbers with gaps become such a column; it is no feature.
    if members.ids.is_none() && names.iter().any(|name| name == ID) {
        let reason =
            format!("column {ID:?} has decimal numbers: write ids as text or whole numbers");
        return Err(fault(reason));
    }
    // pandas keeps its index in such a column.
    texts.retain(|(name, _)| !name.starts_with(RESERVED));
    let mut features = Vec::new();
    for (at, (name, kind)) in names.iter().zip(&types).enumerate() {
        if name.starts_with(RESERVED) {
        } else if kind.starts_with("float") || (kind.contains("int") && statistic::is_column(name))
        {
            features.push(at);
        } else {
            let whole = |v: &f64| if v.is_nan() { String::new() } else { format!("{v:.0}") };
            texts.push((name.clone(), values.column(at).iter().map(whole).collect()));
        }
    }
    if features.is_empty() {
        let columns = names.iter().chain(texts.iter().map(|(name, _)| name)).map(String::as_str);
        let found = columns.take(SHOWN).collect::<Vec<_>>().join(", ");
        let unread = skipped.iter().take(SHOWN).map(|name| format!("; {name:?} {UNREAD}"));
        return Err(fault(format!(
            "no column of decimal numbers, which would be features: {found}{}",
            unread.collect::<String>()
        )));
    }
    let ids = match (&members.ids, ids) {
        (None, Some(ids)) => Some(ids),
        (Some(name), Some(ids)) if name == ID => Some(ids),
        (None, None) => take_ids(&mut texts),
        (Some(name), _) => match texts.iter().position(|(column, _)| column == name) {
            Some(at) => Some(texts.remove(at).1),
            None => {
                return Err(fault(format!("no column {name:?} (--ids) of text or whole numbers")));
            }
        },
    };
    let (ids, numbered) = named(path, ids, values.nrows())?;
    Ok(LabelledTable {
        path: path.into(),
        x: values.select(Axis(1), &features),
        feature_names: features.iter().map(|at| names[*at].clone()).collect(),
        ids,
        outcomes: Vec::new(),
        config: Value::Null,
        config_hash: String::new(),
        columns: texts,
        unread: skipped.into_iter().map(|name| (name, UNREAD.into())).collect(),
        numbered,
        added: Vec::new(),
        unmatched: None,
    })
}
