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
  corsmal-feat embed r21d --data CCM --model r21d.onnx --library libonnxruntime.so.1.32.0 \\
      -o r21d.npz

Bring your own weights, with the names of the usual PyTorch port (features.0.weight to
embeddings.4.bias); a .pth is read without running it. The .npz has X (a row of 128 numbers for each
.96 s, one recording after another), offsets (where each recording begins) and ids; label columns
of a manifest are kept. r21d embeds windows of 16 colour frames from the four views of a data set,
512 numbers each, with an ONNX model (docs/vision.md); the member view says which view a sequence
is. It needs every frame of a view, as images or, in a build with the feature `video`, as H.264 in
MP4.

Exit codes: 0 all fine, 1 finished with failed files, 2 could not run, 130 interrupted.")]
pub struct Args {
    /// The network to use: vggish or r21d.
    #[arg(value_name = "NETWORK")]
    network: String,
    /// Recordings: files, folders, globs, manifests.
    #[arg(value_name = "PATH", num_args = 1.., required_unless_present = "data")]
    paths: Vec<String>,
    /// Weights of vggish: .pth, .safetensors or .npz.
    #[arg(long, value_name = "FILE", required_unless_present = "data")]
    weights: Option<PathBuf>,
    /// Folder of the data set whose views r21d embeds.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["paths", "weights"])]
    #[arg(requires_all = ["model", "library"])]
    data: Option<PathBuf>,
    /// r21d as an ONNX model; docs/vision.md says how to export it.
    #[arg(long, value_name = "FILE", requires = "data", conflicts_with_all = ["paths", "weights"])]
    model: Option<PathBuf>,
    /// Shared library of ONNX Runtime, such as libonnxruntime.so.1.32.0 of the PyPI package onnxruntime.
    #[arg(long, value_name = "FILE", env = "CORSMAL_ONNXRUNTIME")]
    library: Option<PathBuf>,
    /// Embeddings to write (.npz).
    #[arg(long, short, value_name = "FILE")]
    pub(super) out: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    pub(super) overwrite: bool,
    #[command(flatten)]
    pub(super) jobs: Jobs,
    #[command(flatten)]
    pub(super) told: Told,
}

/// Says how to get networks.
#[cfg(not(feature = "nets"))]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Args { network: _, paths: _, weights: _, data: _, model: _, library: _, .. } = args;
    let Args { out: _, overwrite: _, jobs: _, told: _, .. } = args;
    Err(super::nets::absent())
}

/// Embeds views.
#[cfg(feature = "nets")]
fn views(args: &Args) -> Result<ExitCode, Failure> {
    let (Some(data), Some(model), Some(library)) = (&args.data, &args.model, &args.library) else {
        return Err(Failure::new("r21d embeds views: give --data, --model and --library"));
    };
    #[cfg(feature = "onnx")]
    return super::clips::run(args, data, model, library);
    #[cfg(not(feature = "onnx"))]
    {
        let _ = (data, model, library);
        Err(super::detect::absent())
    }
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

    let Some(weights) = args.weights.as_deref().filter(|_| args.network != "r21d") else {
        if args.network == "r21d" {
            return views(&args);
        }
        return Err(Failure::new(
            "--data is for r21d, which embeds views; name recordings and --weights",
        ));
    };
    require_npz(&args.out)?;
    crate::publish::check(&args.out, args.overwrite)?;
    let embedder = Embedder::new(&args.network, weights)?;
    let found = recordings::named(&args.paths, recordings::warn)?;
    let columns = found.iter().flat_map(|input| &input.labels).map(|(name, _)| name.as_str());
    corsmal_nets::dataset::require_names(&args.out, columns)?;
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
