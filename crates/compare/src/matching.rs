//! Which arrays, and which columns, of two files belong together.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::hash::Hash;

use super::compared_file::{ArrayEntry, ComparedFile, shown};
use super::error::CompareError;
use corsmal_files::parquet::NumericTable;

/// Two arrays.
#[derive(Debug)]
pub(super) struct ArrayMatch {
    /// Position in the first file.
    pub a: usize,
    /// Position in the second.
    pub b: usize,
    /// What they are compared as.
    pub feature: String,
    /// The recording, or the array's name.
    pub place: String,
}

/// NumericTable and rows of two tables, of one feature.
#[derive(Debug)]
pub(super) struct TableMatch {
    /// What they are compared as.
    pub feature: String,
    /// Positions in the first and in the second file.
    pub columns: Vec<(usize, usize)>,
    /// Positions in the first and in the second file.
    pub rows: Vec<(usize, usize)>,
}

/// What two files have in common, and what not.
#[derive(Debug, Default)]
pub(super) struct Matching {
    pub arrays: Vec<ArrayMatch>,
    pub tables: Vec<TableMatch>,
    /// Arrays, columns and rows of the first file only.
    pub only_a: Vec<String>,
    /// Arrays, columns and rows of the second file only.
    pub only_b: Vec<String>,
    /// Whether recordings are paired by file name, for want of a common id.
    pub by_file_name: bool,
}

impl Matching {
    /// Finds pairs: those of `map`, then equal names, then the same recording and feature of two
    /// outputs of ours, by id or else by file name, at last the only array of each.
    pub(super) fn new(
        a: &ComparedFile,
        b: &ComparedFile,
        map: &[(String, String)],
    ) -> Result<Self, CompareError> {
        let mut pairs: Vec<(usize, usize)> = Vec::new();
        for (name_a, name_b) in map {
            pairs.push((position(a, name_a)?, position(b, name_b)?));
        }
        let free = |file: &ComparedFile, taken: &[usize]| -> Vec<usize> {
            let ours = file.provenance().is_some();
            // What covers a whole run of ours is compared otherwise.
            let covers_run = |e: &ArrayEntry| ours && e.ours.is_none();
            let free = |i: &usize| !taken.contains(i) && !covers_run(&file.arrays()[*i]);
            (0..file.arrays().len()).filter(free).collect()
        };
        let taken: (Vec<usize>, Vec<usize>) = pairs.iter().copied().unzip();
        let mut rest_a = free(a, &taken.0);
        let mut rest_b = free(b, &taken.1);
        let name = |e: &ArrayEntry| Some((e.name.clone(), String::new()));
        join(
            &mut pairs,
            (&mut rest_a, &mut rest_b),
            |i| name(&a.arrays()[i]),
            |i| name(&b.arrays()[i]),
        );
        let ours = |e: &ArrayEntry| e.ours.clone();
        join(
            &mut pairs,
            (&mut rest_a, &mut rest_b),
            |i| ours(&a.arrays()[i]),
            |i| ours(&b.arrays()[i]),
        );
        let mut matching = Self::default();
        if pairs.is_empty() {
            let by_name = |e: &ArrayEntry| {
                let (id, feature) = e.ours.as_ref()?;
                Some((file_name(id).to_owned(), feature.clone()))
            };
            let (of_a, of_b) = (|i| by_name(&a.arrays()[i]), |j| by_name(&b.arrays()[j]));
            if unique(rest_a.iter().map(|i| of_a(*i))) && unique(rest_b.iter().map(|j| of_b(*j))) {
                join(&mut pairs, (&mut rest_a, &mut rest_b), of_a, of_b);
                matching.by_file_name = !pairs.is_empty();
            }
        }
        matching.tables(a, b);
        if let (true, [only_a], [only_b]) =
            (pairs.is_empty() && matching.tables.is_empty(), &rest_a[..], &rest_b[..])
        {
            pairs.push((*only_a, *only_b));
            (rest_a, rest_b) = (Vec::new(), Vec::new());
        }
        if pairs.is_empty() && matching.tables.is_empty() {
            if let (Some(in_a), Some(in_b)) = (a.recordings(), b.recordings()) {
                let (of_a, of_b) = (a.path().into(), b.path().into());
                if in_a == in_b && !in_a.is_empty() {
                    let (in_a, in_b) = (a.listing(), b.listing());
                    return Err(CompareError::NoFeatureInCommon { a: of_a, b: of_b, in_a, in_b });
                }
                let (in_a, in_b) = (shown(&in_a), shown(&in_b));
                return Err(CompareError::NoRecordingInCommon { a: of_a, b: of_b, in_a, in_b });
            }
            let (in_a, in_b) = (a.listing(), b.listing());
            let (a, b) = (a.path().into(), b.path().into());
            return Err(CompareError::NothingInCommon { a, b, in_a, in_b });
        }
        matching.only_a.extend(rest_a.iter().map(|&i| a.arrays()[i].name.clone()));
        matching.only_b.extend(rest_b.iter().map(|&i| b.arrays()[i].name.clone()));
        matching.arrays = pairs
            .into_iter()
            .map(|(i, j)| {
                let (x, y) = (&a.arrays()[i], &b.arrays()[j]);
                let (place, feature) =
                    x.ours.clone().or(y.ours.clone()).unwrap_or((x.name.clone(), x.name.clone()));
                ArrayMatch { a: i, b: j, feature, place }
            })
            .collect();
        Ok(matching)
    }

    fn tables(&mut self, a: &ComparedFile, b: &ComparedFile) {
        let (x, y) = match (a.table(), b.table()) {
            (Some(x), Some(y)) => (x, y),
            (Some(x), None) => return self.only_a.extend(x.names.iter().cloned()),
            (None, Some(y)) => return self.only_b.extend(y.names.iter().cloned()),
            (None, None) => return,
        };
        let columns = common(&x.names, &y.names, &mut self.only_a, &mut self.only_b);
        let rows = match (&x.ids, &y.ids) {
            (Some(x), Some(y)) => self.rows(x, y),
            // Without ids, rows are those of the same number.
            _ => {
                let (in_a, in_b) = (x.values.nrows(), y.values.nrows());
                let common = in_a.min(in_b);
                let rest = |rows| (common < rows).then(|| format!("rows {common} to {}", rows - 1));
                self.only_a.extend(rest(in_a));
                self.only_b.extend(rest(in_b));
                (0..common).map(|row| (row, row)).collect()
            }
        };
        if rows.is_empty() {
            return;
        }
        let ours = a.provenance().is_some() || b.provenance().is_some();
        let mut features: Vec<String> = Vec::new();
        let mut groups: BTreeMap<String, Vec<(usize, usize)>> = BTreeMap::new();
        for (i, j) in columns {
            let feature = if ours { feature_of(&x.names[i]) } else { "table" };
            if !groups.contains_key(feature) {
                features.push(feature.to_string());
            }
            groups.entry(feature.to_string()).or_default().push((i, j));
        }
        for feature in features {
            let columns = groups.remove(&feature).unwrap_or_default();
            self.tables.push(TableMatch { feature, columns, rows: rows.clone() });
        }
    }
}

impl Matching {
    /// Rows of the same id; without any, those of the same file name.
    fn rows(&mut self, a: &[String], b: &[String]) -> Vec<(usize, usize)> {
        let known: HashSet<&String> = b.iter().collect();
        if a.iter().any(|id| known.contains(id)) {
            return common(a, b, &mut self.only_a, &mut self.only_b);
        }
        let names =
            |ids: &[String]| ids.iter().map(|id| file_name(id).to_owned()).collect::<Vec<String>>();
        let (x, y) = (names(a), names(b));
        if !(unique(x.iter().map(Some)) && unique(y.iter().map(Some))) {
            return Vec::new();
        }
        let rows = common(&x, &y, &mut self.only_a, &mut self.only_b);
        self.by_file_name |= !rows.is_empty();
        rows
    }
}

/// The last part of an id.
pub(super) fn file_name(id: &str) -> &str {
    id.rsplit('/').next().unwrap_or(id)
}

/// Whether no key comes twice.
fn unique<K: Eq + Hash>(keys: impl Iterator<Item = Option<K>>) -> bool {
    let mut seen = HashSet::new();
    keys.flatten().all(|key| seen.insert(key))
}

fn position(file: &ComparedFile, name: &str) -> Result<usize, CompareError> {
    file.arrays().iter().position(|entry| entry.name == name).ok_or_else(|| {
        let (path, known) = (file.path().into(), file.listing());
        CompareError::Unmapped { path, name: name.into(), known }
    })
}

type Key = (String, String);

/// Moves what has the same key from `rest` to `pairs`.
fn join(
    pairs: &mut Vec<(usize, usize)>,
    rest: (&mut Vec<usize>, &mut Vec<usize>),
    key_a: impl Fn(usize) -> Option<Key>,
    key_b: impl Fn(usize) -> Option<Key>,
) {
    let mut places: HashMap<Key, usize> =
        rest.1.iter().filter_map(|&j| Some((key_b(j)?, j))).collect();
    let mut found = Vec::new();
    for &i in rest.0.iter() {
        if let Some(j) = key_a(i).and_then(|key| places.remove(&key)) {
            found.push((i, j));
        }
    }
    let (of_a, of_b): (HashSet<usize>, HashSet<usize>) = found.iter().copied().unzip();
    rest.0.retain(|i| !of_a.contains(i));
    rest.1.retain(|j| !of_b.contains(j));
    pairs.extend(found);
}

/// Positions of the names that both lists hold; the others are added to `only_a`, `only_b`.
fn common(
    a: &[String],
    b: &[String],
    only_a: &mut Vec<String>,
    only_b: &mut Vec<String>,
) -> Vec<(usize, usize)> {
    let mut places: HashMap<&String, usize> = b.iter().zip(0..).collect();
    let mut pairs = Vec::new();
    for (i, name) in a.iter().enumerate() {
        match places.remove(name) {
            Some(j) => pairs.push((i, j)),
            None => only_a.push(name.clone()),
        }
    }
    only_b.extend(b.iter().filter(|name| places.contains_key(name)).cloned());
    pairs
}

/// The feature that a summary column is of: `mfcc` for `ch0/mfcc[3].mean`.
fn feature_of(column: &str) -> &str {
    let rest = match column.split_once('/') {
        Some((place, rest)) if place.starts_with("ch") => rest,
        _ => column,
    };
    rest.split(['[', '.']).next().unwrap_or(rest)
}

impl TableMatch {
    /// The ids of the rows, or their numbers.
    pub(super) fn row_names(&self, a: &NumericTable) -> Vec<String> {
        let name = |&(row, _): &(usize, usize)| match &a.ids {
            Some(ids) => ids[row].clone(),
            None => format!("row {row}"),
        };
        self.rows.iter().map(name).collect()
    }
}
