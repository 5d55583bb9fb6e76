//! The frames of a run, from the archive in which they waited, as Parquet.

use std::fs::File;
use std::path::Path;

use corsmal_files::layout;
use corsmal_files::npz::{NpzError, NpzFile};
use corsmal_files::parquet::{Frames, FramesWriter};
use corsmal_files::provenance::Provenance;
use corsmal_files::table::Table;

use super::error::RunError;
use crate::ledger::Ledger;

/// The archive of the complete partial output.
///
/// # Errors
/// It cannot be read.
pub(super) fn archive(ledger: &Ledger) -> Result<NpzFile, RunError> {
    let (_, part) = ledger.part()?;
    Ok(NpzFile::open(&part)?)
}

/// Writes the frames of the rows of a table into a file, which errors call `path`.
///
/// # Errors
/// The archive cannot be read, or the file not be written.
pub(super) fn write(
    archive: &mut NpzFile,
    (file, path): (File, &Path),
    table: &Table,
    provenance: &Provenance,
) -> Result<(), RunError> {
    let mut writer = FramesWriter::over(file, path, table, provenance)?;
    let features = provenance.features();
    for id in table.ids() {
        let row = features.iter().map(|feature| {
            let feature = (features.len() > 1).then_some(feature.as_str());
            frames(archive, id, feature)
        });
        writer.push(row.collect::<Result<_, _>>()?)?;
    }
    Ok(writer.finish()?)
}

/// One feature of one recording; empty where that is too short for any frame.
fn frames(archive: &mut NpzFile, id: &str, feature: Option<&str>) -> Result<Frames, NpzError> {
    let name = layout::frames_name(id, feature);
    if !archive.contains(&name) {
        return Ok(Frames::default());
    }
    let values = archive.f32(&name)?;
    let times = archive.f64(&layout::times_name(id, feature))?;
    Ok(Frames { values, times: times.into_iter().collect() })
}
