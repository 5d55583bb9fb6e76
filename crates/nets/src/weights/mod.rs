//! Weights on disk: `.npz`, `.safetensors`, `.pth`, under PyTorch's names and in its layouts.

mod error;
mod npz;
mod numbers;
mod pickle;
mod pth;
mod safetensors;

use std::path::Path;

pub use error::WeightsError;
pub use numbers::{MAX_FILE, State};
pub use safetensors::{from_safetensors, safetensors_shapes, safetensors_text, to_safetensors};

/// Reads weights, the format by the file's ending. Nothing in the file is run.
///
/// # Errors
/// [`WeightsError`].
pub fn read(path: &Path) -> Result<State, WeightsError> {
    let refuse = |reason| WeightsError::Content { path: path.into(), reason };
    match ending(path) {
        Some("npz") => npz::read(path).map_err(refuse),
        Some("safetensors") => from_safetensors(&bytes(path)?).map_err(refuse),
        Some("pth" | "pt") => pth::read(path).map_err(refuse),
        _ => Err(WeightsError::Ending { path: path.into() }),
    }
}

/// A whole file, when it is not larger than any weights.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>, WeightsError> {
    let io = |source| WeightsError::Io { path: path.into(), source };
    let length = std::fs::metadata(path).map_err(io)?.len();
    if length > MAX_FILE {
        let reason = format!("{length} bytes: at most {MAX_FILE} are read");
        return Err(WeightsError::Content { path: path.into(), reason });
    }
    std::fs::read(path).map_err(io)
}

/// Writes weights, whole or not at all; `.npz` or `.safetensors`.
///
/// # Errors
/// [`WeightsError`].
pub fn write(path: &Path, state: &State) -> Result<(), WeightsError> {
    let io = |source| WeightsError::Io { path: path.into(), source };
    match ending(path) {
        Some("npz") => npz::write(path, state)
            .map_err(|reason| WeightsError::Content { path: path.into(), reason }),
        Some("safetensors") => {
            let bytes = to_safetensors(state, None)
                .map_err(|reason| WeightsError::Content { path: path.into(), reason })?;
            corsmal_files::draft::write(path, &bytes).map_err(io)
        }
        Some("pth" | "pt") => Err(WeightsError::Content {
            path: path.into(),
            reason: "a pickle is read, not written: .safetensors and .npz hold the same, and \
                     torch.load is not needed for them"
                .into(),
        }),
        _ => Err(WeightsError::Ending { path: path.into() }),
    }
}

fn ending(path: &Path) -> Option<&str> {
    path.extension().and_then(|e| e.to_str())
}
