//! The frames of a run, from the archive in which they waited, as Parquet.

use corsmal_files::draft::Draft;
use corsmal_files::layout;
use corsmal_files::npz::{NpzError, NpzFile};
use corsmal_files::parquet::{Frames, FramesWriter};
use corsmal_files::provenance::Provenance;
use corsmal_files::table::Table;

use super::error::RunError;
use crate::ledger::Ledger;

/// Writes the frames of the complete partial output into a Parquet file that has no name yet.
///
/// # Errors
/// The archive cannot be read, or the file not be written.
pub(super) fn of_archive(
    ledger: &Ledger,
    table: &Table,
    provenance: &Provenance,
) -> Result<Draft, RunError> {
    let (_, part) = ledger.part()?;
    let mut archive = NpzFile::open(&part)?;
    let out = ledger.out();
    let made = Draft::create(out).map_err(RunError::Folder)?;
    let file = made.handle().map_err(RunError::Folder)?;
    let mut writer = FramesWriter::over(file, out, table, provenance)?;
    let features = provenance.features();
    for id in table.ids() {
        let row = features.iter().map(|feature| {
            let feature = (features.len() > 1).then_some(feature.as_str());
            frames(&mut archive, id, feature)
        });
        writer.push(row.collect::<Result<_, _>>()?)?;
    }
    writer.finish()?;
    Ok(made)
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
