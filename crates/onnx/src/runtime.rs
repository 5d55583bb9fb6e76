//! Models run by ONNX Runtime.

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
        let session = builder.commit_from_file(path).map_err(|e| refuse(e.to_string()))?;
        Ok(Model { path: path.into(), session })
    }
}

struct Model {
    path: PathBuf,
    session: Session,
}

impl Model {
    fn interface(&self, what: &str, actual: String, expected: &str) -> OnnxError {
        let (path, what) = (self.path.clone(), what.into());
        OnnxError::Interface { path, what, actual, expected: expected.into() }
    }

    /// Refuses a model whose only input is none of these shapes of single precision; -1 is any size.
    fn check_input(&self, shapes: &[&[i64]], expected: &str) -> Result<()> {
        let [input] = self.session.inputs() else {
            let count = self.session.inputs().len();
            return Err(self.interface("the number of its inputs", count.to_string(), "1"));
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

    fn fault(&self, reason: impl std::fmt::Display) -> OnnxError {
        OnnxError::Run { path: self.path.clone(), reason: reason.to_string() }
    }
}

/// Shape and numbers of an output.
fn floats(value: &DynValue) -> std::result::Result<(Vec<i64>, Vec<f32>), String> {
    let (shape, values) = value.try_extract_tensor::<f32>().map_err(|e| e.to_string())?;
    Ok((shape.to_vec(), values.to_vec()))
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
        model.check_input(&shapes, "an image [3, height, width] of single precision")?;
        let names: Vec<&str> = model.session.outputs().iter().map(|output| output.name()).collect();
        if let Some(missing) = OUTPUTS.iter().find(|name| !names.contains(name)) {
            let what = "the list of its outputs";
            let expected = format!("a list with {missing}");
            return Err(model.interface(what, names.join(", "), &expected));
        }
        Ok(Self(model))
    }

    /// What is seen in a frame.
    ///
    /// # Errors
    /// [`OnnxError::Run`], such as for another size of image than the model was exported for;
    /// [`OnnxError::Interface`] for outputs of other shapes.
    pub fn detect(&mut self, image: &Rgb) -> Result<Instances> {
        let values = instances::input(image);
        let mut shape = vec![3, image.height as i64, image.width as i64];
        if self.0.rank() == 4 {
            shape.insert(0, 1);
        }
        let found = self.found(shape, &values);
        let (boxes, labels, scores, masks) = found.map_err(|e| self.0.fault(e))?;
        let (height, width) = (image.height as i64, image.width as i64);
        let n = labels.len() as i64;
        for (name, shape, wanted) in [
            ("boxes", &boxes.0, vec![n, 4]),
            ("scores", &scores.0, vec![n]),
            ("masks", &masks.0, vec![n, 1, height, width]),
        ] {
            if *shape != wanted {
                let (what, expected) = (format!("output {name}"), format!("{wanted:?}"));
                return Err(self.0.interface(&what, format!("{shape:?}"), &expected));
            }
        }
        let boxes = boxes.1.as_chunks::<4>().0.to_vec();
        Ok(Instances { boxes, labels, scores: scores.1, masks: masks.1 })
    }

    #[expect(clippy::type_complexity, reason = "taken apart at once")]
    fn found(
        &mut self,
        shape: Vec<i64>,
        values: &[f32],
    ) -> std::result::Result<
        ((Vec<i64>, Vec<f32>), Vec<i64>, (Vec<i64>, Vec<f32>), (Vec<i64>, Vec<f32>)),
        String,
    > {
        let text = |e: ort::Error| e.to_string();
        let input = TensorRef::from_array_view((shape, values)).map_err(text)?;
        let outputs = self.0.session.run(ort::inputs![input]).map_err(text)?;
        let of = |name: &str| outputs.get(name).ok_or_else(|| format!("no output {name}"));
        let (_, labels) = of("labels")?.try_extract_tensor::<i64>().map_err(text)?;
        Ok((floats(of("boxes")?)?, labels.to_vec(), floats(of("scores")?)?, floats(of("masks")?)?))
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
        model.check_input(&[&shape], "windows [items, 3, 16, 112, 112] of single precision")?;
        Ok(Self(model))
    }

    /// The numbers of a window of [`crate::clip::window`].
    ///
    /// # Errors
    /// [`OnnxError::Run`]; [`OnnxError::Interface`] for outputs of another shape.
    pub fn embed(&mut self, window: &[f32]) -> Result<Vec<f32>> {
        let (shape, values) = self.numbers(window).map_err(|e| self.0.fault(e))?;
        if values.len() != FEATURES {
            let (actual, expected) = (format!("{shape:?}"), format!("[1, {FEATURES}]"));
            return Err(self.0.interface("its first output", actual, &expected));
        }
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(self.0.fault(format!("an output is {value}"))),
            None => Ok(values),
        }
    }

    fn numbers(&mut self, window: &[f32]) -> std::result::Result<(Vec<i64>, Vec<f32>), String> {
        let shape = vec![1, 3, FRAMES as i64, SIDE as i64, SIDE as i64];
        let text = |e: ort::Error| e.to_string();
        let input = TensorRef::from_array_view((shape, window)).map_err(text)?;
        let outputs = self.0.session.run(ort::inputs![input]).map_err(text)?;
        floats(&outputs[0])
    }
}
