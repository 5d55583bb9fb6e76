//! A network of M5 on the CCM training features, containers held out, as its team validated it.
//!
//! ```sh
//! cargo run --release -p corsmal-nets --example container_folds -- \
//!     m5_r21d_type r21d_train_f16.npz padding=published select=published --seeds 1337,1,2
//! ```
//!
//! Prints weighted F1 of each fold: of the epoch kept and, beside it, of the last epoch, which
//! nothing was chosen by.

use std::error::Error;
use std::path::Path;

use corsmal_nets::cross_validation::{Data, FoldItems, cross_validate};
use corsmal_nets::dataset::Dataset;
use corsmal_nets::device::Device;
use corsmal_nets::networks;
use serde_json::{Map, Value};

/// Containers held out together by the team.
const FOLDS: [[&str; 3]; 3] = [["1", "4", "7"], ["2", "5", "8"], ["3", "6", "9"]];

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let usage = "NETWORK FEATURES.npz [KEY=VALUE…] [--seeds N,N] [--checkpoints FOLDER]";
    let (Some(name), Some(features)) = (arguments.next(), arguments.next()) else {
        return Err(usage.into());
    };
    let (mut changes, mut seeds, mut folder) = (Map::new(), vec![1337u64], None);
    while let Some(argument) = arguments.next() {
        match (argument.as_str(), argument.split_once('=')) {
            ("--seeds", _) => {
                let list = arguments.next().ok_or(usage)?;
                seeds = list.split(',').map(str::parse).collect::<Result<_, _>>()?;
            }
            ("--checkpoints", _) => folder = Some(arguments.next().ok_or(usage)?),
            (_, Some((key, value))) => {
                let value = serde_json::from_str(value).unwrap_or(Value::String(value.into()));
                changes.insert(key.into(), value);
            }
            _ => return Err(usage.into()),
        }
    }
    let definition = networks::named(&name)?;
    let recipe = definition.recipe_with(&changes)?;
    let network = definition.build(None, 0)?;
    let data = Dataset::read(Path::new(&features), &network)?;
    let containers = data.column("container").ok_or("no column container")?;
    let sequences = data.column("sequence").ok_or("no column sequence")?;
    let classes = classes(sequences, definition.outputs)?;
    let folds = FOLDS.map(|held| {
        let (test, train) =
            (0..data.ids.len()).partition(|&i| held.contains(&containers[i].as_str()));
        FoldItems { name: held.join(","), train, test }
    });
    let score = |truth: &[usize], found: &[usize]| weighted_f1(truth, found, definition.outputs);
    let input = Data {
        items: &data.items,
        classes: &classes,
        n_classes: definition.outputs,
        groups: Some(containers),
        weights: None,
        device: &Device::Cpu,
    };
    println!("{name}, {} recordings, {recipe:?}", data.ids.len());
    let mut means = Vec::new();
    for seed in seeds {
        let recipe = corsmal_nets::recipe::Recipe { seed, ..recipe };
        let path = folder.as_ref().map(|f| Path::new(f).join(format!("{name}-{seed}")));
        path.as_ref().map(std::fs::create_dir_all).transpose()?;
        let path = path.as_deref();
        let found =
            cross_validate(definition, input, &folds, &recipe, path, score, |fold, now| {
                if now.step.is_some() {
                    return true;
                }
                let last = now.epochs.last();
                let values = last.map(|e| format!("loss {:.4}, F1 {:.4?}", e.loss, e.score));
                let (done, left) = (now.epochs.len(), now.left.as_secs());
                eprintln!(
                    "{} epoch {done}: {} left {left} s",
                    fold.name,
                    values.unwrap_or_default()
                );
                true
            })?;
        let mut sums = (0.0, 0.0);
        for result in &found {
            let truth: Vec<usize> = result.test.iter().map(|&i| classes[i]).collect();
            let labels = corsmal_nets::fit::labels(&result.probabilities);
            let kept = 100.0 * score(&truth, &labels);
            let last = result.history.epochs.last().and_then(|e| e.score).unwrap_or(kept / 100.0);
            sums = (sums.0 + kept / 3.0, sums.1 + 100.0 * last / 3.0);
            println!(
                "seed {seed} fold {}: kept epoch {} {kept:.2}, last epoch {:.2}",
                result.name,
                result.history.kept + 1,
                100.0 * last
            );
        }
        println!("seed {seed} mean: kept {:.2}, last {:.2}", sums.0, sums.1);
        means.push(sums);
    }
    let n = means.len() as f64;
    let mean = |pick: fn(&(f64, f64)) -> f64| means.iter().map(pick).sum::<f64>() / n;
    println!("mean of {n} seeds: kept {:.2}, last {:.2}", mean(|m| m.0), mean(|m| m.1));
    Ok(())
}

/// Type (`fi`) or level (`fu`) from the names of the sequences, by the number of outputs.
fn classes(sequences: &[String], outputs: usize) -> Result<Vec<usize>, Box<dyn Error>> {
    let key = if outputs == 4 { "fi" } else { "fu" };
    let one = |name: &String| {
        let field = name.split('_').find_map(|f| f.strip_prefix(key));
        let class = field.and_then(|f| f.parse::<usize>().ok());
        class.ok_or_else(|| format!("{name}: no name of a CCM sequence").into())
    };
    sequences.iter().map(one).collect()
}

/// F1 of each class, weighted by its items.
fn weighted_f1(truth: &[usize], found: &[usize], n: usize) -> f64 {
    let count = |test: &dyn Fn(usize, usize) -> bool| {
        truth.iter().zip(found).filter(|&(&t, &f)| test(t, f)).count() as f64
    };
    let f1 = |c: usize| {
        let right = count(&|t, f| t == c && f == c);
        let all = count(&|t, _| t == c) + count(&|_, f| f == c);
        if all == 0.0 { 0.0 } else { 2.0 * right / all }
    };
    (0..n).map(|c| f1(c) * count(&|t, _| t == c)).sum::<f64>() / truth.len() as f64
}
