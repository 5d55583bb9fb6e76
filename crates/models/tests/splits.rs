//! Splits against scikit-learn and against the published ones.

#![allow(clippy::unwrap_used, reason = "tests")]

use corsmal_models::ModelError;
use corsmal_models::splits::{
    group_k_fold, group_lists, leave_one_group_out, stratified_k_fold, train_test_split,
};

const SPLITS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/ccm/splits.csv");

/// Columns of the published splits, in the row order of 2020.
fn published() -> Option<Vec<Vec<String>>> {
    let path = std::env::var("CORSMAL_SHARED")
        .map_or_else(|_| SPLITS.into(), |shared| format!("{shared}/data/ccm/splits.csv"));
    let Ok(text) = std::fs::read_to_string(&path) else {
        println!("skipped: {path} absent");
        return None;
    };
    let mut rows: Vec<Vec<String>> =
        text.lines().skip(1).map(|l| l.split(',').map(String::from).collect()).collect();
    rows.sort_by_key(|row| row[0].parse::<usize>().unwrap());
    Some(rows)
}

#[test]
fn published_splits_come_out_row_for_row() {
    let Some(rows) = published() else { return };
    assert_eq!(rows.len(), 684);
    let joint: Vec<usize> = rows.iter().map(|row| row[7].parse().unwrap()).collect();
    // Stratified on one-hot text the classes sort the other way round.
    let reversed: Vec<usize> = joint.iter().map(|c| 6 - c).collect();
    let cases = [(8, Some(&joint)), (9, Some(&reversed)), (10, None)];
    for (column, stratify) in cases {
        let fold = train_test_split(684, 0.2, 42, stratify.map(Vec::as_slice)).unwrap();
        assert_eq!((fold.train.len(), fold.test.len()), (547, 137));
        for (row, entry) in rows.iter().enumerate() {
            let held_out = entry[column] != "train";
            assert_eq!(held_out, fold.test.contains(&row), "column {column}, row {row}");
        }
    }
}

#[test]
fn small_splits_are_those_of_scikit_learn() {
    // scikit-learn 1.9.1: train_test_split(range(10), test_size=.3, random_state=0, stratify=y)
    let y = [0, 0, 0, 1, 1, 1, 1, 2, 2, 2];
    let fold = train_test_split(10, 0.3, 0, Some(&y)).unwrap();
    assert_eq!((fold.train, fold.test), (TRAIN_STRATIFIED.to_vec(), TEST_STRATIFIED.to_vec()));
    let fold = train_test_split(10, 0.3, 0, None).unwrap();
    assert_eq!((fold.train, fold.test), (TRAIN_PLAIN.to_vec(), TEST_PLAIN.to_vec()));
    // StratifiedKFold(3, shuffle=True, random_state=0) and without shuffling: test rows
    let tests = |seed| -> Vec<Vec<usize>> {
        stratified_k_fold(&y, 3, seed).unwrap().into_iter().map(|f| f.test).collect()
    };
    assert_eq!(tests(Some(0)), FOLDS_SHUFFLED);
    assert_eq!(tests(None), FOLDS_IN_ORDER);
}
const TRAIN_STRATIFIED: [usize; 7] = [1, 2, 9, 6, 3, 5, 7];
const TEST_STRATIFIED: [usize; 3] = [4, 8, 0];
const TRAIN_PLAIN: [usize; 7] = [9, 1, 6, 7, 3, 0, 5];
const TEST_PLAIN: [usize; 3] = [2, 8, 4];
const FOLDS_SHUFFLED: [&[usize]; 3] = [&[2, 5, 6, 7], &[1, 3, 9], &[0, 4, 8]];
const FOLDS_IN_ORDER: [&[usize]; 3] = [&[0, 3, 4, 7], &[1, 5, 8], &[2, 6, 9]];

#[test]
fn groups_stay_whole() {
    let groups: Vec<String> = (0..60).map(|row| (row % 9 + 1).to_string()).collect();
    for folds in [group_k_fold(&groups, 3).unwrap(), leave_one_group_out(&groups).unwrap()] {
        let mut tested = vec![0; 60];
        for fold in &folds {
            fold.test.iter().for_each(|&row| tested[row] += 1);
            assert_eq!(fold.train.len() + fold.test.len(), 60);
            assert!(fold.train.iter().all(|&a| fold.test.iter().all(|&b| groups[a] != groups[b])));
        }
        assert!(tested.iter().all(|&n| n == 1));
    }
    let lists = ["1,4,7", "2,5,8", "3,6,9"].map(|l| l.split(',').map(String::from).collect());
    let folds = group_lists(&groups, &lists).unwrap();
    assert_eq!(folds[1].name, "2,5,8");
    assert!(folds[1].test.iter().all(|&row| ["2", "5", "8"].contains(&groups[row].as_str())));
}

#[test]
fn impossible_plans_are_refused() {
    let groups = ["a", "a", "b", "b"];
    assert!(matches!(
        group_k_fold(&groups, 3).unwrap_err(),
        ModelError::TooFewGroups { groups: 2, folds: 3 }
    ));
    assert!(matches!(
        leave_one_group_out(&["a", "a"]).unwrap_err(),
        ModelError::TooFewGroups { groups: 1, .. }
    ));
    assert!(matches!(
        stratified_k_fold(&[0, 0, 0, 1], 2, None).unwrap_err(),
        ModelError::TooFewRows { class: 1, rows: 1, needed: 2, .. }
    ));
    let list = |text: &str| text.split(',').map(String::from).collect::<Vec<_>>();
    for lists in [
        vec![list("a"), list("c")],
        vec![list("a"), list("a,b")],
        vec![list("a,b")],
        vec![list("a,b"), vec![]],
    ] {
        assert!(group_lists(&groups, &lists).is_err(), "{lists:?}");
    }
    assert!(group_lists(&["a", "b", "c"], &[list("a"), list("b")]).is_err());
    for part in [0.0, 1.0, -0.5, f64::NAN, 0.999] {
        assert!(train_test_split(10, part, 0, None).is_err(), "{part}");
    }
    assert!(train_test_split(4, 0.5, 0, Some(&[0, 1, 1, 1])).is_err());
    assert!(train_test_split(0, 0.5, 0, None).is_err());
}
