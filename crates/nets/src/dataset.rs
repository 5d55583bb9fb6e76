//! Items and their columns from an `.npz`.
//!
//! | member | what |
//! |---|---|
//! | `X` `[rows, numbers]` with `offsets` `[items + 1]` | sequences one after another |
//! | `X` `[items, …]` without `offsets` | items of one shape, in PyTorch's layout |
//! | `view` `[items]` | which input of the network an item is; those of one recording are joined |
//! | any other of one dimension, one value for each item, unless its name begins with `__` | a column |
//!
//! Ids are the member `ids`, else `id` where it has another value for each item, else
//! `container/sequence` where both are there, else numbers.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use corsmal_files::draft::Draft;
use corsmal_files::npy::{DType, Header, Kind};
use corsmal_files::npz::{Compression, NpzError, NpzFile, NpzWriter};
use corsmal_files::table::ID;
use thiserror::Error;

use crate::batch::{Batch, Shape};
use crate::error::NetError;
use crate::items::{Column, Items};
use crate::network::Network;

/// Items with the columns that came with them.
#[derive(Clone, Debug)]
pub struct Dataset {
    /// one for each item, all different
    pub ids: Vec<String>,
    /// columns as text
    pub columns: Vec<(String, Vec<String>)>,
    /// what the network takes
    pub items: Items,
}

/// Why a file holds no items of a network.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ItemsError {
    /// The file cannot be read.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// Its members are not what is expected.
    #[error("{path}: {reason}")]
    Content {
        /// the file
        path: String,
        /// why
        reason: String,
    },
    /// The network does not take them.
    #[error("{path}: {source}")]
    Items {
        /// the file
        path: String,
        /// why
        source: NetError,
    },
}

impl Dataset {
    /// Reads the items of a network.
    ///
    /// # Errors
    /// [`ItemsError`].
    pub fn read(path: &Path, network: &Network) -> Result<Self, ItemsError> {
        Self::read_members(path, network, "X", None)
    }

    /// The same with other names of `X` and `ids`.
    ///
    /// # Errors
    /// [`ItemsError`].
    pub fn read_members(
        path: &Path,
        network: &Network,
        x: &str,
        named: Option<&str>,
    ) -> Result<Self, ItemsError> {
        let mut npz = NpzFile::open(path)?;
        let refuse =
            |reason: String| ItemsError::Content { path: path.display().to_string(), reason };
        if let Some(name) = [Some(x), named].into_iter().flatten().find(|name| !npz.contains(name))
        {
            return Err(refuse(format!("no member {name}: there are {}", npz.names().join(", "))));
        }
        let array = npz.f32(x)?;
        let shape = array.shape().to_vec();
        let values: Vec<f32> = array.as_standard_layout().iter().copied().collect();
        let ends = match npz.contains("offsets") {
            true => {
                let (raw, rows) = (npz.integers("offsets")?, shape.first().copied().unwrap_or(0));
                Some(offsets(raw.into_iter(), rows).map_err(refuse)?)
            }
            false => None,
        };
        let count = ends.as_ref().map_or(shape.first().copied().unwrap_or(0), |e| e.len() - 1);
        let mut columns = columns(&mut npz, x, count)?;
        let column = match ends {
            Some(ends) => {
                let name = network.name();
                let Shape::Sequence { numbers: taken, .. } = network.inputs()[0].shape else {
                    return Err(refuse(format!("offsets: {name} takes no sequences")));
                };
                let &[_, numbers] = &shape[..] else {
                    let text = format!("{x} has shape {shape:?}, expected [rows, {taken}]");
                    return Err(refuse(text));
                };
                if numbers != taken {
                    return Err(refuse(format!(
                        "{x} has {numbers} numbers per row, {name} takes {taken}"
                    )));
                }
                Column { values, offsets: ends.into_iter().map(|e| e * numbers).collect() }
            }
            None => fixed(x, &shape, values, network).map_err(refuse)?,
        };
        let items = match columns.iter().position(|(name, _)| name == "view") {
            Some(at) if network.inputs().len() > 1 => {
                let views = columns.remove(at).1;
                views_of(&column, &views, &mut columns, network.inputs().len()).map_err(refuse)?
            }
            _ => Items { columns: vec![column] },
        };
        items
            .check(network)
            .map_err(|source| ItemsError::Items { path: path.display().to_string(), source })?;
        // Rows would have numbers for names, in silence.
        let has_ids = columns.iter().any(|(name, _)| name == "ids");
        if named.is_none() && npz.contains("ids") && !has_ids {
            return Err(refuse(format!("ids: expected a value for each of the {count} items")));
        }
        let ids = match named {
            Some(name) => columns.iter().find(|(n, _)| n == name).map(|(_, v)| v.clone()),
            None => Some(ids(&columns, items.len())),
        };
        let ids = ids.ok_or_else(|| {
            let name = named.unwrap_or_default();
            refuse(format!("{name}: expected a value for each of the {count} items"))
        })?;
        let mut seen = HashSet::new();
        if let Some(twice) = ids.iter().find(|id| !seen.insert(id.as_str())) {
            return Err(refuse(format!("id {twice:?} occurs twice")));
        }
        Ok(Self { ids, columns, items })
    }

    /// Writes the sequences of the only input, whole or not at all, as [`Dataset::read`] takes them;
    /// `about` says how they were made.
    ///
    /// # Errors
    /// [`ItemsError::Npz`]; a column with the name of another member.
    pub fn write_sequences(
        &self,
        path: &Path,
        numbers: usize,
        about: &str,
    ) -> Result<(), ItemsError> {
        require_names(path, self.columns.iter().map(|(name, _)| name.as_str()))?;
        let column = &self.items.columns[0];
        let io = |e| NpzError::io(path, e);
        let draft = Draft::create(path).map_err(io)?;
        let handle = draft.handle().map_err(io)?;
        let mut npz = NpzWriter::over(handle, path, Compression::Stored, Vec::new());
        npz.floats("X", &[column.values.len() / numbers, numbers], &column.values)?;
        let offsets = column.offsets.iter().map(|o| (o / numbers) as i64);
        let bytes: Vec<u8> = offsets.flat_map(i64::to_le_bytes).collect();
        let whole = DType { kind: Kind::Int, itemsize: 8, big_endian: false };
        let header = Header::new(whole, &[column.offsets.len()]);
        npz.array("offsets", &header, &bytes)?;
        npz.strings("ids", &self.ids)?;
        for (name, values) in &self.columns {
            npz.strings(name, values)?;
        }
        // Not `__meta__`: the layout of extracted features is another one.
        npz.text("__made__", about)?;
        npz.finish()?;
        draft.publish().map_err(io)?;
        Ok(())
    }

    /// A column by name.
    pub fn column(&self, name: &str) -> Option<&[String]> {
        self.columns.iter().find(|(n, _)| n == name).map(|(_, values)| values.as_slice())
    }
}

/// Refuses columns that are called as other members of a file of sequences are.
///
/// # Errors
/// Such a column.
pub fn require_names<'a>(
    path: &Path,
    columns: impl IntoIterator<Item = &'a str>,
) -> Result<(), ItemsError> {
    const MEMBERS: [&str; 4] = ["X", "offsets", "ids", "__made__"];
    match columns.into_iter().find(|name| MEMBERS.contains(name)) {
        None => Ok(()),
        Some(name) => {
            let reason = format!(
                "a label column is called {name}, like a member of the file: rename the column"
            );
            Err(ItemsError::Content { path: path.display().to_string(), reason })
        }
    }
}

fn offsets(raw: impl Iterator<Item = i128>, rows: usize) -> Result<Vec<usize>, String> {
    let ends: Vec<usize> = raw
        .map(|v| usize::try_from(v).map_err(|_| format!("offsets: {v} is not a row")))
        .collect::<Result<_, _>>()?;
    let ascending = ends.windows(2).all(|w| w[0] < w[1]);
    if ends.len() < 2 || ends[0] != 0 || !ascending || ends.last() != Some(&rows) {
        return Err(format!("offsets: expected numbers that rise from 0 to {rows}, the rows of X"));
    }
    Ok(ends)
}

/// Members of one dimension and this many values.
fn columns(
    npz: &mut NpzFile,
    x: &str,
    count: usize,
) -> Result<Vec<(String, Vec<String>)>, ItemsError> {
    let mut columns = Vec::new();
    for name in npz.names().to_vec() {
        if name == x || name == "offsets" || name.starts_with("__") {
            continue;
        }
        let Ok(header) = npz.header(&name) else { continue };
        if header.shape != [count as u64] {
            continue;
        }
        let values = match header.dtype.kind {
            Kind::Complex => continue,
            Kind::Text | Kind::Bytes => npz.strings(&name)?,
            // With a point: 1.0 is not a class.
            Kind::Float => npz.f64(&name)?.iter().map(|v| format!("{v:?}")).collect(),
            _ => npz.integers(&name)?.iter().map(i128::to_string).collect(),
        };
        columns.push((name, values));
    }
    Ok(columns)
}

/// Items of one shape, channels last.
fn fixed(x: &str, shape: &[usize], values: Vec<f32>, network: &Network) -> Result<Column, String> {
    let input = &network.inputs()[0];
    let items = shape.first().copied().unwrap_or(0);
    let each: usize = shape.iter().skip(1).product();
    if !input.takes(shape.get(1..).unwrap_or_default()) {
        return Err(format!("{x} has shape {shape:?}, expected {}", input.layout()));
    }
    let values = match input.shape {
        image @ Shape::Image { .. } => {
            Batch::from_channels_first(&values, image).values.into_values()
        }
        _ => values,
    };
    Ok(Column { values, offsets: (0..=items).map(|i| i * each).collect() })
}

/// One column for each view; recordings are told apart by all the other columns.
fn views_of(
    all: &Column,
    views: &[String],
    columns: &mut [(String, Vec<String>)],
    inputs: usize,
) -> Result<Items, String> {
    let mut places: HashMap<Vec<String>, usize> = HashMap::new();
    let mut first: Vec<usize> = Vec::new();
    let mut found: Vec<Vec<Option<usize>>> = Vec::new();
    for (row, view) in views.iter().enumerate() {
        let key: Vec<String> = columns.iter().map(|(_, values)| values[row].clone()).collect();
        let place = *places.entry(key).or_insert_with(|| {
            first.push(row);
            found.push(vec![None; inputs]);
            first.len() - 1
        });
        let number = view.parse::<usize>().ok().filter(|n| (1..=inputs).contains(n));
        let number = number.ok_or_else(|| format!("view {view}: expected 1 to {inputs}"))?;
        if found[place][number - 1].replace(row).is_some() {
            return Err(format!("row {row}: view {view} of its recording occurs twice"));
        }
    }
    let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    let names = names.join(", ");
    for (name, values) in columns.iter_mut() {
        *values = first.iter().map(|&row| values[row].clone()).collect();
        debug_assert!(name != "view");
    }
    let mut result = vec![Column { values: Vec::new(), offsets: vec![0] }; inputs];
    for (recording, rows) in found.iter().enumerate() {
        for (view, (row, column)) in rows.iter().zip(&mut result).enumerate() {
            let row = row.ok_or_else(|| {
                format!(
                    "recording {recording} has no view {}; rows of one recording have the same {names}",
                    view + 1
                )
            })?;
            column.values.extend_from_slice(&all.values[all.offsets[row]..all.offsets[row + 1]]);
            column.offsets.push(column.values.len());
        }
    }
    Ok(Items { columns: result })
}

fn ids(columns: &[(String, Vec<String>)], count: usize) -> Vec<String> {
    let find = |name: &str| columns.iter().find(|(n, _)| n == name).map(|(_, v)| v);
    let different = |ids: &&Vec<String>| ids.iter().collect::<HashSet<_>>().len() == count;
    let ids = find("ids").or_else(|| find(ID).filter(different));
    match (ids, find("container"), find("sequence")) {
        (Some(ids), ..) => ids.clone(),
        (None, Some(containers), Some(sequences)) => {
            containers.iter().zip(sequences).map(|(c, s)| format!("{c}/{s}")).collect()
        }
        _ => (0..count).map(|i| i.to_string()).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::networks;

    #[test]
    fn sequences_are_read_as_they_were_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npz");
        let values: Vec<f32> = (0..5 * 128).map(|i| i as f32 / 7.0).collect();
        let column = Column { values, offsets: vec![0, 2 * 128, 5 * 128] };
        let written = Dataset {
            ids: vec!["a/1".into(), "b/2".into()],
            columns: vec![("level".into(), vec!["0".into(), "2".into()])],
            items: Items { columns: vec![column] },
        };
        // As long as there are items: still no column.
        written.write_sequences(&path, 128, "{}").unwrap();
        let network = networks::named("m5-vggish-level").unwrap().build(None, 0).unwrap();
        let read = Dataset::read(&path, &network).unwrap();
        assert_eq!((&read.ids, &read.items), (&written.ids, &written.items));
        assert_eq!(read.column("level"), Some(&written.columns[0].1[..]));
        assert!(read.column("__made__").is_none());
        // The file had two members of that name, and nothing read it.
        for name in ["X", "offsets", "ids", "__made__"] {
            let columns = vec![(name.into(), vec!["0".into(), "2".into()])];
            let other = Dataset { ids: written.ids.clone(), columns, items: written.items.clone() };
            let refused = other.write_sequences(&path, 128, "{}").unwrap_err().to_string();
            assert!(refused.contains("rename the column"), "{refused}");
        }
        // `inspect` and `compare` would look for the tables of extracted features.
        assert!(!corsmal_files::layout::is_ours(&NpzFile::open(&path).unwrap()));
    }
}
