//! Short-time Fourier transform of whole arrays (librosa 0.11 `stft`, `istft` conventions).

use ndarray::{Array3, ArrayView2};
use num_complex::Complex;
use realfft::RealFftPlanner;
use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result};
use crate::real::Real;
use crate::window::{Window, padded_window};

/// How `center = true` fills the `n_fft / 2` samples before the first and after the last one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PadMode {
    /// Zeros (librosa's default since 0.10).
    #[default]
    Constant,
    /// The first or last sample repeated.
    Edge,
    /// Mirrored without repeating the edge sample (librosa's default up to 0.9).
    Reflect,
    /// Mirrored with the edge sample repeated.
    Symmetric,
}

impl PadMode {
    /// Index into `0..n` that stands for `i` (which may lie outside), or `None` for a zero.
    /// Period-repeating as `numpy.pad` does.
    pub fn index(self, i: isize, n: usize) -> Option<usize> {
        if n == 0 {
            return None;
        }
        let len = n as isize;
        if (0..len).contains(&i) {
            return Some(i as usize);
        }
        match self {
            Self::Constant => None,
            Self::Edge => Some(if i < 0 { 0 } else { n - 1 }),
            Self::Reflect if n == 1 => Some(0),
            Self::Reflect => {
                let period = 2 * (len - 1);
                let k = i.rem_euclid(period);
                Some(if k < len { k } else { period - k } as usize)
            }
            Self::Symmetric => {
                let k = i.rem_euclid(2 * len);
                Some(if k < len { k } else { 2 * len - 1 - k } as usize)
            }
        }
    }

    /// `y` with `pad` samples more at either end.
    pub fn extended<T: Real>(self, y: &[T], pad: usize) -> Vec<T> {
        let outside = |i: isize| self.index(i, y.len()).map_or(T::zero(), |i| y[i]);
        let before = (0..pad as isize).map(|i| outside(i - pad as isize));
        let after = (0..pad).map(|i| outside((y.len() + i) as isize));
        before.chain(y.iter().copied()).chain(after).collect()
    }
}

/// Parameters of the transform, in librosa's names.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StftParams {
    /// Length of the transform in samples.
    pub n_fft: usize,
    /// Samples between successive frames. librosa's default is `win_length / 4` for `stft` itself
    /// and 512 for feature functions.
    pub hop_length: usize,
    /// Length of the window in samples, at most `n_fft`.
    pub win_length: usize,
    /// Window function (periodic).
    pub window: Window,
    /// Frame `t` is centred on sample `t * hop_length` (true) or starts there (false).
    pub center: bool,
    /// Padding that `center` uses.
    pub pad_mode: PadMode,
}

impl StftParams {
    /// librosa's defaults for a given transform length and hop.
    pub fn new(n_fft: usize, hop_length: usize) -> Self {
        Self {
            n_fft,
            hop_length,
            win_length: n_fft,
            window: Window::Hann,
            center: true,
            pad_mode: PadMode::Constant,
        }
    }

    /// Refuses impossible values.
    pub fn check(&self) -> Result<()> {
        if self.n_fft == 0 {
            return Err(DspError::parameter("n_fft", 0, "at least 1"));
        }
        if self.hop_length == 0 {
            return Err(DspError::parameter("hop_length", 0, "at least 1"));
        }
        if self.win_length == 0 || self.win_length > self.n_fft {
            let allowed = format!("1 to n_fft ({})", self.n_fft);
            return Err(DspError::parameter("win_length", self.win_length, allowed));
        }
        Ok(())
    }

    /// Samples of padding before the first and after the last sample.
    pub fn pad(&self) -> usize {
        if self.center { self.n_fft / 2 } else { 0 }
    }

    /// Frequency bins, `n_fft / 2 + 1`.
    pub fn n_bins(&self) -> usize {
        self.n_fft / 2 + 1
    }

    /// Frames of a signal of `n` samples; 0 where it is too short for one.
    pub fn n_frames(&self, n: usize) -> usize {
        let padded = n + 2 * self.pad();
        if n == 0 || padded < self.n_fft { 0 } else { 1 + (padded - self.n_fft) / self.hop_length }
    }
}

/// Calls `each(channel, frame, spectrum)` with every spectrum of `n_fft / 2 + 1` bins, computed in
/// double precision whatever `T` is, as librosa does.
fn for_each_spectrum<T: Real>(
    y: ArrayView2<T>,
    p: &StftParams,
    mut each: impl FnMut(usize, usize, &[Complex<f64>]),
) -> Result<()> {
    p.check()?;
    let (channels, n) = y.dim();
    let frames = p.n_frames(n);
    if frames == 0 && channels > 0 {
        let needed = if p.center { 1 } else { p.n_fft };
        return Err(DspError::TooShort { name: "y", actual: n, needed });
    }
    let window = padded_window(p.window, p.win_length, p.n_fft)?;
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(p.n_fft);
    let (mut frame, mut spectrum, mut scratch) =
        (fft.make_input_vec(), fft.make_output_vec(), fft.make_scratch_vec());
    for c in 0..channels {
        let signal = y.row(c);
        for t in 0..frames {
            let start = (t * p.hop_length) as isize - p.pad() as isize;
            for (k, (slot, w)) in frame.iter_mut().zip(&window).enumerate() {
                let sample = p.pad_mode.index(start + k as isize, n).map(|i| signal[i].wide());
                *slot = sample.unwrap_or(0.0) * w;
            }
            fft.process_with_scratch(&mut frame, &mut spectrum, &mut scratch)
                .expect("buffers made by the plan itself");
            each(c, t, &spectrum);
        }
    }
    Ok(())
}

/// Complex spectrogram `[channels, n_fft / 2 + 1, frames]` of `y [channels, samples]`
/// (librosa 0.11 `stft`): the transform runs in double precision and is rounded to `T` on store.
///
/// # Errors
/// Impossible parameters, or a signal too short for one frame.
pub fn stft<T: Real>(y: ArrayView2<T>, p: &StftParams) -> Result<Array3<Complex<T>>> {
    let (channels, n) = y.dim();
    let mut out = Array3::zeros((channels, p.n_bins(), p.n_frames(n)));
    for_each_spectrum(y, p, |c, t, spectrum| {
        for (k, z) in spectrum.iter().enumerate() {
            out[[c, k, t]] = Complex::new(T::of(z.re), T::of(z.im));
        }
    })?;
    Ok(out)
}

/// `|stft|^power` as `[channels, n_fft / 2 + 1, frames]` (librosa 0.11 `_spectrogram`).
///
/// # Errors
/// As [`stft`].
pub fn spectrogram<T: Real>(y: ArrayView2<T>, p: &StftParams, power: f64) -> Result<Array3<T>> {
    let (channels, n) = y.dim();
    let mut out = Array3::zeros((channels, p.n_bins(), p.n_frames(n)));
    for_each_spectrum(y, p, |c, t, spectrum| {
        for (k, z) in spectrum.iter().enumerate() {
            // librosa rounds the complex value first and takes the magnitude of that.
            let magnitude = Complex::new(T::of(z.re), T::of(z.im)).norm();
            out[[c, k, t]] = if power == 1.0 {
                magnitude
            } else if power == 2.0 {
                magnitude * magnitude
            } else {
                magnitude.powf(T::of(power))
            };
        }
    })?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    #[test]
    fn frame_counts_follow_librosa() {
        let even = StftParams::new(2048, 512);
        assert_eq!(even.n_frames(22050), 1 + 22050 / 512);
        let odd = StftParams::new(401, 160);
        assert_eq!(odd.n_frames(4000), 1 + 3999 / 160);
        let plain = StftParams { center: false, ..StftParams::new(512, 128) };
        assert_eq!(plain.n_frames(511), 0);
        assert_eq!(plain.n_frames(512), 1);
    }

    #[test]
    fn constant_signal_has_the_window_sum_at_dc() {
        let y = Array2::<f64>::ones((1, 4096));
        let d = stft(y.view(), &StftParams::new(1024, 256)).unwrap();
        assert!((d[[0, 0, 8]].re - 512.0).abs() < 1e-9);
    }

    #[test]
    fn reflect_indices_repeat() {
        let at = |i| PadMode::Reflect.index(i, 3).unwrap();
        assert_eq!([at(-3), at(-2), at(-1), at(0), at(3), at(4), at(5)], [1, 2, 1, 0, 1, 0, 1]);
        assert_eq!(PadMode::Symmetric.index(-1, 3), Some(0));
    }
}
