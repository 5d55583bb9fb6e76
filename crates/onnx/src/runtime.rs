//! Models run by ONNX Runtime.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use corsmal_vision::Rgb;
use ort::environment::Environment;
use ort::session::Session;
use ort::value::{DynValue, TensorElementType, TensorRef, ValueType};

use crate::clip::{FEATURES, FRAMES, SIDE};
use crate::error::{OnnxError, Result};
use crate::instances::{self, Instances};

/// ONNX Runtime, once for a process.
pub struct Runtime {
    environment: Environment,
    threads: usize,
}

impl Runtime {
    /// From its shared library; models run on so many threads.
    ///
    /// # Errors
    /// [`OnnxError::Library`].
    pub fn load(library: &Path, threads: usize) -> Result<Self> {
        let refuse = |reason: String| OnnxError::Library { path: library.into(), reason };
        let builder = ort::init_from(library).map_err(|e| refuse(e.to_string()))?;
        let environment = builder.build().map_err(|e| refuse(e.to_string()))?;
        Ok(Self { environment, threads })
    }

    fn model(&self, path: &Path) -> Result<Model> {
        let refuse = |reason: String| OnnxError::Model { path: path.into(), reason };
        let builder = Session::builder(&self.environment).map_err(|e| refuse(e.to_string()))?;
        let mut builder =
            builder.with_intra_threads(self.threads).map_err(|e| refuse(e.to_string()))?;
        // The identity of this file does not cover weights in others.
        let bytes = content(path).map_err(refuse)?;
        if names_files(&bytes) {
            let reason = "its weights lie in other files: export it with external_data=False";
            return Err(refuse(reason.into()));
        }
        let session = builder.commit_from_memory(&bytes).map_err(|e| refuse(e.to_string()))?;
        Ok(Model { path: path.into(), session })
    }
}

/// Most bytes of a model: protocol buffers cannot be larger.
const MOST: u64 = (1 << 31) - 1;

fn content(path: &Path) -> std::result::Result<Vec<u8>, String> {
    let about = std::fs::metadata(path).map_err(|e| e.to_string())?;
    if !about.is_file() || about.len() > MOST {
        return Err("expected a file of at most 2 GiB".into());
    }
    let (mut bytes, file) = (Vec::new(), File::open(path).map_err(|e| e.to_string())?);
    file.take(MOST).read_to_end(&mut bytes).map_err(|e| e.to_string())?;
    Ok(bytes)
}

/// Whether a model names files with its weights: an entry `location` of a tensor's `external_data` (field 13), whose
/// length takes one or two bytes.
fn names_files(model: &[u8]) -> bool {
    const LOCATION: &[u8] = b"\x0a\x08location\x12";
    const EXTERNAL: u8 = 13 << 3 | 2;
    let is_entry =
        |at: usize| [2, 3].iter().any(|&back| at >= back && model[at - back] == EXTERNAL);
    let mut places = (0..model.len()).filter(|&at| model[at..].starts_with(LOCATION));
    places.any(is_entry)
}

struct Model {
    path: PathBuf,
    session: Session,
}

impl Model {
    fn interface(&self, what: &str, actual: String, expected: &str) -> OnnxError {
        interface(&self.path, what, actual, expected)
    }

    /// Refuses a model whose only input is none of these shapes of single precision; -1 is any size.
    fn check_input(&self, shapes: &[&[i64]], expected: &str) -> Result<()> {
        let [input] = self.session.inputs() else {
            let count = self.session.inputs().len();
            return Err(self.interface("number of inputs", count.to_string(), "1"));
        };
        let fits = |wanted: &[i64], found: &[i64]| {
            let same = |(&w, &f): (&i64, &i64)| w == f || w == -1 || f == -1;
            wanted.len() == found.len() && wanted.iter().zip(found).all(same)
        };
        let found = match input.dtype() {
            ValueType::Tensor { ty: TensorElementType::Float32, shape, .. } => {
                shapes.iter().any(|wanted| fits(wanted, shape))
            }
            _ => false,
        };
        let what = format!("input {}", input.name());
        if found { Ok(()) } else { Err(self.interface(&what, input.dtype().to_string(), expected)) }
    }

    /// Dimensions of the input.
    fn rank(&self) -> usize {
        match self.session.inputs().first().map(|input| input.dtype()) {
            Some(ValueType::Tensor { shape, .. }) => shape.len(),
            _ => 0,
        }
    }
}

fn interface(path: &Path, what: &str, actual: String, expected: &str) -> OnnxError {
    let (path, what, expected) = (path.into(), what.into(), expected.into());
    OnnxError::Interface { path, what, actual, expected }
}

/// Shape and numbers of an output, where the runtime keeps them.
fn floats(value: &DynValue) -> std::result::Result<(&[i64], &[f32]), String> {
    let (shape, values) = value.try_extract_tensor::<f32>().map_err(|e| e.to_string())?;
    Ok((&shape[..], values))
}

/// torchvision's Mask R-CNN.
pub struct Detector(Model);

/// Names of its outputs.
const OUTPUTS: [&str; 4] = ["boxes", "labels", "scores", "masks"];

impl Detector {
    /// Opens a model that takes an image `[3, height, width]`, perhaps in a batch of one, and gives
    /// `boxes`, `labels`, `scores` and `masks`.
    ///
    /// # Errors
    /// [`OnnxError::Model`], [`OnnxError::Interface`].
    pub fn open(runtime: &Runtime, path: &Path) -> Result<Self> {
        let model = runtime.model(path)?;
        let shapes: [&[i64]; 2] = [&[3, -1, -1], &[1, 3, -1, -1]];
        model.check_input(&shapes, "an image [3, height, width] in single precision")?;
        let names: Vec<&str> = model.session.outputs().iter().map(|output| output.name()).collect();
        if let Some(missing) = OUTPUTS.iter().find(|name| !names.contains(name)) {
            let expected = format!("{missing} among them");
            return Err(model.interface("outputs", names.join(", "), &expected));
        }
        Ok(Self(model))
    }

    /// What `with` makes of what is seen in a frame.
    ///
    /// # Errors
    /// [`OnnxError::Run`], such as for another size of image than the model was exported for;
    /// [`OnnxError::Interface`] for outputs of other shapes.
    pub fn detect<T>(&mut self, image: &Rgb, with: impl FnOnce(Instances<'_>) -> T) -> Result<T> {
        let values = instances::input(image);
        let mut shape = vec![3, image.height as i64, image.width as i64];
        if self.0.rank() == 4 {
            shape.insert(0, 1);
        }
        let Model { path, session } = &mut self.0;
        let fault = |reason: String| OnnxError::Run { path: path.clone(), reason };
        let text = |e: ort::Error| fault(e.to_string());
        let input = TensorRef::from_array_view((shape, &values[..])).map_err(text)?;
        let outputs = session.run(ort::inputs![input]).map_err(text)?;
        let of = |name: &str| outputs.get(name).ok_or_else(|| fault(format!("no output {name}")));
        let numbers = |name: &str| of(name).and_then(|value| floats(value).map_err(fault));
        let (_, labels) = of("labels")?.try_extract_tensor::<i64>().map_err(text)?;
        let (boxes, scores, masks) = (numbers("boxes")?, numbers("scores")?, numbers("masks")?);
        let (height, width) = (image.height as i64, image.width as i64);
        let n = labels.len() as i64;
        for (name, shape, wanted) in [
            ("boxes", boxes.0, vec![n, 4]),
            ("scores", scores.0, vec![n]),
            ("masks", masks.0, vec![n, 1, height, width]),
        ] {
            if *shape != wanted {
                let (what, actual) = (format!("output {name}"), format!("{shape:?}"));
                return Err(interface(path, &what, actual, &format!("{wanted:?}")));
            }
        }
        let boxes = boxes.1.as_chunks::<4>().0;
        Ok(with(Instances { boxes, labels, scores: scores.1, masks: masks.1 }))
    }
}

/// torchvision's R(2+1)D-18 without its last layer.
pub struct ClipEmbedder(Model);

impl ClipEmbedder {
    /// Opens a model that takes windows `[items, 3, 16, 112, 112]` and gives 512 numbers for each.
    ///
    /// # Errors
    /// [`OnnxError::Model`], [`OnnxError::Interface`].
    pub fn open(runtime: &Runtime, path: &Path) -> Result<Self> {
        let model = runtime.model(path)?;
        let (frames, side) = (FRAMES as i64, SIDE as i64);
        let shape = [-1, 3, frames, side, side];
        model.check_input(&[&shape], "windows [items, 3, 16, 112, 112] in single precision")?;
        Ok(Self(model))
    }

    /// The numbers of a window of [`crate::clip::window`].
    ///
    /// # Errors
    /// [`OnnxError::Run`]; [`OnnxError::Interface`] for outputs of another shape.
    pub fn embed(&mut self, window: &[f32]) -> Result<Vec<f32>> {
        let shape = vec![1, 3, FRAMES as i64, SIDE as i64, SIDE as i64];
        let Model { path, session } = &mut self.0;
        let fault = |reason: String| OnnxError::Run { path: path.clone(), reason };
        let text = |e: ort::Error| fault(e.to_string());
        let input = TensorRef::from_array_view((shape, window)).map_err(text)?;
        let outputs = session.run(ort::inputs![input]).map_err(text)?;
        let (shape, values) = floats(&outputs[0]).map_err(fault)?;
        if values.len() != FEATURES {
            let expected = format!("[1, {FEATURES}]");
            return Err(interface(path, "first output", format!("{shape:?}"), &expected));
        }
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(fault(format!("an output is {value}"))),
            None => Ok(values.to_vec()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn models_with_weights_elsewhere_are_told() {
        assert!(names_files(b"..\x6a\x0d\x0a\x08location\x12\x01w.."));
        assert!(names_files(b"\x6a\x8c\x01\x0a\x08location\x12\x7fw"));
        // An input, and an entry of the model's own properties (field 14).
        assert!(!names_files(b"..\x0a\x08location\x12\x01w..") && !names_files(b""));
        assert!(!names_files(b"\x72\x0d\x0a\x08location\x12\x01w"));
        assert!(content(Path::new(".")).unwrap_err().contains("expected a file"));
    }
}
