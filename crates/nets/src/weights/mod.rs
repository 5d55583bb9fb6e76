//! Weights on disk: `.npz`, `.safetensors`, `.pth`, under PyTorch's names and in its layouts.

mod entry;
mod error;
mod npz;
mod numbers;
mod pickle;
mod pth;
mod safetensors;
mod seal;

use std::fs::File;
use std::io::Read;
use std::path::Path;

use corsmal_files::content;

pub(crate) use entry::entry;
pub use entry::trained_here;
pub use error::WeightsError;
pub use numbers::{MAX_FILE, State};
pub use safetensors::{from_safetensors, safetensors_shapes, safetensors_text, to_safetensors};
pub(crate) use seal::{numbers, sealed};

/// How weights are written.
enum Format {
    Npz,
    Safetensors,
    Pth,
}

impl Format {
    /// By the first bytes of a file, whatever its name.
    fn of(path: &Path) -> std::io::Result<Option<Self>> {
        let mut start = Vec::new();
        File::open(path)?.take(9).read_to_end(&mut start)?;
        Ok(match start.as_slice() {
            [b'P', b'K', 3 | 5, 4 | 6, ..] if pth::is_archive(path) => Some(Self::Pth),
            [b'P', b'K', 3 | 5, 4 | 6, ..] => Some(Self::Npz),
            // The length of a header, below 4 GiB, and the brace with which it begins.
            [_, _, _, _, 0, 0, 0, 0, b'{'] => Some(Self::Safetensors),
            // A pickle without an archive, as PyTorch wrote it before version 1.6.
            [0x80, 2..=5, ..] => Some(Self::Pth),
            _ => None,
        })
    }
}

/// Reads weights, the format by the file's first bytes. Nothing in the file is run.
///
/// # Errors
/// [`WeightsError`].
pub fn read(path: &Path) -> Result<State, WeightsError> {
    let refuse = |reason| WeightsError::Content { path: path.into(), reason };
    match Format::of(path).map_err(|source| WeightsError::Io { path: path.into(), source })? {
        Some(Format::Npz) => npz::read(path).map_err(refuse),
        Some(Format::Safetensors) => {
            let bytes = bytes(path)?;
            let state = from_safetensors(&bytes).map_err(refuse)?;
            entry::check_ours(&bytes, &state).map_err(refuse)?;
            Ok(state)
        }
        Some(Format::Pth) => pth::read(path).map_err(refuse),
        None => Err(refuse("not weights: expected an .npz, .safetensors or .pth file".into())),
    }
}

/// A whole file, when it is not larger than any weights.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>, WeightsError> {
    let io = |source| WeightsError::Io { path: path.into(), source };
    // Files are opened more than once, for their kind and for their content.
    if !std::fs::metadata(path).map_err(io)?.is_file() {
        let reason = "expected a file, not a pipe or device".into();
        return Err(WeightsError::Content { path: path.into(), reason });
    }
    content::read(path, MAX_FILE).map_err(io)
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
            reason: "pickles can be read but not written: .safetensors and .npz hold the same, \
                     and do not need torch.load"
                .into(),
        }),
        _ => Err(WeightsError::Ending { path: path.into() }),
    }
}

fn ending(path: &Path) -> Option<&str> {
    path.extension().and_then(|e| e.to_str())
}
