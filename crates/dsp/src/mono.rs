//! Mixing channels to one (librosa 0.11 `to_mono`).

use ndarray::{Array1, ArrayView2, Axis};

use crate::error::{DspError, Result};
use crate::real::{Real, require_all_finite};

/// Mean over the channels of `y [channels, samples]`, summed in channel order in `T`.
///
/// # Errors
/// No channel, or a non-finite sample.
pub fn to_mono<T: Real>(y: ArrayView2<T>) -> Result<Array1<T>> {
    require_all_finite("y", y)?;
    let (channels, n) = y.dim();
    let count = T::of(channels as f64);
    let mut mono = Array1::zeros(n);
    if channels == 0 {
        let expected = "at least one channel".into();
        return Err(DspError::Shape { name: "y", expected, actual: vec![channels, n] });
    }
    if channels == 1 {
        return Ok(y.index_axis_move(Axis(0), 0).to_owned());
    }
    for channel in y.outer_iter() {
        mono += &channel;
    }
    mono.mapv_inplace(|x| x / count);
    Ok(mono)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::{Array2, array};

    #[test]
    fn mean_of_channels() {
        let y = array![[1.0_f32, -1.0], [3.0, 1.0]];
        assert_eq!(to_mono(y.view()).unwrap(), array![2.0, 0.0]);
        assert!(to_mono(Array2::<f32>::zeros((0, 4)).view()).is_err());
        assert!(to_mono(array![[f32::NAN]].view()).is_err());
    }
}
