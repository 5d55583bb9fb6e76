//! Weights on disk: `.npz`, `.safetensors`, `.pth`, under PyTorch's names and in its layouts.

mod npz;
mod pickle;
mod pth;
mod safetensors;

use std::path::{Path, PathBuf};

use thiserror::Error;

pub use safetensors::{from_safetensors, safetensors_text, to_safetensors};

/// Names, shapes and numbers of a network or a part of one.
pub type State = Vec<(String, Vec<usize>, Vec<f32>)>;

/// Largest file of weights read.
pub const MAX_FILE: u64 = 8 << 30;

/// Why weights could not be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum WeightsError {
    /// Reading or writing failed.
    #[error("{}: {source}", path.display())]
    Io {
        /// the file
        path: PathBuf,
        /// why
        source: std::io::Error,
    },
    /// The file's ending is none of those known.
    #[error("{}: weights end in .npz, .safetensors, .pth or .pt", path.display())]
    Ending {
        /// the file
        path: PathBuf,
    },
    /// The content is not what the ending says, or holds something else than weights.
    #[error("{}: {reason}", path.display())]
    Content {
        /// the file
        path: PathBuf,
        /// why
        reason: String,
    },
}

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

/// Little-endian numbers of PyTorch's types in single precision.
fn numbers(kind: Kind, bytes: &[u8]) -> Vec<f32> {
    match kind {
        Kind::F16 => each(bytes, |b| half::f16::from_le_bytes(b).to_f32()),
        Kind::Bf16 => each(bytes, |b| half::bf16::from_le_bytes(b).to_f32()),
        Kind::F32 => each(bytes, f32::from_le_bytes),
        Kind::F64 => each(bytes, |b| f64::from_le_bytes(b) as f32),
        Kind::I64 => each(bytes, |b| i64::from_le_bytes(b) as f32),
        Kind::I32 => each(bytes, |b| i32::from_le_bytes(b) as f32),
    }
}

fn each<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f32) -> Vec<f32> {
    bytes.as_chunks::<N>().0.iter().map(|b| number(*b)).collect()
}

/// Types of numbers that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    F16,
    Bf16,
    F32,
    F64,
    I64,
    I32,
}

impl Kind {
    fn size(self) -> usize {
        match self {
            Self::F16 | Self::Bf16 => 2,
            Self::F32 | Self::I32 => 4,
            Self::F64 | Self::I64 => 8,
        }
    }
}
