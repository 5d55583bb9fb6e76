//! Arguments of `embed`.

use std::path::PathBuf;
#[cfg(feature = "nets")]
use std::process::ExitCode;

#[cfg(feature = "nets")]
use serde_json::json;

use crate::args::{Jobs, Told};
#[cfg(feature = "nets")]
use crate::failure::{FAILED_FILES, Failure};

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
    pub(super) network: String,
    /// Recordings: files, folders, globs, manifests.
    #[arg(value_name = "PATH", num_args = 1.., required_unless_present = "data")]
    pub(super) paths: Vec<String>,
    /// Weights of vggish: .pth, .safetensors or .npz.
    #[arg(long, value_name = "FILE", required_unless_present = "data")]
    pub(super) weights: Option<PathBuf>,
    /// Folder of the data set whose views r21d embeds.
    #[arg(long, value_name = "DIR", conflicts_with_all = ["paths", "weights"])]
    #[arg(requires_all = ["model", "library"])]
    pub(super) data: Option<PathBuf>,
    /// r21d as an ONNX model; docs/vision.md says how to export it.
    #[arg(long, value_name = "FILE", requires = "data", conflicts_with_all = ["paths", "weights"])]
    pub(super) model: Option<PathBuf>,
    /// Shared library of ONNX Runtime, such as libonnxruntime.so.1.32.0 of the PyPI package onnxruntime.
    #[arg(long, value_name = "FILE", env = "CORSMAL_ONNXRUNTIME")]
    pub(super) library: Option<PathBuf>,
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

#[cfg(feature = "nets")]
impl Args {
    /// Says what was written, `[rows, width]` of so many recordings, and gives the exit code.
    pub(super) fn tell(
        &self,
        recordings: usize,
        [rows, width]: [usize; 2],
        failed: usize,
    ) -> Result<ExitCode, Failure> {
        let out = self.out.display().to_string();
        self.told.tell(
            || json!({ "out": out, "recordings": recordings, "rows": rows, "width": width, "failed": failed }),
            || format!("{out}: {recordings} recordings, {rows} x {width}"),
        )?;
        Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
    }
}
