//! `corsmal-feat embed r21d`: windows of frames of four views.

use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::Ordering;

use corsmal_ccm::capacity::{Problem, Views, doubtful_colours, require_colours};
use corsmal_ccm::dataset::{Container, SequenceName};
use corsmal_files::format::require_npz;
use corsmal_nets::dataset::Dataset;
use corsmal_nets::items::{Column, Items};
use corsmal_onnx::OnnxError;
use corsmal_onnx::clip::{self, FEATURES, FRAMES};
use corsmal_onnx::runtime::{ClipEmbedder, Runtime};
use serde_json::json;

use super::args::Args;
use crate::failure::{Failure, INTERRUPTED};

/// Views, each of which has a sequence.
const VIEWS: u8 = 4;

/// Embeds the views of a data set and writes.
pub fn run(args: &Args, data: &Path, model: &Path, library: &Path) -> Result<ExitCode, Failure> {
    require_npz(&args.out)?;
    crate::publish::check(&args.out, args.overwrite)?;
    let identity = corsmal_files::identity::of_file(model)
        .map_err(|e| Failure::new(format!("{}: {e}", model.display())))?;
    let set = crate::commands::dataset::open(data)?;
    require_colours(&set.recordings)?;
    if let Some(doubt) = doubtful_colours(&set.recordings) {
        eprintln!("warning: {doubt}");
    }
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
            Err(Fault::Model(view, error)) => {
                return Err(Failure::new(format!("{id}, view {view}: {error}")));
            }
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
    // Type and level follow from the names; recordings of the test parts have none.
    if names.iter().any(Option::is_some) {
        let named = |text: fn(&(Container, SequenceName)) -> String| {
            names.iter().map(|name| name.as_ref().map(text).unwrap_or_default()).collect()
        };
        columns.push(("container".into(), named(|(container, _)| container.number().to_string())));
        columns.push(("sequence".into(), named(|(_, name)| name.to_string())));
    }
    let rows = column.values.len() / FEATURES;
    let dataset = Dataset { ids, columns, items: Items { columns: vec![column] } };
    let about = json!({
        "tool_version": env!("CARGO_PKG_VERSION"), "network": "r21d", "weights": identity,
    });
    dataset.write_sequences(&args.out, FEATURES, &about.to_string())?;
    args.tell(recordings, [rows, FEATURES], failed)
}

/// What ends the work on a recording, or on all.
enum Fault {
    Recording(String),
    Model(u8, OnnxError),
    Interrupted,
}

impl From<Problem> for Fault {
    fn from(problem: Problem) -> Self {
        let (Problem::Missing(reason) | Problem::Damaged(reason)) = problem;
        Self::Recording(reason)
    }
}

/// The numbers of the windows of each view.
fn sequences(embedder: &mut ClipEmbedder, views: &Views) -> Result<Vec<Vec<f32>>, Fault> {
    let mut sequences = Vec::new();
    for view in 1..=VIEWS {
        let colours = views.colours(view)?;
        let numbers = colours.numbers();
        let used = check(view, &numbers).map_err(Fault::Recording)?;
        let mut sequence = Vec::with_capacity(used / FRAMES * FEATURES);
        let mut window = Vec::with_capacity(FRAMES);
        let mut reader = colours.read()?;
        // Not further than the last window.
        for _ in 0..used {
            if crate::interrupt::flag().load(Ordering::SeqCst) {
                return Err(Fault::Interrupted);
            }
            let Some((_, Some(image))) = reader.next(|_| true)? else { break };
            window.push(clip::frame(&image));
            if window.len() == FRAMES {
                let embedded = embedder.embed(&clip::window(&window));
                sequence.extend(embedded.map_err(|error| Fault::Model(view, error))?);
                window.clear();
            }
        }
        sequences.push(sequence);
    }
    Ok(sequences)
}

/// How many frames windows are made of; refuses those that none can be made of.
fn check(view: u8, numbers: &[u32]) -> Result<usize, String> {
    let found = numbers.len();
    if found < FRAMES {
        return Err(format!("view {view} has {found} colour frames; a window has {FRAMES}"));
    }
    let used = found / FRAMES * FRAMES;
    match numbers[..used].windows(2).find(|pair| pair[0].checked_add(1) != Some(pair[1])) {
        None => Ok(used),
        Some(pair) if pair[0] == pair[1] => {
            Err(format!("view {view} has two images of frame {}", pair[0]))
        }
        Some(pair) => Err(format!(
            "view {view}: after frame {} comes frame {}; a window has {FRAMES} frames in a row, so every frame \
             of the video is needed",
            pair[0], pair[1]
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_have_no_gaps() {
        let refused = |numbers: &[u32]| check(2, numbers).unwrap_err();
        let all: Vec<u32> = (1..=20).collect();
        assert_eq!(check(2, &all), Ok(16));
        assert!(refused(&all[..15]).contains("view 2 has 15 colour frames; a window has 16"));
        let gap = [&all[..7], &all[8..]].concat();
        assert!(refused(&gap).contains("after frame 7 comes frame 9"));
        // Behind the last window a gap does no harm.
        assert_eq!(check(2, &[&all[..16], &[18]].concat()), Ok(16));
        let sampled: Vec<u32> = all.iter().map(|number| 8 * number).collect();
        assert!(refused(&sampled).contains("after frame 8 comes frame 16"));
        let twice = [&all[..4], &all[3..]].concat();
        assert!(refused(&twice).contains("two images of frame 4"));
        let most: Vec<u32> = (0..16).map(|k| u32::MAX - 15 + k).chain([u32::MAX; 16]).collect();
        assert!(refused(&most).contains("two images of frame 4294967295"));
    }
}
