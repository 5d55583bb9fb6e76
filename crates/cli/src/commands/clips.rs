//! `corsmal-feat embed r21d`: windows of frames of four views.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use corsmal_ccm::capacity::{Kind, Problem, Views};
use corsmal_ccm::dataset::DataSet;
use corsmal_files::format::require_npz;
use corsmal_nets::dataset::Dataset;
use corsmal_nets::items::{Column, Items};
use corsmal_onnx::OnnxError;
use corsmal_onnx::clip::{self, FEATURES, FRAMES};
use corsmal_onnx::runtime::{ClipEmbedder, Runtime};
use corsmal_vision::Rgb;
use serde_json::json;

use super::embed::Args;
use crate::failure::{FAILED_FILES, Failure, INTERRUPTED};

/// Views, each of which has a sequence.
const VIEWS: u8 = 4;

/// Embeds the views of a data set and writes.
pub fn run(args: &Args, data: &Path, model: &Path, library: &Path) -> Result<ExitCode, Failure> {
    require_npz(&args.out)?;
    crate::publish::check(&args.out, args.overwrite)?;
    let identity = corsmal_files::identity::of_file(model)
        .map_err(|e| Failure::new(format!("{}: {e}", model.display())))?;
    let set = DataSet::open(data)?;
    let runtime = Runtime::load(library, args.jobs.count())?;
    let mut embedder = ClipEmbedder::open(&runtime, model)?;
    let (mut ids, mut view_of, mut names) = (Vec::new(), Vec::new(), Vec::new());
    let (mut column, mut recordings, mut failed) = (Column::of([]), 0usize, 0usize);
    for recording in &set.recordings {
        let relative = recording.path.strip_prefix(&set.root).unwrap_or(&recording.path);
        let id = relative.with_extension("").to_string_lossy().replace('\\', "/");
        match sequences(&mut embedder, &Views::of(recording, None)) {
            Err(Fault::Recording(reason)) => {
                eprintln!("{id}: {reason}");
                failed += 1;
            }
            Err(Fault::Model(error)) => return Err(error.into()),
            Err(Fault::Interrupted) => {
                eprintln!("interrupted; nothing was written");
                return Ok(ExitCode::from(INTERRUPTED));
            }
            Ok(sequences) => {
                recordings += 1;
                if !(args.told.quiet || args.told.json) {
                    let windows = sequences.iter().map(Vec::len).sum::<usize>() / FEATURES;
                    eprintln!("{id}: {windows} windows");
                }
                let name = recording.container.zip(recording.name);
                for (view, sequence) in (1..).zip(sequences) {
                    ids.push(id.clone());
                    view_of.push(view.to_string());
                    names.push(name);
                    column.push(&sequence);
                }
            }
        }
    }
    if recordings == 0 {
        return Err(Failure::new("no recording has an embedding: nothing was written"));
    }
    let mut columns = vec![("view".to_owned(), view_of)];
    // Type and level follow from the names, where all are known.
    if let Some(names) = names.into_iter().collect::<Option<Vec<_>>>() {
        let containers = names.iter().map(|(c, _)| c.number().to_string()).collect();
        columns.push(("container".into(), containers));
        columns.push(("sequence".into(), names.iter().map(|(_, name)| name.to_string()).collect()));
    }
    let rows = column.values.len() / FEATURES;
    let dataset = Dataset { ids, columns, items: Items { columns: vec![column] } };
    let about = json!({
        "tool_version": env!("CARGO_PKG_VERSION"), "network": "r21d", "weights": identity,
    });
    dataset.write_sequences(&args.out, FEATURES, &about.to_string())?;
    let out = &args.out;
    args.told.tell(
        || json!({ "out": out, "recordings": recordings, "rows": rows, "width": FEATURES, "failed": failed }),
        || format!("{}: {recordings} recordings, {rows} x {FEATURES}", out.display()),
    )?;
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}

/// What ends the work on a recording, or on all.
enum Fault {
    Recording(String),
    Model(OnnxError),
    Interrupted,
}

/// The numbers of the windows of each view.
fn sequences(embedder: &mut ClipEmbedder, views: &Views) -> Result<Vec<Vec<f32>>, Fault> {
    let mut sequences = Vec::new();
    for view in 1..=VIEWS {
        let frames = views.frames(Kind::Rgb, view).map_err(|problem| match problem {
            Problem::Missing(reason) | Problem::Damaged(reason) => Fault::Recording(reason),
        })?;
        if frames.len() < FRAMES {
            let found = frames.len();
            return Err(Fault::Recording(format!(
                "view {view} has {found} colour frames; a window has {FRAMES}"
            )));
        }
        let mut sequence = Vec::with_capacity(frames.len() / FRAMES * FEATURES);
        for window in frames.chunks_exact(FRAMES) {
            if crate::interrupt::flag().load(Ordering::SeqCst) {
                return Err(Fault::Interrupted);
            }
            let read = |frame: &corsmal_ccm::capacity::Frame| {
                let image = Rgb::read(&frame.path).map_err(|e| Fault::Recording(e.to_string()))?;
                Ok(clip::frame(&image))
            };
            let window = window.iter().map(read).collect::<Result<Vec<_>, _>>()?;
            sequence.extend(embedder.embed(&clip::window(&window)).map_err(Fault::Model)?);
        }
        sequences.push(sequence);
    }
    Ok(sequences)
}
