//! `corsmal-feat compare-predictions`: whether two classifiers differ on the same recordings.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use corsmal_models::comparison::{Bootstrap, bootstrap, mcnemar};
use corsmal_models::labels::Labels;
use corsmal_models::scores::Scores;
use serde_json::json;

use crate::failure::Failure;

/// Arguments of `compare-predictions`.
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  corsmal-feat cross-validate … --classifier svm --predictions svm.csv
  corsmal-feat cross-validate … --classifier rf --predictions rf.csv
  corsmal-feat compare-predictions svm.csv rf.csv

McNemar's exact test looks at the recordings that only one of the two got right. The bootstrap draws
recordings, and whole folds where all lines have one, with replacement and gives a 95 % interval of
the difference of weighted F1. Recordings of one group resemble each other: where folds are groups,
the interval over folds is the honest one, and with few folds it says little.")]
pub struct Args {
    /// Held-out predictions of the first classifier (`cross-validate --predictions`).
    #[arg(value_name = "CSV")]
    first: PathBuf,
    /// Those of the second, of the same recordings.
    #[arg(value_name = "CSV")]
    second: PathBuf,
    /// Draws of the bootstrap.
    #[arg(long, value_name = "N", default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    resamples: u32,
    /// Seed of the bootstrap.
    #[arg(long, value_name = "N", default_value_t = 0)]
    seed: u64,
    /// Print everything as JSON.
    #[arg(long)]
    json: bool,
}

/// A held-out prediction.
struct Held {
    fold: String,
    truth: String,
    predicted: String,
}

/// Compares and prints.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let (ids, first) = read(&args.first)?;
    let (other_ids, second) = read(&args.second)?;
    let places: HashMap<&str, usize> =
        other_ids.iter().enumerate().map(|(i, id)| (id.as_str(), i)).collect();
    let (one, two) = (args.first.display(), args.second.display());
    let known: HashSet<&String> = ids.iter().collect();
    if let Some(extra) = other_ids.iter().find(|id| !known.contains(id)) {
        return Err(Failure::new(format!("{two}: {extra:?} is not in {one}")));
    }
    let mut truth = Vec::new();
    let (mut a, mut b) = (Vec::new(), Vec::new());
    for (id, held) in ids.iter().zip(&first) {
        let Some(&at) = places.get(id.as_str()) else {
            return Err(Failure::new(format!("{one}: {id:?} is not in {two}")));
        };
        let other = &second[at];
        if other.truth != held.truth {
            return Err(Failure::new(format!(
                "{id:?} is {} in {one} and {} in {two}: predictions of one target are compared",
                held.truth, other.truth
            )));
        }
        truth.push(held.truth.as_str());
        a.push(held.predicted.as_str());
        b.push(other.predicted.as_str());
    }
    let (labels, all) = Labels::of(&[&truth[..], &a, &b].concat());
    let (truth, rest) = all.split_at(truth.len());
    let (a, b) = rest.split_at(truth.len());
    let scores = [a, b].map(|p| Scores::new(truth, p, labels.len()));
    let [first_scores, second_scores] = scores;
    let (first_scores, second_scores) = (first_scores?, second_scores?);
    let test = mcnemar(truth, a, b)?;
    let draws = args.resamples as usize;
    let by_row = bootstrap::<&str>(truth, a, b, None, draws, args.seed)?;
    let folds: Vec<&str> = first.iter().map(|held| held.fold.as_str()).collect();
    let n_folds = Labels::of(&folds).0.len();
    let foldwise = n_folds > 1 && folds.iter().all(|fold| !fold.is_empty());
    let by_fold =
        foldwise.then(|| bootstrap(truth, a, b, Some(&folds), draws, args.seed)).transpose()?;
    if args.json {
        let report = json!({
            "rows": truth.len(),
            "first": { "path": one.to_string(), "scores": first_scores },
            "second": { "path": two.to_string(), "scores": second_scores },
            "mcnemar": test,
            "bootstrap_rows": by_row,
            "bootstrap_folds": by_fold,
            "folds": n_folds,
            "resamples": draws,
            "seed": args.seed,
        });
        println!("{}", serde_json::to_string_pretty(&report)?);
        return Ok(ExitCode::SUCCESS);
    }
    println!("{:34} {:>9} {:>12}", "percent", "accuracy", "weighted F1");
    for (path, scores) in [(&args.first, &first_scores), (&args.second, &second_scores)] {
        let name = path.file_stem().unwrap_or_default().to_string_lossy();
        println!("{name:34} {:>9.2} {:>12.2}", 100.0 * scores.accuracy, 100.0 * scores.weighted_f1);
    }
    println!(
        "\nMcNemar: {} right only in the first, {} only in the second of {}; p = {:.4}",
        test.only_first,
        test.only_second,
        truth.len(),
        test.p_value
    );
    print("recordings", &by_row);
    if let Some(by_fold) = &by_fold {
        print(&format!("{n_folds} folds"), by_fold);
    }
    Ok(ExitCode::SUCCESS)
}

fn print(unit: &str, result: &Bootstrap) {
    println!(
        "bootstrap over {unit}: weighted F1 of the second {:+.2} points, 95 % interval {:+.2} to \
         {:+.2}; p = {:.4}",
        100.0 * result.difference,
        100.0 * result.low,
        100.0 * result.high,
        result.p_value
    );
}

/// Ids and predictions of a file, in its order.
fn read(path: &Path) -> Result<(Vec<String>, Vec<Held>), Failure> {
    let place = path.display();
    let fault = |e: csv::Error| Failure::new(format!("{place}: {e}"));
    let mut reader =
        csv::ReaderBuilder::new().trim(csv::Trim::All).from_path(path).map_err(fault)?;
    let header = reader.headers().map_err(fault)?.clone();
    let find = |name: &str| header.iter().position(|h| h == name);
    let (Some(id), Some(truth), Some(predicted)) = (find("id"), find("true"), find("predicted"))
    else {
        let found = header.iter().collect::<Vec<_>>().join(", ");
        return Err(Failure::new(format!(
            "{place}: needs the columns id, true and predicted of `cross-validate --predictions`, \
             has {found}"
        )));
    };
    let fold = find("fold");
    let (mut ids, mut rows) = (Vec::new(), Vec::new());
    let mut seen = HashMap::new();
    for record in reader.records() {
        let record = record.map_err(fault)?;
        let line = record.position().map_or(0, csv::Position::line);
        if let Some(before) = seen.insert(record[id].to_string(), line) {
            let text = format!("{place}: line {line} repeats {:?} of line {before}", &record[id]);
            return Err(Failure::new(text));
        }
        if record[truth].is_empty() || record[predicted].is_empty() {
            return Err(Failure::new(format!("{place}: line {line} has no class")));
        }
        ids.push(record[id].to_string());
        rows.push(Held {
            fold: fold.map_or(String::new(), |at| record[at].to_string()),
            truth: record[truth].to_string(),
            predicted: record[predicted].to_string(),
        });
    }
    if rows.is_empty() {
        return Err(Failure::new(format!("{place}: has no predictions")));
    }
    Ok((ids, rows))
}
