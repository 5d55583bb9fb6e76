//! `corsmal-feat inspect`: what a file holds and whether it is healthy.

mod calibration;
mod extracted;
mod features;
mod image;
mod json;
mod kind;
mod model;
mod output;
mod picture;
mod recording;
mod refusal;
mod run;
mod several;
mod table;
mod tensors;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use corsmal_extract::inputs::{InputSource, is_stored, shown};
use corsmal_files::feature_file::FeatureFile;
use corsmal_files::format::Content;
use corsmal_files::layout;
use corsmal_files::partition::is_partitioned;

use crate::failure::Failure;
use kind::Kind;
use picture::{Picture, PictureArgs};

/// Arguments of `inspect`.
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  \
    corsmal-feat inspect recording.wav --picture recording.png\n  \
    corsmal-feat inspect recordings/\n  \
    corsmal-feat inspect recording.wav --picture part.pdf --channels 0,3 --start 2 --end 4\n  \
    corsmal-feat inspect feats.npz --picture feats.png --recording dog_01\n  \
    corsmal-feat inspect my.model\n  \
    corsmal-feat inspect level.safetensors\n\n\
    Shows format and health of a recording; one line each for folders and several recordings;\n\
    contents, configuration and outcomes of an output of `extract`; the members of any other .npz;\n\
    what a model, network, checkpoint or capacity model was trained on; how many predictions (CSV,\n\
    JSON lines) there are of each class; and what submissions, capacities, detections, calibrations,\n\
    depth images, masks, configurations and ledgers contain.\n\n\
    Clipping: at least three successive samples at the channel's own peak of -20 dBFS or more.\n\
    Silence: share of 20 ms blocks below -60 dBFS. Exit code 1: some content cannot be read.")]
pub struct Args {
    /// Files and folders, recognised by their content, not by their names.
    #[arg(required = true, value_name = "PATH")]
    paths: Vec<PathBuf>,
    #[command(flatten)]
    picture: PictureArgs,
    /// Print JSON instead of text, with the correlation of all channels or all members.
    #[arg(long)]
    json: bool,
}

/// Prints what the files are.
pub fn run(args: Args) -> Result<ExitCode, Failure> {
    let picture = args.picture.check()?;
    if let Some(pipe) = args.paths.iter().find(|path| InputSource::at((*path).clone()).comes_once())
    {
        return Err(Failure::new(format!(
            "{}: inspect reads files more than once, and a pipe or device gives its bytes once: name a file",
            pipe.display()
        )));
    }
    if let Some(address) = args.paths.iter().find(|path| path.to_str().is_some_and(is_stored)) {
        return Err(Failure::new(format!(
            "{}: inspect reads files on a disk: copy it to one first",
            shown(&address.to_string_lossy())
        )));
    }
    match args.paths.as_slice() {
        [path] if is_partitioned(path) => match &picture {
            None => output::inspect(path, args.json),
            Some(_) => Err(Failure::new("--picture: name one of the files in the folder")),
        },
        [path] if path == Path::new("-") => {
            Err(Failure::new("-: inspect reads files, not standard input: name a file"))
        }
        [path] if !path.is_dir() => single(path, picture.as_ref(), args.json),
        paths => {
            if picture.is_some() {
                return Err(Failure::new(
                    "--picture: name one file to draw, not a folder or several",
                ));
            }
            if let Some(other) = paths.iter().find(|path| is_other(path)) {
                return Err(Failure::new(format!(
                    "{}: no recording: files of other kinds are inspected one at a time",
                    other.display()
                )));
            }
            several::inspect(paths, args.json)
        }
    }
}

/// Whether a file is of a known kind that is no recording.
fn is_other(path: &Path) -> bool {
    path.is_file()
        && (Content::of(path).is_ok_and(|content| content != Content::Other)
            || kind::of(path).is_ok_and(|kind| {
                kind.is_some_and(|kind| !matches!(kind, Kind::Table | Kind::Json))
            }))
}

fn single(path: &Path, picture: Option<&Picture>, json: bool) -> Result<ExitCode, Failure> {
    let content =
        Content::of(path).map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
    if content != Content::Other {
        let code = output::inspect(path, json)?;
        if let (Some(picture), true) = (picture, code == ExitCode::SUCCESS) {
            draw(path, picture)?;
        }
        return Ok(code);
    }
    // The audio readers say what is wrong with anything else.
    let Some(kind) = kind::of(path)? else { return recording::inspect(path, picture, json) };
    if picture.is_some() {
        let path = path.display();
        return Err(Failure::new(format!("--picture: {path} has neither sound nor features")));
    }
    match kind {
        Kind::Model => model::inspect(path, json),
        Kind::Tensors => tensors::inspect(path, json),
        Kind::Json => json::inspect(path, json),
        Kind::Ledger => run::ledger(path, json),
        Kind::Picture => image::inspect(path, json),
        Kind::Pickle => calibration::inspect(path, json),
        Kind::Table => table::inspect(path, json),
        Kind::Configuration => run::configuration(path, json),
        Kind::Page(format) => run::page(path, format, json),
    }
}

/// The frames of a recording, or the rows of a summary.
fn draw(path: &Path, picture: &Picture) -> Result<(), Failure> {
    match FeatureFile::open(path)? {
        FeatureFile::Npz(mut file) => {
            if layout::is_ours(&file) && file.contains("__summary__") {
                let (table, _) = layout::read_table(&mut file)?;
                return features::draw_table(path, table.ids(), table.values(), picture);
            }
            features::draw_npz(&mut file, picture)
        }
        FeatureFile::Npy(file) => {
            let values = file.components()?.mapv(|v| v as f32);
            features::draw_array(path, values, picture)
        }
        FeatureFile::Parquet(file) if !file.is_ours() => {
            let table = file.numbers()?;
            let rows = 0..table.values.nrows();
            let ids = table.ids.unwrap_or_else(|| rows.map(|row| row.to_string()).collect());
            features::draw_table(path, &ids, table.values.mapv(|v| v as f32).view(), picture)
        }
        FeatureFile::Parquet(mut file) => {
            if !file.frame_features().is_empty() {
                return features::draw_parquet(&mut file, picture);
            }
            let (table, _) = file.table()?;
            features::draw_table(path, table.ids(), table.values(), picture)
        }
    }
}
