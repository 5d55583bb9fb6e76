//! `.npz`: a member for each name.

use std::path::Path;

use corsmal_files::draft::Draft;
use corsmal_files::npz::{Compression, NpzFile, NpzWriter};

use super::numbers::State;

pub(super) fn read(path: &Path) -> Result<State, String> {
    let mut file = NpzFile::open(path).map_err(|e| e.to_string())?;
    let mut state = State::new();
    for name in file.names().to_vec() {
        let array = file.f32(&name).map_err(|e| e.to_string())?;
        let shape = array.shape().to_vec();
        let values = array.as_standard_layout().iter().copied().collect();
        state.push((name, shape, values));
    }
    Ok(state)
}

pub(super) fn write(path: &Path, state: &State) -> Result<(), String> {
    let draft = Draft::create(path).map_err(|e| e.to_string())?;
    let handle = draft.handle().map_err(|e| e.to_string())?;
    let mut writer = NpzWriter::over(handle, path, Compression::Stored, Vec::new());
    for (name, shape, values) in state {
        writer.floats(name, shape, values).map_err(|e| e.to_string())?;
    }
    writer.finish().map_err(|e| e.to_string())?;
    draft.publish().map_err(|e| e.to_string())
}
