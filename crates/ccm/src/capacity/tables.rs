//! Which table of detections belongs to which recording.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use super::views::Views;
use crate::dataset::Recording;
use crate::error::{CcmError, Result};

/// Refuses a folder with a table that several recordings would have: sequences of the same name occur in
/// every container.
pub(crate) fn require_own_tables(
    recordings: &[Recording],
    detections: Option<&Path>,
) -> Result<()> {
    let Some(folder) = detections else { return Ok(()) };
    let mut owners: HashMap<PathBuf, &Recording> = HashMap::new();
    for recording in recordings {
        let views = Views::of(recording, detections);
        let Some(table) = views.table() else { continue };
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
    Ok(())
}
