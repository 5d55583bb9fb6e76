//! numpy arrays in and out. No `ndarray` type of the numpy crate crosses into our crates: the two
//! may be built against different `ndarray` versions.

use corsmal_dsp::spectral::Spectra;
use corsmal_dsp::stft::StftParams;
use corsmal_dsp::{Real, room_for};
use ndarray::{
    Array2, ArrayView2, ArrayView3, ArrayViewMut, ArrayViewMut3, Dimension, IntoDimension,
};
use numpy::{
    Element, IntoPyArray, PyArray1, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods,
};
use pyo3::prelude::*;

use crate::errors::value_error;
use crate::pool::compute;
use crate::transform::Transform;

/// A contiguous float array from Python, in the precision it came in.
#[derive(FromPyObject)]
pub enum Floats<'py> {
    /// numpy.float32
    F32(PyReadonlyArrayDyn<'py, f32>),
    /// numpy.float64
    F64(PyReadonlyArrayDyn<'py, f64>),
}

/// `array` as `[channels, samples]`; the Python package has made it two-dimensional and contiguous.
pub fn view2<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<ArrayView2<'a, T>> {
    let shape = array.shape();
    let &[rows, columns] = shape else {
        return Err(value_error(format!("expected two dimensions, got shape {shape:?}")));
    };
    ArrayView2::from_shape((rows, columns), array.as_slice()?).map_err(value_error)
}

/// A signal as `[channels, samples]`, planar or interleaved.
pub fn signal<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<ArrayView2<'a, T>> {
    let shape = array.shape();
    match *shape {
        [channels, samples] if !array.is_c_contiguous() && array.is_fortran_contiguous() => {
            let frames = ArrayView2::from_shape((samples, channels), array.as_slice()?);
            Ok(frames.map_err(value_error)?.reversed_axes())
        }
        _ => view2(array),
    }
}

/// `array` as it lies in memory.
pub fn view1<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<&'a [T]> {
    Ok(array.as_slice()?)
}

/// `array` as `[channels, rows, frames]`.
pub fn view3<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<ArrayView3<'a, T>> {
    let shape = array.shape();
    let &[a, b, c] = shape else {
        return Err(value_error(format!("expected three dimensions, got shape {shape:?}")));
    };
    ArrayView3::from_shape((a, b, c), array.as_slice()?).map_err(value_error)
}

/// What spectral features are computed from.
#[derive(FromPyObject)]
pub enum Source<'py> {
    /// A signal and the parameters of its transform.
    Signal(Floats<'py>, Transform<'py>),
    /// A spectrogram.
    Spectrogram(Floats<'py>),
}

impl<'py> Source<'py> {
    /// The array, and the transform where it is a signal.
    pub fn parts(self) -> PyResult<(Floats<'py>, Option<StftParams>)> {
        match self {
            Self::Signal(y, params) => Ok((y, Some(params.params()?))),
            Self::Spectrogram(s) => Ok((s, None)),
        }
    }
}

/// The spectra of a signal, or those that `array` holds.
pub fn spectra<'a, T: Real + Element>(
    array: &'a PyReadonlyArrayDyn<'_, T>,
    stft: Option<&StftParams>,
) -> PyResult<Spectra<'a, T>> {
    match stft {
        Some(params) => Spectra::of(signal(array)?, params).map_err(value_error),
        None => Ok(view3(array)?.into()),
    }
}

/// An owned array handed to numpy without a copy (when it is in C order, as ours are).
pub fn into_numpy<'py, T: Element + Clone, D: Dimension>(
    py: Python<'py>,
    array: ndarray::Array<T, D>,
) -> PyResult<Bound<'py, PyAny>> {
    let shape = array.shape().to_vec();
    let data = if array.is_standard_layout() {
        array.into_raw_vec_and_offset().0
    } else {
        array.as_standard_layout().into_owned().into_raw_vec_and_offset().0
    };
    Ok(data.into_pyarray(py).reshape(shape)?.into_any())
}

/// A numpy array of this shape, which `fill` writes without the GIL: numpy asks for huge
/// pages where its arrays are large, which makes fresh memory several times cheaper than ours is.
pub fn written<'py, R: Element, D: Dimension>(
    py: Python<'py>,
    shape: D,
    fill: impl FnOnce(ArrayViewMut<R, D>) -> corsmal_dsp::Result<()> + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let sizes = shape.slice().to_vec();
    // numpy's own failure would be a panic.
    room_for::<R>("the result", &sizes).map_err(value_error)?;
    let array = PyArray1::<R>::zeros(py, [shape.size()], false);
    let mut values = array.readwrite();
    let out = ArrayViewMut::from_shape(shape, values.as_slice_mut()?).map_err(value_error)?;
    compute(py, || fill(out))?.map_err(value_error)?;
    drop(values);
    Ok(array.reshape(sizes)?.into_any())
}

/// The spectra of `y` as a numpy array, which `fill` writes.
pub fn filled<'py, T: Element, R: Element>(
    py: Python<'py>,
    y: ArrayView2<T>,
    params: &StftParams,
    fill: impl FnOnce(ArrayView2<T>, ArrayViewMut3<R>) -> corsmal_dsp::Result<()> + Send,
) -> PyResult<Bound<'py, PyAny>> {
    let shape = params.shape_of(y).map_err(value_error)?;
    written(py, shape.into_dimension(), |out| fill(y, out))
}

/// Either precision of a two-dimensional result.
pub enum Matrix {
    /// numpy.float32
    F32(Array2<f32>),
    /// numpy.float64
    F64(Array2<f64>),
}

impl Matrix {
    /// Hands the array to numpy.
    pub fn into_numpy(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
        match self {
            Self::F32(a) => into_numpy(py, a),
            Self::F64(a) => into_numpy(py, a),
        }
    }
}

/// `each_precision!(py, view(array), result)`: `result` for the view of either precision of
/// `array: Floats`, computed without the GIL and handed to numpy.
macro_rules! each_precision {
    ($py:ident, $view:ident($array:ident), $result:expr) => {
        match $array {
            $crate::arrays::Floats::F32($array) => {
                let $array = $view(&$array)?;
                let result =
                    $crate::pool::compute($py, || $result)?.map_err($crate::errors::value_error)?;
                $crate::arrays::into_numpy($py, result)
            }
            $crate::arrays::Floats::F64($array) => {
                let $array = $view(&$array)?;
                let result =
                    $crate::pool::compute($py, || $result)?.map_err($crate::errors::value_error)?;
                $crate::arrays::into_numpy($py, result)
            }
        }
    };
}
pub(crate) use each_precision;

/// As [`each_precision`], for the spectra of `source: Source`.
macro_rules! each_spectra {
    ($py:ident, $source:ident, $result:expr) => {{
        let (array, stft) = $source.parts()?;
        match array {
            $crate::arrays::Floats::F32(array) => {
                let $source = $crate::arrays::spectra(&array, stft.as_ref())?;
                let result =
                    $crate::pool::compute($py, || $result)?.map_err($crate::errors::value_error)?;
                $crate::arrays::into_numpy($py, result)
            }
            $crate::arrays::Floats::F64(array) => {
                let $source = $crate::arrays::spectra(&array, stft.as_ref())?;
                let result =
                    $crate::pool::compute($py, || $result)?.map_err($crate::errors::value_error)?;
                $crate::arrays::into_numpy($py, result)
            }
        }
    }};
}
pub(crate) use each_spectra;
