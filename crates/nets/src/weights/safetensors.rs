//! `.safetensors`.

use std::collections::HashMap;

use safetensors::tensor::{Dtype, SafeTensors, TensorView};

use super::numbers::{Kind, State, numbers};

/// Weights from a file's bytes.
///
/// # Errors
/// A text when it is not such a file, or holds numbers of a kind that is not read.
pub fn from_safetensors(bytes: &[u8]) -> Result<State, String> {
    let file =
        SafeTensors::deserialize(bytes).map_err(|e| format!("not a safetensors file: {e}"))?;
    let mut state = file
        .iter()
        .map(|(name, view)| {
            let kind = match view.dtype() {
                Dtype::F16 => Kind::F16,
                Dtype::BF16 => Kind::Bf16,
                Dtype::F32 => Kind::F32,
                Dtype::F64 => Kind::F64,
                Dtype::I64 => Kind::I64,
                Dtype::I32 => Kind::I32,
                other => return Err(format!("{name}: numbers of type {other:?} are not read")),
            };
            Ok((name.to_owned(), view.shape().to_vec(), numbers(kind, view.data())))
        })
        .collect::<Result<State, String>>()?;
    state.sort_by(|a, b| a.0.cmp(&b.0));
    Ok(state)
}

/// Names and shapes of a file's tensors, without their numbers.
///
/// # Errors
/// A text when it is not such a file.
pub fn safetensors_shapes(bytes: &[u8]) -> Result<Vec<(String, Vec<usize>)>, String> {
    let (_, metadata) =
        SafeTensors::read_metadata(bytes).map_err(|e| format!("not a safetensors file: {e}"))?;
    let tensors = metadata.tensors();
    Ok(tensors.into_iter().map(|(name, info)| (name, info.shape.clone())).collect())
}

/// A text entry of a file, from its bytes.
///
/// # Errors
/// A text when it is not such a file.
pub fn safetensors_text(bytes: &[u8], entry: &str) -> Result<Option<String>, String> {
    Ok(safetensors_texts(bytes)?.remove(entry))
}

/// All text entries of a file, from its bytes.
pub(super) fn safetensors_texts(bytes: &[u8]) -> Result<HashMap<String, String>, String> {
    let (_, metadata) =
        SafeTensors::read_metadata(bytes).map_err(|e| format!("not a safetensors file: {e}"))?;
    Ok(metadata.metadata().clone().unwrap_or_default())
}

/// Weights, with text entries beside them, as a file's bytes.
///
/// # Errors
/// A text, when a shape does not fit its numbers.
pub fn to_safetensors(
    state: &State,
    texts: Option<HashMap<String, String>>,
) -> Result<Vec<u8>, String> {
    let bytes: Vec<(&String, &Vec<usize>, Vec<u8>)> = state
        .iter()
        .map(|(name, shape, values)| {
            (name, shape, values.iter().flat_map(|v| v.to_le_bytes()).collect())
        })
        .collect();
    let views = bytes
        .iter()
        .map(|(name, shape, bytes)| {
            let view = TensorView::new(Dtype::F32, (*shape).clone(), bytes);
            view.map(|view| (name.as_str(), view)).map_err(|e| format!("{name}: {e}"))
        })
        .collect::<Result<Vec<_>, String>>()?;
    safetensors::serialize(views, texts).map_err(|e| e.to_string())
}
