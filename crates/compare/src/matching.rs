//! Which arrays, and which columns, of two files belong together.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::hash::Hash;

use super::compared_file::{ArrayEntry, ComparedFile, shown};
use super::error::CompareError;
use super::pairing::PairedBy;
use super::rows::RowPairs;
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
    /// The rows of the first file that are compared, where they are paired by ids.
    pub rows: Vec<usize>,
}

/// NumericTable and rows of two tables, of one feature.
#[derive(Debug)]
pub(super) struct TableMatch {
    /// What they are compared as.
    pub feature: String,
    /// Positions in the first and in the second file.
    pub columns: Vec<(usize, usize)>,
    /// Which vector each column is a coefficient of, in any channel; others are vectors of their own.
    pub vectors: Vec<usize>,
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
    /// What recordings are paired by.
    pub paired_by: PairedBy,
    /// Rows of arrays of other programs, where their ids say that these are not those of the same number.
    pub rows: Option<RowPairs>,
    /// How many of these there are, 0 where no id is in both files.
    pub paired_rows: Option<usize>,
}

impl Matching {
    /// Finds pairs: those of `map`, then equal names, then the same recording and feature of two
    /// outputs of ours, by id or else as [`PairedBy`] says, at last the only array of each.
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
        let name = |e: &ArrayEntry| Some((e.name.clone(), String::new(), false));
        join(
            &mut pairs,
            (&mut rest_a, &mut rest_b),
            |i| name(&a.arrays()[i]),
            |i| name(&b.arrays()[i]),
        );
        let mut matching = Self::default();
        for by in PairedBy::ALL {
            // What --map or names have left over is not paired by less.
            if by != PairedBy::Id && !pairs.is_empty() {
                break;
            }
            let unclear_a = repeated(rest_a.iter().filter_map(|i| owned(by, a, *i)));
            let unclear_b = repeated(rest_b.iter().filter_map(|j| owned(by, b, *j)));
            let before = pairs.len();
            join(
                &mut pairs,
                (&mut rest_a, &mut rest_b),
                |i| owned(by, a, i).filter(|key| !unclear_a.contains(key)),
                |j| owned(by, b, j).filter(|key| !unclear_b.contains(key)),
            );
            if pairs.len() > before {
                matching.paired_by = by;
            }
        }
        let has_rows = matching.tables(a, b)?;
        if let (true, [only_a], [only_b]) =
            (pairs.is_empty() && matching.tables.is_empty(), &rest_a[..], &rest_b[..])
        {
            pairs.push((*only_a, *only_b));
            (rest_a, rest_b) = (Vec::new(), Vec::new());
        }
        if pairs.is_empty() && matching.tables.is_empty() && !(has_rows && a.shares_texts_only(b)) {
            if let (Some(in_a), Some(in_b)) = (a.rows_or_recordings(), b.rows_or_recordings()) {
                let (of_a, of_b) = (a.path().into(), b.path().into());
                if in_a.iter().any(|id| in_b.contains(id)) {
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
        matching.rows_of_arrays(a, b)?;
        matching.only_a.extend(rest_a.iter().map(|&i| a.arrays()[i].name.clone()));
        matching.only_b.extend(rest_b.iter().map(|&i| b.arrays()[i].name.clone()));
        matching.arrays = pairs
            .into_iter()
            .map(|(i, j)| {
                let (x, y) = (&a.arrays()[i], &b.arrays()[j]);
                let (place, feature) = match x.ours.as_ref().or(y.ours.as_ref()) {
                    Some(owner) => (owner.id.clone(), owner.title().to_owned()),
                    None => (x.name.clone(), x.name.clone()),
                };
                ArrayMatch { a: i, b: j, feature, place, rows: Vec::new() }
            })
            .collect();
        Ok(matching)
    }

    /// Pairs the columns of two tables; whether they have a row in common.
    fn tables(&mut self, a: &ComparedFile, b: &ComparedFile) -> Result<bool, CompareError> {
        let (x, y) = match (a.table(), b.table()) {
            (Some(x), Some(y)) => (x, y),
            (x, y) => {
                let names = |table: Option<&NumericTable>| -> Vec<String> {
                    table.map_or_else(Vec::new, |table| table.names.clone())
                };
                self.only_a.extend(names(x));
                self.only_b.extend(names(y));
                return Ok(false);
            }
        };
        let in_a = (&*x.names, &*by_name(&x.names));
        let in_b = (&*y.names, &*by_name(&y.names));
        let columns = common(in_a, in_b, &mut self.only_a, &mut self.only_b);
        let rows = match (&x.ids, &y.ids) {
            (Some(x), Some(y)) => self.rows((a, x), (b, y))?,
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
            return Ok(false);
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
            let mut known: HashMap<String, usize> = HashMap::new();
            let mut vector = |name: &str| {
                let next = known.len();
                *known.entry(vector_of(name)).or_insert(next)
            };
            let vectors = columns.iter().map(|(i, _)| vector(&x.names[*i])).collect();
            self.tables.push(TableMatch { feature, columns, vectors, rows: rows.clone() });
        }
        Ok(true)
    }
}

impl Matching {
    /// Pairs the rows of arrays of other programs, if their files have other ids, or in another order.
    fn rows_of_arrays(&mut self, a: &ComparedFile, b: &ComparedFile) -> Result<(), CompareError> {
        let (Some(in_a), Some(in_b)) = (a.row_ids(), b.row_ids()) else { return Ok(()) };
        if in_a != in_b {
            let pairs = self.rows((a, in_a), (b, in_b))?;
            self.paired_rows = Some(pairs.len());
            let of = (in_a.len(), in_b.len());
            self.rows = (!pairs.is_empty()).then_some(RowPairs { pairs, of });
        }
        Ok(())
    }

    /// Rows of the same id; without any, those of the same file name or content.
    fn rows(
        &mut self,
        (a, in_a): (&ComparedFile, &[String]),
        (b, in_b): (&ComparedFile, &[String]),
    ) -> Result<Vec<(usize, usize)>, CompareError> {
        for by in PairedBy::ALL {
            let mut x: Vec<_> = in_a.iter().map(|id| by.key(a.identities(), id)).collect();
            let mut y: Vec<_> = in_b.iter().map(|id| by.key(b.identities(), id)).collect();
            let in_both = |x: &[Option<&str>], y: &[Option<&str>]| {
                let known: HashSet<&str> = y.iter().copied().flatten().collect();
                x.iter().flatten().any(|key| known.contains(key))
            };
            let is_common = in_both(&x, &y);
            for (file, keys) in [(a, &mut x), (b, &mut y)] {
                let unclear = repeated(keys.iter().copied().flatten());
                if let (true, PairedBy::Id, Some(id)) = (is_common, by, unclear.iter().min()) {
                    let (path, id) = (file.path().into(), (*id).to_owned());
                    return Err(CompareError::RepeatedId { path, id });
                }
                for key in keys.iter_mut() {
                    *key = key.filter(|key| !unclear.contains(key));
                }
            }
            if !in_both(&x, &y) {
                continue;
            }
            let pairs = common((in_a, &x), (in_b, &y), &mut self.only_a, &mut self.only_b);
            if by != PairedBy::Id {
                self.paired_by = by;
            }
            return Ok(pairs);
        }
        Ok(Vec::new())
    }
}

/// Keys that come more than once: what they belong to is not known.
fn repeated<K: Eq + Hash + Clone>(keys: impl Iterator<Item = K>) -> HashSet<K> {
    let mut seen = HashSet::new();
    keys.filter(|key| !seen.insert(key.clone())).collect()
}

fn position(file: &ComparedFile, name: &str) -> Result<usize, CompareError> {
    file.arrays().iter().position(|entry| entry.name == name).ok_or_else(|| {
        let (path, known) = (file.path().into(), file.listing());
        CompareError::Unmapped { path, name: name.into(), known }
    })
}

/// The recording, the feature, and whether the array holds times: arrays of equal keys belong together.
type Key = (String, String, bool);

/// The key of an array of ours.
fn owned(by: PairedBy, file: &ComparedFile, index: usize) -> Option<Key> {
    let owner = file.arrays()[index].ours.as_ref()?;
    let recording = by.key(file.identities(), &owner.id)?;
    Some((recording.to_owned(), owner.feature.clone(), owner.times))
}

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

fn by_name(names: &[String]) -> Vec<Option<&str>> {
    names.iter().map(|name| Some(name.as_str())).collect()
}

/// Positions of the keys that both lists hold; the names of the others are added to `only_a`, `only_b`.
fn common(
    (in_a, a): (&[String], &[Option<&str>]),
    (in_b, b): (&[String], &[Option<&str>]),
    only_a: &mut Vec<String>,
    only_b: &mut Vec<String>,
) -> Vec<(usize, usize)> {
    let mut places: HashMap<&str, usize> =
        b.iter().zip(0..).filter_map(|(key, j)| Some(((*key)?, j))).collect();
    let mut pairs = Vec::new();
    for (i, key) in a.iter().enumerate() {
        match key.and_then(|key| places.remove(key)) {
            Some(j) => pairs.push((i, j)),
            None => only_a.push(in_a[i].clone()),
        }
    }
    let paired: HashSet<usize> = pairs.iter().map(|(_, j)| *j).collect();
    only_b.extend((0..b.len()).filter(|j| !paired.contains(j)).map(|j| in_b[j].clone()));
    pairs
}

/// The feature that a summary column is of: `mfcc` for `ch0/mfcc[3].mean`.
fn feature_of(column: &str) -> &str {
    let rest = without_channel(column);
    rest.split(['[', '.']).next().unwrap_or(rest)
}

/// The vector that a summary column is a coefficient of: `mfcc[].mean` for `ch0/mfcc[3].mean`,
/// `af193[chroma_]` for `af193[chroma_2]`.
fn vector_of(column: &str) -> String {
    let rest = without_channel(column);
    match rest.split_once('[').and_then(|(name, rest)| Some((name, rest.split_once(']')?))) {
        Some((name, (index, statistic))) => {
            let part = index.trim_end_matches(|c: char| c.is_ascii_digit() || c == ',');
            format!("{name}[{part}]{statistic}")
        }
        None => rest.into(),
    }
}

fn without_channel(column: &str) -> &str {
    let is_channel =
        |place: &str| place.strip_prefix("ch").is_some_and(|n| n.parse::<u8>().is_ok());
    match column.split_once('/') {
        Some((place, rest)) if is_channel(place) => rest,
        _ => column,
    }
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
