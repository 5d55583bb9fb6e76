//! `corsmal-feat demo`: the main job end to end on synthetic recordings.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

use crate::failure::Failure;
use crate::made::quoted;

/// Arguments of `demo`.
#[derive(clap::Args)]
#[command(after_help = "\
Example:
  corsmal-feat demo --out demo

Everything in the demo is computed from synthetic recordings: scores on them say nothing about
real data.")]
pub struct Args {
    /// Folder for the output, new or from an earlier demo.
    #[arg(long, short, value_name = "DIR", default_value = "corsmal-feat-demo")]
    out: PathBuf,
}

/// Runs the commands by `execute`, showing each before it runs.
pub fn run(
    args: Args,
    execute: &dyn Fn(&[&str]) -> Result<ExitCode, Failure>,
) -> Result<ExitCode, Failure> {
    let started = Instant::now();
    std::fs::create_dir_all(&args.out).map_err(|e| {
        Failure::new(format!("--out {}: cannot be created: {e}", args.out.display()))
    })?;
    let path = |name: &str| args.out.join(name).display().to_string();
    let (data, report) = (path("ccm"), path("report"));
    let recording = path("ccm/train/1/audio/s0_fi3_fu2_b1_l0_audio.wav");
    let (logmel, table) = (path("logmel.npz"), path("mfcc-zcr.npz"));
    let (picture, baselines) = (path("recording.png"), "zcr-mfcc-knn,zcr-mfcc-svm,zcr-mfcc-rf");
    let model = path("report/models/zcr-mfcc-rf-corrected.model");
    let (folder, predictions) = (path("ccm/train/1"), path("predictions.csv"));
    let submission = path("report/submissions/zcr-mfcc-rf-corrected-m5-held-out.csv");
    let annotations = path("ccm/ccm_train_annotation.csv");
    let mut benchmark = vec![
        "benchmark",
        "--data",
        &data,
        "--out",
        &report,
        "--baselines",
        baselines,
        "--capacity",
        "m5",
    ];
    let trained = match cfg!(feature = "nets") {
        true => {
            benchmark.extend(["--methods", "m1", "--epochs", "5"]);
            "Sound and images: three audio baselines and a network trained, held-out containers \
             predicted, their capacity measured in two views (LoDE), and the filling mass from \
             both; all scored"
        }
        false => {
            "Sound and images: three audio baselines trained, held-out containers predicted, \
             their capacity measured in two views (LoDE), and the filling mass from both; all \
             scored"
        }
    };
    let steps: &[(&str, Vec<&str>)] = &[
        (
            "Synthetic recordings, 8 channels, and the views of four cameras, in the layout of \
             the CCM data set",
            vec!["synth", "--out", &data, "--small", "--vision"],
        ),
        (
            "Log-mel tensors of every recording",
            vec!["extract", "--in", &data, "--out", &logmel, "--overwrite"],
        ),
        (
            "One row of statistics per recording",
            vec!["extract", "--in", &data, "--out", &table, "--preset", "mfcc-zcr", "--overwrite"],
        ),
        ("What is in that output", vec!["inspect", &table]),
        (
            "A recording: format, health and picture",
            vec!["inspect", &recording, "--picture", &picture, "--overwrite"],
        ),
        (trained, benchmark),
        (
            "The trained forest on recordings (it was trained on them: this shows the form, not \
             the quality)",
            vec![
                "classify",
                "--model",
                &model,
                "--in",
                &folder,
                "--out",
                &predictions,
                "--overwrite",
            ],
        ),
        (
            "The forest window by window, as on a live stream",
            vec![
                "classify", "--model", &model, "--in", &recording, "--window", "1", "--hop", "0.5",
            ],
        ),
        (
            "Scores of its held-out predictions, with the capacities, by the paper's rules. SYNTHETIC data: they say \
             nothing about real recordings",
            vec![
                "evaluate",
                "--submission",
                &submission,
                "--annotations",
                &annotations,
                "--rules",
                "paper",
            ],
        ),
    ];
    for (about, words) in steps {
        println!("\n# {about}\n$ corsmal-feat {}", shown(words));
        let code = execute(words)?;
        if code != ExitCode::SUCCESS {
            return Ok(code);
        }
    }
    if !cfg!(feature = "nets") {
        println!(
            "\nThis build has no networks; `cargo run --release --features nets -- demo` also trains \
             one of the paper's."
        );
    }
    println!(
        "\nDone in {:.1} s. Open {report}/report.html (SYNTHETIC data, it says so) and {picture};\n\
         predictions are in {predictions}. In Python:\n\
         \n  import numpy as np\n  feats = np.load(\"{logmel}\")\n  print(list(feats)[0], feats[list(feats)[0]].shape)  # [channels, mel bands, frames]\n\
         \nThe same on your own recordings, with one folder per class:\n\
         \n  corsmal-feat extract YOUR_FOLDER -o table.npz --preset mfcc-zcr\n  \
         corsmal-feat cross-validate table.npz --labels folders --report report",
        started.elapsed().as_secs_f64(),
    );
    Ok(ExitCode::SUCCESS)
}

/// A command that a shell takes back.
fn shown(words: &[&str]) -> String {
    words.iter().map(|word| quoted(word)).collect::<Vec<_>>().join(" ")
}
