//! What the vision baseline sees: the container in the last frame of a view, cut out.

use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::draft;
use corsmal_files::workplace::{self, Workplace};
use corsmal_vision::{Detection, Rgb};

use crate::capacity::{Problem, Views, each, key, require_colours, require_own_tables, training};
use crate::dataset::{DataSet, Recording};
use crate::error::{CcmError, Result};
use crate::submission::RowKey;

/// COCO's names of what counts as a container.
pub const LABELS: [&str; 2] = ["cup", "wine glass"];
/// What the label of an opaque container is, of level and type.
pub const OPAQUE: &str = "opaque";
/// How the name of the folder begins in which pictures wait.
const HIDDEN: &str = ".crops-";
/// Table of labels among the pictures of [`write()`].
pub const LABEL_FILE: &str = "labels.csv";

/// The container in the last colour frame of each view: what a mask in `masks/` shows, or else the most
/// confident cup or wine glass among the detections, cut out along the edges of its mask or its box. Once `stop` is
/// set, what is left is missing.
pub fn crops(views: &Views, stop: &AtomicBool) -> [std::result::Result<Rgb, Problem>; 4] {
    let detections = views.detections().map(Option::unwrap_or_default);
    [1, 2, 3, 4].map(|view| crop(views, detections.as_deref().map_err(Clone::clone)?, view, stop))
}

fn crop(
    views: &Views,
    detections: &[Detection],
    view: u8,
    stop: &AtomicBool,
) -> std::result::Result<Rgb, Problem> {
    let colours = views.colours(view)?;
    let last = colours.numbers().pop();
    let last = last.ok_or_else(|| Problem::Missing(format!("no colour image of view {view}")))?;
    // Before a video is decoded to its end.
    views.shows(detections, (view, last), &LABELS)?;
    let (mut reader, mut shown) = (colours.read()?, None);
    while let Some((_, image)) = reader.next(|number| number == last)? {
        if stop.load(Ordering::SeqCst) {
            return Err(Problem::Missing("interrupted".into()));
        }
        shown = image.or(shown);
    }
    let image = shown.ok_or_else(|| Problem::Damaged(format!("view {view} has no last frame")))?;
    let size = (image.width, image.height);
    let edges = views.edges(detections, (view, last), &LABELS, size)?;
    // Detectors also give boxes without area, and beyond the picture.
    image.part(edges).ok_or_else(|| {
        Problem::Missing(format!(
            "view {view}, frame {last}: the container at {edges:?} is outside the image or without area"
        ))
    })
}

/// What [`write()`] made.
#[derive(Debug)]
pub struct Written {
    /// Pictures.
    pub crops: usize,
    /// Labelled training recordings.
    pub recordings: usize,
    /// Views of them that do not show a container.
    pub without: usize,
    /// Recordings with damaged files, which were left out, and the fault.
    pub failed: Vec<(RowKey, String)>,
    /// Whether they are synthetic.
    pub synthetic: bool,
}

/// Writes the crops of all labelled training recordings as PNG into a new or empty folder, and
/// [`LABEL_FILE`] with the columns `id`, `container`, `view`, `level` and `type`. Their labels are
/// written last; an interrupted run leaves nothing behind.
///
/// # Errors
/// [`CcmError`] when the data set cannot be opened or shows no container, the folder holds files, something
/// cannot be written, or the work is stopped.
pub fn write(
    data: &Path,
    detections: Option<&Path>,
    out: &Path,
    jobs: usize,
    interrupted: &AtomicBool,
) -> Result<Written> {
    let io = |e| CcmError::io(out, e);
    let created = !out.exists();
    std::fs::create_dir_all(out).map_err(io)?;
    // Pictures without their labels would look like a finished folder: they wait in a hidden one.
    let visible = |entry: &std::io::Result<std::fs::DirEntry>| {
        let left =
            |e: &std::fs::DirEntry| e.file_name().as_encoded_bytes().starts_with(HIDDEN.as_bytes());
        !entry.as_ref().is_ok_and(left)
    };
    if std::fs::read_dir(out).map_err(io)?.any(|entry| visible(&entry)) {
        return Err(CcmError::Request(format!(
            "{}: has files in it; choose a new or empty folder",
            out.display()
        )));
    }
    let hidden = Workplace::create(out, HIDDEN).map_err(io)?;
    let written = write_into(data, detections, (out, hidden.path()), jobs, interrupted);
    drop(hidden);
    // What was too young to be told from that of a living process.
    workplace::remove_left(out, HIDDEN);
    if written.is_err() && created {
        // Empty, or not ours to remove.
        let _ = std::fs::remove_dir(out);
    }
    written
}

/// Writes into a hidden folder, then moves all into `out`.
fn write_into(
    data: &Path,
    detections: Option<&Path>,
    (out, hidden): (&Path, &Path),
    jobs: usize,
    interrupted: &AtomicBool,
) -> Result<Written> {
    let set = DataSet::open(data)?;
    let io = |e| CcmError::io(out, e);
    let labelled = |r: &Recording| r.container.is_some() && r.name.is_some();
    let recordings: Vec<Recording> = training(&set).into_iter().filter(labelled).collect();
    require_colours(&recordings)?;
    require_own_tables(&recordings, detections)?;
    let found = each(&recordings, jobs, &|_, _| {}, interrupted, |recording| {
        write_recording(recording, detections, hidden, interrupted)
    })?;
    if interrupted.load(Ordering::SeqCst) {
        return Err(CcmError::Interrupted);
    }
    let mut written = Written {
        crops: 0,
        recordings: recordings.len(),
        without: 0,
        failed: Vec::new(),
        synthetic: set.synthetic,
    };
    let mut table = String::from("id,container,view,level,type\n");
    let mut missing = None;
    for (recording, found) in recordings.iter().zip(found) {
        match found? {
            Ok((rows, absent)) => {
                written.crops += rows.len();
                written.without += absent.len();
                missing = missing.or_else(|| absent.into_iter().next());
                rows.iter().for_each(|row| table += row);
            }
            Err(reason) => written.failed.push((key(recording), reason)),
        }
    }
    if written.crops == 0 {
        let first = written.failed.first().map(|(_, reason)| reason.clone()).or(missing);
        let first = first.map(|reason| format!("; the first: {reason}")).unwrap_or_default();
        return Err(CcmError::Request(format!(
            "{}: none of {} labelled training recordings shows a container{first}",
            data.display(),
            recordings.len()
        )));
    }
    for entry in std::fs::read_dir(hidden).map_err(io)? {
        let path = entry.map_err(io)?.path();
        std::fs::rename(&path, out.join(path.file_name().unwrap_or_default())).map_err(io)?;
    }
    draft::write(&out.join(LABEL_FILE), table.as_bytes()).map_err(CcmError::Write)?;
    Ok(written)
}

/// Lines of the table, and why views have none; or the fault of a damaged file.
type Rows = std::result::Result<(Vec<String>, Vec<String>), String>;

fn write_recording(
    recording: &Recording,
    detections: Option<&Path>,
    out: &Path,
    stop: &AtomicBool,
) -> Result<Rows> {
    let (Some(container), Some(name)) = (recording.container, recording.name) else {
        return Ok(Ok((Vec::new(), Vec::new())));
    };
    let (mut found, mut absent) = (Vec::new(), Vec::new());
    for (view, crop) in (1..).zip(crops(&Views::of(recording, detections), stop)) {
        match crop {
            Ok(crop) => found.push((view, crop)),
            Err(Problem::Missing(reason)) => absent.push(reason),
            Err(Problem::Damaged(reason)) => return Ok(Err(reason)),
        }
    }
    let [level, kind] = if container.is_opaque() {
        [OPAQUE; 2]
    } else {
        [name.filling.level().name(), name.filling.kind().name()]
    };
    let mut rows = Vec::with_capacity(found.len());
    for (view, crop) in found {
        let number = container.number();
        let id = format!("{number}_{name}_c{view}");
        let png = crop.to_png().map_err(|e| CcmError::Request(format!("{id}: {e}")))?;
        draft::write(&out.join(format!("{id}.png")), &png).map_err(CcmError::Write)?;
        rows.push(format!("{id},{number},{view},{level},{kind}\n"));
    }
    Ok(Ok((rows, absent)))
}
