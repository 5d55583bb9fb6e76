//! `corsmal-feat embed`: recordings in, the numbers that a network makes of them out.

use std::path::PathBuf;
use std::process::ExitCode;

use crate::args::{Jobs, Told};
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
    #[command(flatten)]
    told: Told,
}

/// Says how to get networks.
#[cfg(not(feature = "nets"))]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Args { network: _, paths: _, weights: _, out: _, overwrite: _, jobs: _, told: _ } = args;
    Err(super::nets::absent())
}

/// Embeds and writes.
#[cfg(feature = "nets")]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    use corsmal_files::format::require_npz;
    use corsmal_systems::SystemError;
    use corsmal_systems::embedding::Embedder;
    use serde_json::json;

    use crate::failure::{FAILED_FILES, INTERRUPTED};
    use crate::recordings;

    require_npz(&args.out)?;
    crate::publish::check(&args.out, args.overwrite)?;
    let embedder = Embedder::new(&args.network, &args.weights)?;
    let found = recordings::named(&args.paths, recordings::warn)?;
    let stop = crate::interrupt::flag();
    let mut failed = 0;
    let embedded = embedder.embed(&found, args.jobs.count(), stop, |input, status, reason| {
        eprintln!("{}: {status}: {reason}", input.id);
        failed += 1;
    });
    let dataset = match embedded {
        Err(SystemError::Interrupted) => {
            eprintln!("interrupted; nothing was written");
            return Ok(ExitCode::from(INTERRUPTED));
        }
        embedded => embedded?,
    };
    if dataset.ids.is_empty() {
        return Err(Failure::new("no recording has an embedding: nothing was written"));
    }
    let (recordings, width) = (dataset.ids.len(), embedder.width());
    let rows = dataset.items.columns[0].values.len() / width;
    dataset.write_sequences(&args.out, width, &embedder.provenance(&found).to_string())?;
    let out = &args.out;
    args.told.tell(
        || json!({ "out": out, "recordings": recordings, "rows": rows, "width": width, "failed": failed }),
        || format!("{}: {recordings} recordings, {rows} x {width}", out.display()),
    )?;
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}
