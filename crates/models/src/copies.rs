//! Rows that are copies of one another: the same recording under several names.

use std::collections::HashMap;

use crate::dataset::LabelledTable;
use crate::splits::Fold;

/// That folds test copies of what they train on, in words.
pub(crate) fn warning(table: &LabelledTable, folds: &[Fold]) -> Option<String> {
    let (first, what) = match table.x.ncols() {
        0 => (of_one_file(table), "are of the same file as"),
        _ => (of_equal_features(table), "have the same features as"),
    };
    let mut copied = vec![false; first.len()];
    for (row, &first) in first.iter().enumerate() {
        copied[first] |= row != first;
    }
    let mut found = Vec::new();
    for fold in folds {
        let mut trained: HashMap<usize, usize> = HashMap::new();
        for &row in fold.train.iter().filter(|&&row| copied[first[row]]) {
            trained.entry(first[row]).or_insert(row);
        }
        let tested = fold.test.iter();
        found.extend(tested.filter_map(|&row| Some((row, *trained.get(&first[row])?))));
    }
    let &(tested, trained) = found.iter().min()?;
    Some(format!(
        "{} of {} rows {what} a row that is trained on when they are tested, such as {} and {}: if \
         they are copies of one recording, and not silence, the scores are better than they would be on other \
         recordings; leave copies out, or let --groups name a column with one value for all copies",
        found.len(),
        first.len(),
        table.ids[tested],
        table.ids[trained]
    ))
}

/// For each row, the first one with these features.
fn of_equal_features(table: &LabelledTable) -> Vec<usize> {
    let mut bytes = Vec::with_capacity(8 * table.x.ncols());
    let mut hash = |row: ndarray::ArrayView1<'_, f64>| {
        bytes.clear();
        // Zero has two signs.
        bytes.extend(row.iter().flat_map(|value| (value + 0.0).to_le_bytes()));
        blake3::hash(&bytes)
    };
    let mut first: HashMap<blake3::Hash, usize> = HashMap::new();
    let rows = table.x.outer_iter().enumerate();
    rows.map(|(row, values)| *first.entry(hash(values)).or_insert(row)).collect()
}

/// For each row, the first one of a file with these bytes.
fn of_one_file(table: &LabelledTable) -> Vec<usize> {
    let known = table.outcomes.iter().filter(|outcome| !outcome.identity.is_empty());
    let identities: HashMap<&str, &str> =
        known.map(|outcome| (outcome.id.as_str(), outcome.identity.as_str())).collect();
    let mut first: HashMap<&str, usize> = HashMap::new();
    let rows = table.ids.iter().enumerate();
    rows.map(|(row, id)| match identities.get(id.as_str()) {
        Some(identity) => *first.entry(identity).or_insert(row),
        None => row,
    })
    .collect()
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use corsmal_files::outcome::{Outcome, Status};
    use ndarray::array;

    use super::*;

    fn table(ids: [&str; 4]) -> LabelledTable {
        let ids = ids.map(String::from).to_vec();
        LabelledTable::of_columns(Path::new("x.npz"), ids, Vec::new())
    }

    fn halves() -> Vec<Fold> {
        let fold = |test: &[usize], train: &[usize]| Fold {
            name: "half".into(),
            train: train.to_vec(),
            test: test.to_vec(),
        };
        vec![fold(&[0, 1], &[2, 3]), fold(&[2, 3], &[0, 1])]
    }

    #[test]
    fn equal_rows_in_training_and_test_are_said() {
        let mut table = table(["a", "b", "a (1)", "c"]);
        table.x = array![[0.5, 0.0], [1.0, 2.0], [0.5, -0.0], [3.0, 4.0]];
        let found = warning(&table, &halves()).unwrap();
        assert!(found.starts_with("2 of 4 rows have the same features"), "{found}");
        assert!(found.contains("such as a and a (1):"), "{found}");
        // On one side of every split, a copy does no harm.
        table.x = array![[0.5, 0.0], [0.5, 0.0], [1.0, 2.0], [3.0, 4.0]];
        assert_eq!(warning(&table, &halves()), None);
    }

    #[test]
    fn files_with_the_same_bytes_are_said_where_there_are_no_rows_of_numbers() {
        let mut table = table(["a", "b", "a (1)", "c"]);
        assert_eq!(warning(&table, &halves()), None);
        let heard = |(id, identity): (&str, &str)| Outcome {
            identity: identity.into(),
            ..Outcome::new(id, format!("{id}.wav"), Status::Ok, "")
        };
        table.outcomes = [("a", "8:x"), ("b", ""), ("a (1)", "8:x"), ("c", "")].map(heard).to_vec();
        let found = warning(&table, &halves()).unwrap();
        assert!(found.contains("are of the same file") && found.contains("a and a (1)"), "{found}");
    }
}
