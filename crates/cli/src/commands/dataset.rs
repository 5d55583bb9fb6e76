//! `corsmal-feat dataset`: the CCM data set on disk.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Subcommand;
use corsmal_ccm::dataset::{DataSet, Findings, check};

use crate::failure::{FAILED_FILES, Failure};

/// Names listed per container before the rest is counted.
const LISTED: usize = 6;

/// Arguments of `dataset`.
#[derive(clap::Args)]
#[command(after_help = "Example:\n  corsmal-feat dataset check ~/CCM")]
pub struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Subcommand)]
enum Action {
    /// Report what is present, missing and odd.
    ///
    /// Two layouts are known: the folder tree of 2020 (train/1/audio/s0_fi0_fu0_b0_l0_audio.wav) and
    /// the flat release of 2021 (train/audio/000000.wav with its annotation file). The exit code is 1
    /// if something is odd or a container is incomplete; containers of which nothing is there are listed.
    #[command(after_help = "Example:\n  corsmal-feat dataset check ~/CCM")]
    Check {
        /// Folder of the data set.
        dir: PathBuf,
        /// Print the findings as JSON.
        #[arg(long)]
        json: bool,
    },
}

/// Prints the findings.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let Action::Check { dir, json } = args.action;
    let findings = check(&DataSet::open(&dir)?);
    if json {
        println!("{}", serde_json::to_string_pretty(&findings)?);
    } else {
        print(&findings);
    }
    Ok(if findings.sound() { ExitCode::SUCCESS } else { ExitCode::from(FAILED_FILES) })
}

/// Opens a data set, and says if files in it are odd: what they hold may be missing.
pub fn open(root: &Path) -> Result<DataSet, Failure> {
    let set = DataSet::open(root)?;
    if let Some(first) = set.odd.first() {
        let others = match set.odd.len() - 1 {
            0 => String::new(),
            n => format!(" (and {n} more: see dataset check)"),
        };
        eprintln!("warning: {}: {}{others}", first.path.display(), first.what);
    }
    Ok(set)
}

fn print(findings: &Findings) {
    println!("{}", findings.root.display());
    if findings.synthetic {
        println!("SYNTHETIC recordings: their scores say nothing about the real data set");
    }
    println!(
        "{} recordings, {} with a known filling, {:.1} min",
        findings.recordings,
        findings.labelled,
        findings.seconds / 60.0
    );
    for (format, count) in &findings.formats {
        println!("{count:6} files: {format}");
    }
    for path in &findings.annotations {
        println!("annotations: {}", path.display());
    }
    match &findings.actions {
        Some(path) => println!("actions:     {}", path.display()),
        None => println!("actions:     none (man_annotations.csv crops the training spectrograms)"),
    }
    println!("\n{:>9}  {:8} {:12} {:>9}", "container", "category", "part", "found");
    for c in &findings.containers {
        print!(
            "{:>9}  {:8} {:12} {:>4}/{:<4}",
            c.container.number(),
            c.category,
            c.subset,
            c.found,
            c.expected
        );
        match (c.missing.len(), findings.synthetic) {
            (0, _) | (_, true) => println!(),
            (n, _) if n <= LISTED => println!(" missing {}", c.missing.join(" ")),
            (n, _) => {
                println!(" missing {} and {} more", c.missing[..LISTED].join(" "), n - LISTED);
            }
        }
    }
    if !findings.absent.is_empty() {
        let list: Vec<_> = findings.absent.iter().map(|c| c.number().to_string()).collect();
        println!("not there: containers {}", list.join(", "));
    }
    if findings.unplaced > 0 {
        println!("{} numbered files belong to no known container", findings.unplaced);
    }
    for odd in &findings.odd {
        println!("odd: {}: {}", odd.path.display(), odd.what);
    }
}
