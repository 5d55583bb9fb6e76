//! `corsmal-feat synth`: synthetic recordings in the layout of the CCM data set.

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_ccm::synth::{self, SAMPLE_RATE, Size};
use serde_json::json;

use crate::args::Told;
use crate::failure::Failure;

/// Arguments of `synth`.
#[derive(clap::Args)]
#[command(
    long_about = "Make synthetic recordings in the layout and naming of the CORSMAL Containers \
                  Manipulation data set: pouring and shaking of water, rice and pasta, heard by \
                  eight microphones, with annotation files.\n\nThey are for demonstration and \
                  tests. Scores on them say nothing about the real data set.",
    after_help = "Example:\n  corsmal-feat synth --out synthetic --seed 7\n\n\
                  The same seed and size give the same bytes on any number of cores."
)]
pub struct Args {
    /// Folder to write to: new, empty, or from an earlier run of the same command.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// Seed for everything random.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Only the training containers in one setting (57 recordings instead of 133).
    #[arg(long, conflicts_with = "full")]
    small: bool,
    /// All containers, scenarios, backgrounds and illuminations (1,140 recordings, about 1.4 GB).
    #[arg(long)]
    full: bool,
    /// Also make views: colour and depth images of two frames in four views, calibrations, detections
    /// (about 2 MB per recording).
    #[arg(long)]
    vision: bool,
    #[command(flatten)]
    told: Told,
}

/// Writes the data set and says what it is.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    crate::publish::require_disk(&args.out)?;
    let size = match (args.small, args.full) {
        (true, _) => Size::Small,
        (_, true) => Size::Full,
        _ => Size::Reduced,
    };
    let generate = if args.vision { synth::generate_with_views } else { synth::generate };
    let summary = generate(&args.out, size, args.seed)?;
    let (out, recordings, seed) = (&args.out, summary.recordings, args.seed);
    let seconds = summary.frames as f64 / f64::from(SAMPLE_RATE);
    args.told.tell(
        || {
            json!({
                "out": out.display().to_string(), "recordings": recordings, "seconds": seconds, "channels": 8,
                "sample_rate": SAMPLE_RATE, "seed": seed, "synthetic": true,
            })
        },
        || {
            format!(
                "{}: {recordings} synthetic recordings, {seconds:.0} s, 8 channels, {SAMPLE_RATE} Hz \
                 (seed {seed})\n\
                 They are synthetic: scores on them say nothing about the real data set.",
                out.display()
            )
        },
    )?;
    Ok(ExitCode::SUCCESS)
}
