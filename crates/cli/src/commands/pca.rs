//! `corsmal-feat pca`: principal components of training features, as a file for `extract`.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_extract::projection::Projection;
use corsmal_files::format::require_npz;
use serde_json::json;

use crate::args::Told;
use crate::failure::Failure;
use crate::publish;

/// Arguments of `pca`.
#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  corsmal-feat extract --in train/ --out train.npz --preset spec9216-code
  corsmal-feat pca train.npz --n-components 128 --out pca.npz
  corsmal-feat extract --in test/ --out test.npz --preset spec9216-code --project pca.npz

The file records the configuration of its features, and features of any other configuration are
refused. Fit on training recordings only: `extract` never fits.")]
pub struct Args {
    /// Training features: an .npz or .parquet of `extract` with summaries.
    #[arg(value_name = "FEATURES", required_unless_present = "named")]
    features: Option<PathBuf>,
    /// The same as the positional argument.
    #[arg(long = "features", value_name = "FILE", conflicts_with = "features")]
    named: Option<PathBuf>,
    /// Components to keep, at most as many as the file has rows and features; 128 by default, or that
    /// maximum if it is lower.
    #[arg(long, value_name = "N")]
    n_components: Option<usize>,
    /// Projection file to write (.npz).
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Replace an existing file.
    #[arg(long)]
    overwrite: bool,
    #[command(flatten)]
    told: Told,
}

/// Fits and writes the projection.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    require_npz(&args.out)?;
    publish::check(&args.out, args.overwrite)?;
    let features = args.features.or(args.named).unwrap_or_default();
    publish::spare(&args.out, [features.as_path()])?;
    let projection = Projection::fit(&features, args.n_components)?;
    projection.save(&args.out)?;
    let (from, to) = (projection.n_inputs(), projection.n_components());
    args.told.tell(
        || json!({ "out": args.out.display().to_string(), "n_features": from, "n_components": to }),
        || format!("{}: {from} features to {to} components", args.out.display()),
    )?;
    Ok(ExitCode::SUCCESS)
}
