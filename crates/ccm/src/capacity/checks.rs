//! What is refused or said of a data set's views before anything is computed.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use corsmal_vision::Video;

use super::colours::{Colours, Source};
use super::views::{VIEWS, Views};
use crate::dataset::Recording;
use crate::error::{CcmError, Result};

/// Refuses a folder that is not there or has no table of any recording, and one with a table that several
/// recordings would have: sequences of the same name occur in every container.
pub(crate) fn require_own_tables(
    recordings: &[Recording],
    detections: Option<&Path>,
) -> Result<()> {
    let Some(folder) = detections else { return Ok(()) };
    std::fs::read_dir(folder).map_err(|e| CcmError::io(folder, e))?;
    let mut is_any = recordings.is_empty();
    let mut owners: HashMap<PathBuf, &Recording> = HashMap::new();
    for recording in recordings {
        let views = Views::of(recording, detections);
        let table = views.table();
        is_any |= !matches!(table, Ok(None));
        // Two tables are said of their recording.
        let Ok(Some(table)) = table else { continue };
        if let Some(other) = owners.insert(table.clone(), recording) {
            let own = |recording| {
                let table = Views::of(recording, detections).table_in(folder);
                table.parent().unwrap_or(folder).display().to_string()
            };
            return Err(CcmError::Request(format!(
                "{}: this would be the table of {} and of {}: put tables into a folder for each container, \
                 such as {} and {}",
                table.display(),
                other.path.display(),
                recording.path.display(),
                own(other),
                own(recording),
            )));
        }
    }
    if is_any {
        return Ok(());
    }
    let first = Views::of(&recordings[0], detections).table_in(folder);
    Err(CcmError::Request(format!(
        "{}: has no table of detections for any of the {} recordings in use; expected one such as {}",
        folder.display(),
        recordings.len(),
        first.display()
    )))
}

/// Recordings without a table of detections in a folder that has some, in words.
pub fn without_tables(recordings: &[Recording], detections: Option<&Path>) -> Option<String> {
    let folder = detections?;
    let is_without =
        |recording: &&Recording| matches!(Views::of(recording, detections).table(), Ok(None));
    let without: Vec<&Recording> = recordings.iter().filter(is_without).collect();
    // Where all are, it is refused.
    let first = without.first().filter(|_| without.len() < recordings.len())?;
    Some(format!(
        "{}: {} of {} recordings have no table of detections; the first would be {}",
        folder.display(),
        without.len(),
        recordings.len(),
        Views::of(first, detections).table_in(folder).display()
    ))
}

/// Recordings whose pictures come from videos with B-frames, in words: what the decoder makes of these may be wrong.
pub fn doubtful_colours(recordings: &[Recording]) -> Option<String> {
    let doubtful = |recording: &&Recording| {
        let views = Views::of(recording, None);
        let mut sources = VIEWS.filter_map(|view| match views.colours(view).ok()?.0 {
            Source::Images(_) => None,
            Source::Video(video) => Some(video.is_reordered()),
        });
        sources.any(|reordered| reordered)
    };
    let mut doubtful = recordings.iter().filter(doubtful);
    let first = doubtful.next()?.path.display();
    Some(format!(
        "the videos of {} of {} recordings (the first is {first}) have B-frames, some of which OpenH264 decodes visibly \
         wrong: extract the frames as PNG with ffmpeg (docs/vision.md)",
        1 + doubtful.count(),
        recordings.len()
    ))
}

/// Refuses recordings none of which has a colour frame, and those in videos where this program decodes none.
///
/// # Errors
/// [`CcmError::Request`] that says what was looked for.
pub fn require_colours(recordings: &[Recording]) -> Result<()> {
    for recording in recordings {
        let views = Views::of(recording, None);
        for view in VIEWS {
            match views.colours(view) {
                Ok(colours) if colours.numbers().is_empty() => {}
                Ok(Colours(Source::Video(video))) if !Video::DECODES => {
                    let refusal = video.pictures().err().map(|e| e.to_string());
                    return Err(CcmError::Request(refusal.unwrap_or_default()));
                }
                // What is damaged is said of its recording.
                Ok(_) | Err(_) => return Ok(()),
            }
        }
    }
    Err(CcmError::Request(format!(
        "none of {} recordings has colour frames (rgb/SEQUENCE/c1/0000.png or rgb/SEQUENCE_c1.mp4; see docs/vision.md)",
        recordings.len()
    )))
}
