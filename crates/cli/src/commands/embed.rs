//! `corsmal-feat embed`: recordings in, the numbers that a network makes of them out.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::args::Jobs;
use crate::failure::Failure;

/// Arguments of `embed`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat embed vggish audio/ --weights vggish.pth -o vggish.npz
  corsmal-feat train vggish.npz --net m5-vggish-level --target level -o level.safetensors
  corsmal-feat benchmark --data CCM --out report --methods m5 --embeddings vggish=vggish.npz

Bring your own weights, under the names of the usual PyTorch port (features.0.weight to
embeddings.4.bias); a .pth is read without running it. The .npz has X, rows of 128 numbers for each
.96 s of one recording after another, offsets, where each recording begins, and ids; label columns of
a manifest are kept.

Exit codes: 0 all fine, 1 finished with failed files, 2 could not run, 130 interrupted.")]
pub struct Args {
    /// The network that embeds: vggish.
    #[arg(value_name = "NETWORK")]
    network: String,
    /// Recordings: files, folders, globs, manifests.
    #[arg(value_name = "PATH", required = true, num_args = 1..)]
    paths: Vec<String>,
    /// Its weights: .pth, .safetensors or .npz.
    #[arg(long, value_name = "FILE")]
    weights: PathBuf,
    /// Embeddings to write (.npz).
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    jobs: Jobs,
    /// Print nothing but errors.
    #[arg(long, short)]
    quiet: bool,
}

/// Says how to get networks.
#[cfg(not(feature = "nets"))]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Args { network: _, paths: _, weights: _, out: _, overwrite: _, jobs: _, quiet: _ } = args;
    Err(super::nets::absent())
}

/// Embeds and writes.
#[cfg(feature = "nets")]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    use std::sync::Arc;
    use std::sync::atomic::Ordering;

    use corsmal_ccm::CcmError;
    use corsmal_extract::inputs;
    use corsmal_files::outcome::Status;
    use corsmal_nets::dataset::Dataset;
    use corsmal_nets::items::{Column, Items};
    use corsmal_nets::recipe::Padding;
    use corsmal_nets::{networks, weights};
    use corsmal_systems::recordings;
    use serde_json::json;

    use crate::failure::{FAILED_FILES, INTERRUPTED};

    /// Items of a pass.
    const TOGETHER: usize = 64;

    if !args.out.extension().is_some_and(|e| e.eq_ignore_ascii_case("npz")) {
        return Err(Failure::new(format!("{}: must end in .npz", args.out.display())));
    }
    crate::publish::check(&args.out, args.overwrite)?;
    let definition = networks::named(&args.network)?;
    if definition.classifies {
        return Err(Failure::new(format!(
            "{} gives classes: `corsmal-feat classify` applies it; vggish embeds",
            definition.name
        )));
    }
    let front_end = crate::networks::front_end(definition)?;
    let mut network = definition.build(None, 0)?;
    network
        .load_state(&weights::read(&args.weights)?)
        .map_err(|e| Failure::new(format!("{}: {e}", args.weights.display())))?;
    let collected = inputs::collect(&args.paths)?;
    if let Some(skipped) = collected.warning() {
        eprintln!("warning: {skipped}");
    }
    if collected.inputs.is_empty() {
        return Err(Failure::new(format!("{}: no recordings found", args.paths.join(" "))));
    }
    let config = recordings::configuration(&front_end)?;
    let about = json!({
        "tool_version": env!("CARGO_PKG_VERSION"),
        "network": definition.name,
        "weights": corsmal_files::identity::of_file(&args.weights)?,
        "config": config.to_value(),
        "config_hash": config.hash(),
        "inputs": inputs::list_hash(&collected.inputs),
    });
    let stop = crate::interrupt::flag();
    let interrupted = || {
        eprintln!("interrupted; nothing was written");
        Ok(ExitCode::from(INTERRUPTED))
    };
    let (jobs, config) = (args.jobs.count(), Arc::new(config));
    let mut kept = match recordings::temporary(&collected.inputs, &config, jobs, stop) {
        Err(CcmError::Interrupted) => return interrupted(),
        kept => kept?,
    };
    let outcomes = std::mem::take(&mut kept.outcomes);
    let (pool, width) = (args.jobs.pool()?, network.outputs());
    let mut column = Column { values: Vec::new(), offsets: vec![0] };
    let (mut ids, mut failed) = (Vec::new(), 0);
    let mut columns: Vec<(String, Vec<String>)> = Vec::new();
    for (input, outcome) in collected.inputs.iter().zip(outcomes) {
        if stop.load(Ordering::Relaxed) {
            return interrupted();
        }
        if !outcome.status.has_features() {
            eprintln!("{}: {}: {}", input.id, outcome.status, outcome.reason);
            failed += 1;
            continue;
        }
        let patches = front_end.items(&network, kept.tensor(&input.id)?)?;
        let all = Column::of(patches.iter().map(|item| item.values.as_slice()));
        let items = Items { columns: vec![all] };
        let rows: Vec<usize> = (0..items.len()).collect();
        let begin = column.values.len();
        for rows in rows.chunks(TOGETHER) {
            let batch = items.batch(&network, rows, Padding::Masked);
            let found = pool.install(|| network.forward(&batch))?;
            column.values.extend_from_slice(found.values.values());
        }
        if let Some(odd) = column.values[begin..].iter().find(|v| !v.is_finite()) {
            eprintln!("{}: {}: the embedding holds {odd}", input.id, Status::NonFinite);
            column.values.truncate(begin);
            failed += 1;
            continue;
        }
        column.offsets.push(column.values.len());
        if columns.is_empty() {
            columns = input.labels.iter().map(|(name, _)| (name.clone(), Vec::new())).collect();
        }
        columns.iter_mut().zip(&input.labels).for_each(|((_, all), (_, v))| all.push(v.clone()));
        ids.push(input.id.clone());
    }
    if ids.is_empty() {
        return Err(Failure::new("no recording has an embedding: nothing was written"));
    }
    let (recordings, rows) = (ids.len(), column.values.len() / width);
    let dataset = Dataset { ids, columns, items: Items { columns: vec![column] } };
    dataset.write_sequences(&args.out, width, &about.to_string())?;
    if !args.quiet {
        println!("{}: {recordings} recordings, {rows} x {width}", args.out.display());
    }
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}
