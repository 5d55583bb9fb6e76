//! What a short-time Fourier transform is asked for.

use ndarray::ArrayView2;
use num_complex::Complex;
use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result, from_name, room_for};
use crate::real::Real;
use crate::window::Window;

/// Longest transform; bounds the memory that a length from outside can take.
pub const MAX_N_FFT: usize = 1 << 24;

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

from_name!(
    PadMode, "pad_mode",
    "constant" => Self::Constant,
    "edge" => Self::Edge,
    "reflect" => Self::Reflect,
    "symmetric" => Self::Symmetric,
);

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

    /// Samples `start..` of `y`, padded where they lie outside, into `out`.
    pub(crate) fn read<T: Real, F: Real>(self, y: &[T], start: isize, out: &mut [F]) {
        let n = y.len() as isize;
        let head = (-start).clamp(0, out.len() as isize) as usize;
        let tail = (n - start).clamp(head as isize, out.len() as isize) as usize;
        let pad = |k: usize| self.index(start + k as isize, y.len());
        for k in (0..head).chain(tail..out.len()) {
            out[k] = pad(k).map_or(F::zero(), |i| F::of(y[i].wide()));
        }
        if head < tail {
            let from = (start + head as isize) as usize;
            out[head..tail].iter_mut().zip(&y[from..]).for_each(|(o, x)| *o = F::of(x.wide()));
        }
    }
}

/// Parameters of the transform, in librosa's names.
#[derive(Debug, Clone, PartialEq)]
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
        if !(1..=MAX_N_FFT).contains(&self.n_fft) {
            return Err(DspError::parameter("n_fft", self.n_fft, format!("1 to {MAX_N_FFT}")));
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

    /// Frames that reach a signal of `length` samples, at most `frames`.
    pub(crate) fn frames_within(&self, length: usize, frames: usize) -> usize {
        frames.min((length + 2 * self.pad()).div_ceil(self.hop_length))
    }

    /// Shape `[channels, n_fft / 2 + 1, frames]` of the transform of `y [channels, samples]`.
    ///
    /// # Errors
    /// Impossible parameters, or a signal too short for one frame.
    pub fn shape_of<T>(&self, y: ArrayView2<T>) -> Result<(usize, usize, usize)> {
        self.check()?;
        let (channels, n) = y.dim();
        match self.n_frames(n) {
            0 if channels > 0 => {
                let needed = if self.center { 1 } else { self.n_fft };
                Err(DspError::TooShort { name: "y", actual: n, needed })
            }
            frames => {
                let shape = (channels, self.n_bins(), frames);
                room_for::<Complex<T>>("the spectrogram", &[shape.0, shape.1, shape.2])?;
                Ok(shape)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn reflect_indices_repeat() {
        let at = |i| PadMode::Reflect.index(i, 3).unwrap();
        assert_eq!([at(-3), at(-2), at(-1), at(0), at(3), at(4), at(5)], [1, 2, 1, 0, 1, 0, 1]);
        assert_eq!(PadMode::Symmetric.index(-1, 3), Some(0));
    }
}
