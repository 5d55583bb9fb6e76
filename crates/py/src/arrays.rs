//! numpy arrays in and out. No `ndarray` type of the numpy crate crosses into our crates: the two
//! may be built against different `ndarray` versions.

use ndarray::{Array2, Array3, ArrayView2, ArrayView3, Dimension};
use numpy::{Element, IntoPyArray, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// A contiguous float array from Python, in the precision it came in.
#[derive(FromPyObject)]
pub enum Floats<'py> {
    /// numpy.float32
    F32(PyReadonlyArrayDyn<'py, f32>),
    /// numpy.float64
    F64(PyReadonlyArrayDyn<'py, f64>),
}

/// `array` as `[channels, samples]`; the front end has made it two-dimensional and contiguous.
pub fn view2<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<ArrayView2<'a, T>> {
    let shape = array.shape();
    let &[rows, columns] = shape else {
        return Err(crate::value_error(format!("expected two dimensions, got shape {shape:?}")));
    };
    ArrayView2::from_shape((rows, columns), array.as_slice()?).map_err(crate::value_error)
}

/// `array` as `[channels, rows, frames]`.
pub fn view3<'a, T: Element>(array: &'a PyReadonlyArrayDyn<'_, T>) -> PyResult<ArrayView3<'a, T>> {
    let shape = array.shape();
    let &[a, b, c] = shape else {
        return Err(crate::value_error(format!("expected three dimensions, got shape {shape:?}")));
    };
    ArrayView3::from_shape((a, b, c), array.as_slice()?).map_err(crate::value_error)
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

/// Either precision of a three-dimensional result.
pub enum Tensor {
    /// numpy.float32
    F32(Array3<f32>),
    /// numpy.float64
    F64(Array3<f64>),
}

/// Either precision of a two-dimensional result.
pub enum Matrix {
    /// numpy.float32
    F32(Array2<f32>),
    /// numpy.float64
    F64(Array2<f64>),
}

macro_rules! into_either {
    ($name:ident) => {
        impl $name {
            /// Hands the array to numpy.
            pub fn into_numpy(self, py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
                match self {
                    Self::F32(a) => into_numpy(py, a),
                    Self::F64(a) => into_numpy(py, a),
                }
            }
        }
    };
}
into_either!(Tensor);
into_either!(Matrix);

/// `each_precision!(py, view(array), result)`: `result` for the view of either precision of
/// `array: Floats`, computed without the GIL and handed to numpy.
macro_rules! each_precision {
    ($py:ident, $view:ident($array:ident), $result:expr) => {
        match $array {
            $crate::arrays::Floats::F32($array) => {
                let $array = $view(&$array)?;
                let result = $py.detach(|| $result).map_err($crate::value_error)?;
                $crate::arrays::into_numpy($py, result)
            }
            $crate::arrays::Floats::F64($array) => {
                let $array = $view(&$array)?;
                let result = $py.detach(|| $result).map_err($crate::value_error)?;
                $crate::arrays::into_numpy($py, result)
            }
        }
    };
}
pub(crate) use each_precision;
