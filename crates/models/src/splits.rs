//! Which rows are trained on and which are tested.
//!
//! Seeded splits draw from numpy's legacy generator in scikit-learn's order, so a split made there
//! with `random_state` comes out the same here.

use std::collections::BTreeMap;

use crate::error::{ModelError, Result};
use crate::mt19937::RandomState;
use crate::table::class_counts;

/// Longest list of groups that names a fold; longer ones are counted.
const LONGEST_NAME: usize = 40;

/// Row numbers of one round.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fold {
    /// what is held out, as shown in reports
    pub name: String,
    /// rows learned from
    pub train: Vec<usize>,
    /// rows held out
    pub test: Vec<usize>,
}

/// Folds from a fold number per row.
fn from_assignment(fold_of: &[usize], names: Vec<String>) -> Vec<Fold> {
    let folds = names.into_iter().enumerate().map(|(fold, name)| {
        let (test, train) = (0..fold_of.len()).partition(|&row| fold_of[row] == fold);
        Fold { name, train, test }
    });
    folds.collect()
}

fn numbered(folds: usize) -> Vec<String> {
    (1..=folds).map(|f| f.to_string()).collect()
}

fn at_least_two(folds: usize) -> Result<()> {
    if folds >= 2 {
        return Ok(());
    }
    Err(ModelError::Folds { reason: format!("{folds} requested; at least 2 are needed") })
}

/// Folds with the same class proportions (`StratifiedKFold`); shuffled within each class when a
/// seed is given.
///
/// # Errors
/// Fewer than two folds, or a class with fewer rows than folds.
pub fn stratified_k_fold(y: &[usize], folds: usize, seed: Option<u32>) -> Result<Vec<Fold>> {
    at_least_two(folds)?;
    // Classes in order of appearance: that is the order the generator is used in.
    let mut number = BTreeMap::new();
    for &class in y {
        let next = number.len();
        number.entry(class).or_insert(next);
    }
    let encoded: Vec<usize> = y.iter().map(|c| number[c]).collect();
    let counts = class_counts(&encoded, number.len());
    for (&class, &at) in &number {
        if counts[at] < folds {
            let purpose = "that many stratified folds";
            return Err(ModelError::TooFewRows { class, rows: counts[at], needed: folds, purpose });
        }
    }
    let mut sorted = encoded.clone();
    sorted.sort_unstable();
    let mut allocation = vec![vec![0; folds]; number.len()];
    sorted.iter().enumerate().for_each(|(at, &class)| allocation[class][at % folds] += 1);
    let mut rng = seed.map(RandomState::new);
    let mut fold_of = vec![0; y.len()];
    for (class, sizes) in allocation.iter().enumerate() {
        let repeated = sizes.iter().enumerate().flat_map(|(f, &n)| std::iter::repeat_n(f, n));
        let mut folds_of_class: Vec<usize> = repeated.collect();
        if let Some(rng) = &mut rng {
            rng.shuffle(&mut folds_of_class);
        }
        let rows = (0..y.len()).filter(|&row| encoded[row] == class);
        rows.zip(folds_of_class).for_each(|(row, fold)| fold_of[row] = fold);
    }
    Ok(from_assignment(&fold_of, numbered(folds)))
}

/// Different groups in order of name (whole numbers by value), with each row's group number.
fn distinct<S: AsRef<str>>(groups: &[S]) -> (Vec<String>, Vec<usize>) {
    let (labels, of_row) = crate::labels::Labels::of(groups);
    (labels.names().to_vec(), of_row)
}

/// Folds of whole groups, balanced by rows (`GroupKFold`): the largest group first, each into the
/// fold with fewest rows.
///
/// # Errors
/// Fewer than two folds, or fewer groups than folds.
pub fn group_k_fold<S: AsRef<str>>(groups: &[S], folds: usize) -> Result<Vec<Fold>> {
    at_least_two(folds)?;
    let (names, of_row) = distinct(groups);
    if names.len() < folds {
        return Err(ModelError::TooFewGroups { groups: names.len(), folds });
    }
    let sizes = class_counts(&of_row, names.len());
    let mut order: Vec<usize> = (0..names.len()).collect();
    order.sort_by_key(|&g| std::cmp::Reverse((sizes[g], g)));
    let (mut filled, mut fold_of_group) = (vec![0; folds], vec![0; names.len()]);
    for group in order {
        let lightest = (0..folds).min_by_key(|&f| filled[f]).unwrap_or(0);
        filled[lightest] += sizes[group];
        fold_of_group[group] = lightest;
    }
    let members = |fold| {
        let held = (0..names.len()).filter(|&g| fold_of_group[g] == fold);
        let held: Vec<&str> = held.map(|g| names[g].as_str()).collect();
        match held.iter().map(|name| name.len() + 1).sum::<usize>() {
            0..=LONGEST_NAME => held.join(","),
            _ => format!("{} ({} groups)", fold + 1, held.len()),
        }
    };
    let fold_of: Vec<usize> = of_row.iter().map(|&g| fold_of_group[g]).collect();
    Ok(from_assignment(&fold_of, (0..folds).map(members).collect()))
}

/// One fold per group.
///
/// # Errors
/// Fewer than two groups.
pub fn leave_one_group_out<S: AsRef<str>>(groups: &[S]) -> Result<Vec<Fold>> {
    let (names, of_row) = distinct(groups);
    if names.len() < 2 {
        return Err(ModelError::TooFewGroups { groups: names.len(), folds: 2 });
    }
    Ok(from_assignment(&of_row, names))
}

/// Folds given as lists of groups, such as containers {1,4,7}, {2,5,8}, {3,6,9}.
///
/// # Errors
/// A group in no list or in two, a listed group without rows, fewer than two lists.
pub fn group_lists<S: AsRef<str>>(groups: &[S], lists: &[Vec<String>]) -> Result<Vec<Fold>> {
    at_least_two(lists.len())?;
    let refuse = |reason: String| Err(ModelError::Folds { reason });
    let (names, of_row) = distinct(groups);
    let mut fold_of_group = vec![usize::MAX; names.len()];
    for (fold, list) in lists.iter().enumerate() {
        for group in list {
            let Some(at) = names.iter().position(|n| n == group) else {
                return refuse(format!("no row belongs to group {group}: {}", names.join(", ")));
            };
            if fold_of_group[at] != usize::MAX {
                return refuse(format!("group {group} is listed twice"));
            }
            fold_of_group[at] = fold;
        }
        if list.is_empty() {
            return refuse(format!("list {} is empty", fold + 1));
        }
    }
    if let Some(missing) = fold_of_group.iter().position(|&f| f == usize::MAX) {
        return refuse(format!("group {} is in no list", names[missing]));
    }
    let fold_of: Vec<usize> = of_row.iter().map(|&g| fold_of_group[g]).collect();
    Ok(from_assignment(&fold_of, lists.iter().map(|l| l.join(",")).collect()))
}

/// One random split (`train_test_split(test_size, random_state, stratify)`), rows in scikit-learn's
/// order.
///
/// # Errors
/// A test part that leaves either side empty or, stratified, without room for every class; a
/// class with a single row.
pub fn train_test_split(
    rows: usize,
    test_part: f64,
    seed: u32,
    stratify: Option<&[usize]>,
) -> Result<Fold> {
    let refuse = |reason: String| Err(ModelError::Folds { reason });
    let n_test = (test_part * rows as f64).ceil();
    if !(test_part > 0.0 && test_part < 1.0 && n_test >= 1.0 && (n_test as usize) < rows) {
        return refuse(format!("a test part of {test_part} of {rows} rows leaves one side empty"));
    }
    let (n_test, mut rng) = (n_test as usize, RandomState::new(seed));
    let n_train = rows - n_test;
    let name = "test".to_string();
    let Some(y) = stratify else {
        let order = rng.permutation(rows);
        return Ok(Fold { name, train: order[n_test..].to_vec(), test: order[..n_test].to_vec() });
    };
    if y.len() != rows {
        return Err(ModelError::Length { what: "labels", expected: rows, actual: y.len() });
    }
    let mut members: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    y.iter().enumerate().for_each(|(row, &class)| members.entry(class).or_default().push(row));
    for (&class, rows) in &members {
        if rows.len() < 2 {
            let purpose = "a stratified split";
            return Err(ModelError::TooFewRows { class, rows: rows.len(), needed: 2, purpose });
        }
    }
    if n_train.min(n_test) < members.len() {
        return refuse(format!(
            "{n_test} test and {n_train} training rows for {} classes",
            members.len()
        ));
    }
    let counts: Vec<usize> = members.values().map(Vec::len).collect();
    let of_train = share(&counts, n_train, &mut rng);
    let left: Vec<usize> = counts.iter().zip(&of_train).map(|(c, t)| c - t).collect();
    let of_test = share(&left, n_test, &mut rng);
    let (mut train, mut test) = (Vec::new(), Vec::new());
    for ((rows, n), m) in members.values().zip(of_train).zip(of_test) {
        let order = rng.permutation(rows.len());
        train.extend(order[..n].iter().map(|&i| rows[i]));
        test.extend(order[n..n + m].iter().map(|&i| rows[i]));
    }
    let mut reorder = |rows: Vec<usize>| -> Vec<usize> {
        rng.permutation(rows.len()).into_iter().map(|i| rows[i]).collect()
    };
    let train = reorder(train);
    let test = reorder(test);
    Ok(Fold { name, train, test })
}

/// `draws` shared in proportion to `counts`, the largest remainders rounded up, equal ones by lot.
fn share(counts: &[usize], draws: usize, rng: &mut RandomState) -> Vec<usize> {
    let total: usize = counts.iter().sum();
    let exact: Vec<f64> = counts.iter().map(|&c| c as f64 / total as f64 * draws as f64).collect();
    let mut shares: Vec<usize> = exact.iter().map(|e| e.floor() as usize).collect();
    let remainders: Vec<f64> = exact.iter().map(|e| e - e.floor()).collect();
    let mut missing = draws - shares.iter().sum::<usize>();
    let mut values = remainders.clone();
    values.sort_by(|a, b| b.total_cmp(a));
    values.dedup();
    for value in values {
        if missing == 0 {
            break;
        }
        let tied: Vec<usize> = (0..counts.len()).filter(|&c| remainders[c] == value).collect();
        let add = tied.len().min(missing);
        rng.permutation(tied.len())[..add].iter().for_each(|&i| shares[tied[i]] += 1);
        missing -= add;
    }
    shares
}
