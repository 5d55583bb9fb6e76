//! `corsmal-feat embed`: recordings in, the numbers that a network makes of them out.

mod args;
#[cfg(feature = "nets")]
mod recordings;
#[cfg(all(feature = "nets", feature = "onnx"))]
mod views;

use std::process::ExitCode;

pub use args::Args;

use crate::failure::Failure;

/// Says how to get networks.
#[cfg(not(feature = "nets"))]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Args { network: _, paths: _, weights: _, data: _, model: _, library: _, .. } = args;
    let Args { out: _, overwrite: _, jobs: _, told: _, .. } = args;
    Err(super::nets::absent())
}

/// Embeds recordings, or the views of a data set.
#[cfg(feature = "nets")]
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    match args.weights.as_deref() {
        _ if args.network == "r21d" => of_views(&args),
        Some(weights) => recordings::run(&args, weights),
        None => Err(Failure::new(
            "--data is for r21d, which embeds views; name recordings and --weights",
        )),
    }
}

#[cfg(feature = "nets")]
fn of_views(args: &Args) -> Result<ExitCode, Failure> {
    let (Some(data), Some(model), Some(library)) = (&args.data, &args.model, &args.library) else {
        return Err(Failure::new("r21d embeds views: give --data, --model and --library"));
    };
    #[cfg(feature = "onnx")]
    return views::run(args, data, model, library);
    #[cfg(not(feature = "onnx"))]
    {
        let _ = (data, model, library);
        Err(super::detect::absent())
    }
}
