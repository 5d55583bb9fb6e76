//! `corsmal-feat inspect`: what a file holds and whether it is healthy.

mod extracted;
mod output;
mod overview;
mod recording;

use std::path::PathBuf;
use std::process::ExitCode;

use corsmal_files::format::Content;
use serde::Serialize;

use crate::failure::{FAILED_FILES, Failure};

/// Arguments of `inspect`.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  corsmal-feat inspect recording.wav --picture recording.png\n  corsmal-feat inspect feats.npz --json\n\nOf a recording: format, health, picture. Of an output of `extract`: contents, configuration, outcomes;\nof any other .npz: its members.\n\nClipping: at least three successive samples at the channel's own peak. Silence: share of 20 ms blocks\nbelow -60 dBFS. Exit code 1: its content cannot be read."
)]
pub struct Args {
    /// The file; its content decides what it is, not its name.
    file: PathBuf,
    /// Also draw waveform and log-mel spectrogram of each channel, as .png or .svg.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Print JSON instead of text, with the correlation of all channels or all members.
    #[arg(long)]
    json: bool,
}

/// Format of a picture, by its file name.
#[derive(Clone, Copy)]
enum PictureFormat {
    Png,
    Svg,
}

/// A picture to be written.
struct Picture {
    path: PathBuf,
    format: PictureFormat,
}

impl Picture {
    /// Refuses names and folders that cannot work before anything is read.
    fn check(path: PathBuf) -> Result<Self, Failure> {
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        let format = match extension.as_deref().and_then(|e| e.to_str()) {
            Some("png") => PictureFormat::Png,
            Some("svg") => PictureFormat::Svg,
            _ => {
                let name = path.display();
                return Err(Failure::new(format!("--picture {name}: must end in .png or .svg")));
            }
        };
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        if folder.is_some_and(|folder| !folder.is_dir()) {
            let name = path.display();
            return Err(Failure::new(format!("--picture {name}: its folder does not exist")));
        }
        Ok(Self { path, format })
    }
}

/// The JSON form of a refusal.
#[derive(Serialize)]
struct Refusal<'a> {
    path: &'a str,
    status: &'static str,
    byte: Option<u64>,
    reason: &'a str,
}

impl Refusal<'_> {
    /// Says why a file cannot be shown.
    fn print(&self, json: bool) -> Result<ExitCode, Failure> {
        if json {
            print!("{}", to_json(self)?);
        } else {
            let reason = self.reason.strip_prefix(&format!("{}: ", self.path));
            eprintln!("{}: {}", self.path, reason.unwrap_or(self.reason));
        }
        Ok(ExitCode::from(FAILED_FILES))
    }
}

fn to_json(value: &impl Serialize) -> Result<String, Failure> {
    Ok(serde_json::to_string_pretty(value)? + "\n")
}

/// Prints what the file is.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let picture = args.picture.map(Picture::check).transpose()?;
    let content = Content::of(&args.file)
        .map_err(|e| Failure::new(format!("{}: {e}", args.file.display())))?;
    if content == Content::Other {
        // The audio readers say what is wrong with anything else.
        return recording::inspect(&args.file, picture.as_ref(), args.json);
    }
    if picture.is_some() {
        let name = args.file.display();
        return Err(Failure::new(format!("--picture: {name} is no recording")));
    }
    output::inspect(&args.file, args.json)
}
