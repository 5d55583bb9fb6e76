//! What is compared exactly: labels, statuses, text members, and whole numbers that doubles would round.

use std::collections::{HashMap, HashSet};
use std::hash::Hash;

use corsmal_files::parquet::NumericTable;
use corsmal_files::table::Table;
use ndarray::Axis;
use serde::Serialize;

use super::pairing::{Identities, PairedBy};

/// Name under which the statuses of recordings are compared.
const STATUS: &str = "outcome status";

/// Name under which the identities of recordings are compared.
const CONTENT: &str = "content";

/// A column of texts in one file.
#[derive(Debug)]
pub(super) struct TextColumn {
    /// Its name.
    pub name: String,
    /// What its rows are named by: ids, or their numbers.
    pub ids: Option<Vec<String>>,
    /// Length of each axis.
    pub shape: Vec<u64>,
    /// Its values.
    pub values: Vec<String>,
}

/// How texts of two files differ.
#[derive(Debug, Serialize)]
pub struct TextReport {
    /// The label, or the member.
    pub name: String,
    /// Values compared.
    pub values: usize,
    /// Those that differ.
    pub differing: usize,
    /// The first that differs.
    pub first: Option<TextDifference>,
}

/// Two texts in the same place.
#[derive(Debug, Serialize)]
pub struct TextDifference {
    /// The recording, or the number of the value.
    pub place: String,
    /// In the first file; empty where there is none.
    pub a: String,
    /// In the second file; empty where there is none.
    pub b: String,
}

/// Labels and statuses of an output of ours.
pub(super) fn of_table(table: &Table) -> Vec<TextColumn> {
    let labels = table.labels().map(|(name, values)| TextColumn {
        name: name.to_owned(),
        ids: Some(table.ids().to_vec()),
        shape: vec![values.len() as u64],
        values: values.to_vec(),
    });
    let outcomes = table.outcomes();
    let statuses = TextColumn {
        name: STATUS.into(),
        ids: Some(outcomes.iter().map(|outcome| outcome.id.clone()).collect()),
        shape: vec![outcomes.len() as u64],
        values: outcomes.iter().map(|outcome| outcome.status.name().to_owned()).collect(),
    };
    labels.chain([statuses]).collect()
}

/// Takes the columns of whole numbers from a table that are texts in the other file.
pub(super) fn spelled_out(table: &mut NumericTable, other: &[TextColumn]) -> Vec<TextColumn> {
    let is_whole = |text: &String| text.is_empty() || text.parse::<i128>().is_ok();
    let is_text = |at: usize| {
        let mut theirs = other.iter().filter(|text| text.name == table.names[at]);
        theirs.any(|text| text.values.iter().all(is_whole))
            && table.values.column(at).iter().all(|x| x.is_nan() || x.fract() == 0.0)
    };
    let (texts, kept): (Vec<usize>, Vec<usize>) =
        (0..table.names.len()).partition(|&at| is_text(at));
    let spelled = |x: &f64| if x.is_nan() { String::new() } else { format!("{:.0}", x + 0.0) };
    let column = |at: usize| TextColumn {
        name: table.names[at].clone(),
        ids: table.ids.clone(),
        shape: vec![table.values.nrows() as u64],
        values: table.values.column(at).iter().map(spelled).collect(),
    };
    let found = texts.into_iter().map(column).collect();
    table.values = table.values.select(Axis(1), &kept);
    table.names = kept.iter().map(|&at| table.names[at].clone()).collect();
    table.types = kept.iter().map(|&at| table.types[at]).collect();
    found
}

/// Compares the columns that both files have, in the rows that both have.
pub(super) fn compare(
    (a, of_a): (&[TextColumn], &Identities),
    (b, of_b): (&[TextColumn], &Identities),
    paired_by: PairedBy,
) -> Vec<TextReport> {
    let pair = |x: &TextColumn| {
        let y = b.iter().find(|y| y.name == x.name)?;
        Some(of_columns((x, of_a), (y, of_b), paired_by))
    };
    a.iter().filter_map(pair).collect()
}

/// Compares the contents of the recordings that both files have, as far as they are known.
pub(super) fn contents(of_a: &Identities, of_b: &Identities, paired_by: PairedBy) -> TextReport {
    let column = |identities: &Identities| {
        let (ids, values): (Vec<_>, Vec<_>) = identities.iter().unzip();
        TextColumn { name: CONTENT.into(), shape: vec![ids.len() as u64], ids: Some(ids), values }
    };
    of_columns((&column(of_a), of_a), (&column(of_b), of_b), paired_by)
}

fn of_columns(
    (a, of_a): (&TextColumn, &Identities),
    (b, of_b): (&TextColumn, &Identities),
    paired_by: PairedBy,
) -> TextReport {
    let mut report = TextReport { name: a.name.clone(), values: 0, differing: 0, first: None };
    if let (Some(in_a), Some(in_b)) = (&a.ids, &b.ids) {
        let known: HashSet<&String> = in_b.iter().collect();
        let both: HashSet<&String> = in_a.iter().filter(|id| known.contains(id)).collect();
        let key = |identities: &Identities, id: &String| match both.contains(id) {
            true => Some((PairedBy::Id, id.clone())),
            false => Some((paired_by, paired_by.key(identities, id)?.to_owned())),
        };
        let (rows_a, rows_b) = (rows(in_a, |id| key(of_a, id)), rows(in_b, |id| key(of_b, id)));
        for (row, (id, x)) in in_a.iter().zip(&a.values).enumerate() {
            // Which of several of one key belong together is not known.
            if let Some(key) = key(of_a, id)
                && let Some(Some(place)) = rows_b.get(&key)
                && rows_a.get(&key) == Some(&Some(row))
            {
                let place = *place;
                report.add(|| id.clone(), Some(x), b.values.get(place));
            }
        }
    } else if a.shape != b.shape {
        let (x, y) = (format!("{:?}", a.shape), format!("{:?}", b.shape));
        report.add(|| "shape".into(), Some(&x), Some(&y));
    } else {
        for i in 0..a.values.len().max(b.values.len()) {
            report.add(|| format!("value {i}"), a.values.get(i), b.values.get(i));
        }
    }
    report
}

/// The row of each key; none where several have it.
fn rows<K: Eq + Hash>(
    ids: &[String],
    key: impl Fn(&String) -> Option<K>,
) -> HashMap<K, Option<usize>> {
    let mut rows = HashMap::new();
    for (row, id) in ids.iter().enumerate() {
        if let Some(key) = key(id) {
            rows.entry(key).and_modify(|place| *place = None).or_insert(Some(row));
        }
    }
    rows
}

impl TextReport {
    /// Compares whole numbers, of arrays of one shape.
    pub(super) fn of_integers<'a>(
        name: &str,
        pairs: impl Iterator<Item = (&'a i128, &'a i128)>,
    ) -> Self {
        let mut report = Self { name: name.into(), values: 0, differing: 0, first: None };
        for (i, (x, y)) in pairs.enumerate() {
            report.add(|| format!("value {i}"), Some(x), Some(y));
        }
        report
    }

    fn add<T: PartialEq + ToString>(
        &mut self,
        place: impl FnOnce() -> String,
        a: Option<&T>,
        b: Option<&T>,
    ) {
        self.values += 1;
        if a == b {
            return;
        }
        self.differing += 1;
        let text = |value: Option<&T>| value.map(T::to_string).unwrap_or_default();
        if self.first.is_none() {
            self.first = Some(TextDifference { place: place(), a: text(a), b: text(b) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column(ids: Option<&[&str]>, values: &[&str]) -> TextColumn {
        let texts = |list: &[&str]| list.iter().map(ToString::to_string).collect::<Vec<_>>();
        let shape = vec![values.len() as u64];
        TextColumn { name: "class".into(), ids: ids.map(texts), shape, values: texts(values) }
    }

    fn compared(a: TextColumn, b: TextColumn, paired_by: PairedBy) -> TextReport {
        let none = Identities::default();
        compare((&[a], &none), (&[b], &none), paired_by).remove(0)
    }

    #[test]
    fn texts_are_compared_by_id_whatever_their_order() {
        let a = column(Some(&["x/1", "x/2", "x/3"]), &["rain", "dog", "sea"]);
        let b = column(Some(&["x/2", "x/1", "x/4"]), &["dog", "Rain", "sea"]);
        let found = compared(a, b, PairedBy::Id);
        assert_eq!((found.values, found.differing), (2, 1));
        let first = found.first.as_ref().unwrap();
        assert_eq!((&*first.place, &*first.a, &*first.b), ("x/1", "rain", "Rain"));
        let a = column(Some(&["x/1"]), &["rain"]);
        let b = column(Some(&["y/1"]), &["dog"]);
        assert_eq!(compared(a, b, PairedBy::FileName).differing, 1);
        // What has the same id is compared by it, whatever else has its file name.
        let a = column(Some(&["x/1", "y/1", "old/2"]), &["ok", "empty", "ok"]);
        let b = column(Some(&["x/1", "y/1", "new/2"]), &["ok", "ok", "ok"]);
        let found = compared(a, b, PairedBy::FileName);
        assert_eq!((found.values, found.differing), (3, 1));
        // Two of one file name: it is not known which is which.
        let a = column(Some(&["x/1", "y/1"]), &["ok", "empty"]);
        let b = column(Some(&["p/1", "q/1"]), &["ok", "empty"]);
        assert_eq!(compared(a, b, PairedBy::FileName).values, 0);
    }

    #[test]
    fn lists_of_other_lengths_differ() {
        let (a, b) = (column(None, &["rain", ""]), column(None, &["rain"]));
        assert_eq!(compared(a, b, PairedBy::Id).differing, 1);
    }

    #[test]
    fn whole_numbers_beyond_doubles_are_told_apart() {
        let (x, y) = ([1_i128 << 53, (1 << 53) + 1], [1_i128 << 53, 1 << 53]);
        let found = TextReport::of_integers("x", x.iter().zip(&y));
        assert_eq!((found.values, found.differing), (2, 1));
        assert_eq!(found.first.unwrap().a, "9007199254740993");
    }
}
