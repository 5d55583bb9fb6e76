//! The values of a window.

use super::{Window, shapes};
use crate::error::{DspError, Result};

/// Longest window; bounds the memory that a length from outside can take.
pub const MAX_LENGTH: usize = 1 << 26;

/// The window of `nx` points in double precision (`scipy.signal.get_window(window, nx, fftbins)`).
///
/// `fftbins = true` gives the periodic window that spectral analysis uses, `false` the symmetric one.
///
/// # Errors
/// More than [`MAX_LENGTH`] points, or a length for which this window is not defined.
pub fn get_window(window: &Window, nx: usize, fftbins: bool) -> Result<Vec<f64>> {
    if nx > MAX_LENGTH {
        return Err(DspError::parameter("Nx", nx, format!("at most {MAX_LENGTH}")));
    }
    match *window {
        Window::Samples(ref values) if values.len() != nx => {
            return Err(DspError::parameter("window", window, format!("{nx} values")));
        }
        Window::Samples(ref values) => return Ok(values.to_vec()),
        Window::KaiserBesselDerived(_) if fftbins => {
            let allowed = "False for kaiser_bessel_derived, which is defined as symmetric only";
            return Err(DspError::parameter("fftbins", "True", allowed));
        }
        Window::KaiserBesselDerived(_) if !nx.is_multiple_of(2) => {
            return Err(DspError::parameter("Nx", nx, "even for kaiser_bessel_derived"));
        }
        Window::Exponential(Some(center), _) if !fftbins => {
            let allowed = "left out when the window is symmetric (fftbins=False)";
            return Err(DspError::parameter("center", center, allowed));
        }
        Window::Dpss(nw) if nx > 1 && 2.0 * nw >= nx as f64 => {
            return Err(DspError::parameter("NW", nw, format!("below half of the {nx} points")));
        }
        _ => {}
    }
    if nx <= 1 {
        return Ok(vec![1.0; nx]);
    }
    // The periodic window is the symmetric one of one more point, without its last point.
    let mut values = shapes::symmetric(window, if fftbins { nx + 1 } else { nx });
    values.truncate(nx);
    Ok(values)
}

/// The periodic window of `win_length` points, zero-padded to `n_fft` as librosa centres it
/// (`left = (n_fft - win_length) / 2`).
///
/// # Errors
/// A window longer than the transform, and as [`get_window`].
pub fn padded_window(window: &Window, win_length: usize, n_fft: usize) -> Result<Vec<f64>> {
    if win_length == 0 || win_length > n_fft {
        return Err(DspError::parameter("win_length", win_length, format!("1 to n_fft ({n_fft})")));
    }
    let values = get_window(window, win_length, true)?;
    let mut padded = vec![0.0; n_fft];
    let left = (n_fft - win_length) / 2;
    padded[left..left + win_length].copy_from_slice(&values);
    Ok(padded)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periodic_hann() {
        let w = get_window(&Window::Hann, 4, true).unwrap();
        for (a, b) in w.iter().zip([0.0, 0.5, 1.0, 0.5]) {
            assert!((a - b).abs() < 1e-15);
        }
    }

    #[test]
    fn lengths_that_do_not_fit_are_refused() {
        let samples = Window::Samples(vec![1.0; 7].into());
        assert_eq!(get_window(&samples, 7, true).unwrap(), [1.0; 7]);
        assert!(get_window(&samples, 8, true).is_err());
        assert!(get_window(&Window::KaiserBesselDerived(4.0), 7, false).is_err());
        assert!(get_window(&Window::Dpss(4.0), 8, true).is_err());
        assert!(get_window(&Window::Hann, usize::MAX, true).is_err());
    }
}
