//! Per-channel energy normalisation (librosa 0.11 `pcen`): gain control and compression that adapt
//! to the level of each band.

use ndarray::{Array2, Array3, ArrayView2, ArrayView3};

use crate::error::{DspError, Result};
use crate::onset::max_filter;
use crate::real::Real;

/// Parameters, in librosa's names and with its defaults.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PcenParams {
    /// Exponent of the gain control; 0 is none.
    pub gain: f64,
    /// What is added before compression.
    pub bias: f64,
    /// Exponent of the compression; 0 is a logarithm.
    pub power: f64,
    /// Time constant of the smoothed level in seconds.
    pub time_constant: f64,
    /// Smallest level.
    pub eps: f64,
    /// Coefficient of the smoothing, 0 to 1, instead of `time_constant`.
    pub b: Option<f64>,
    /// Bands of a maximum filter before smoothing; 1 is none.
    pub max_size: usize,
}

impl Default for PcenParams {
    fn default() -> Self {
        Self {
            gain: 0.98,
            bias: 2.0,
            power: 0.5,
            time_constant: 0.4,
            eps: 1e-6,
            b: None,
            max_size: 1,
        }
    }
}

/// The normalisation planned for a frame rate.
#[derive(Debug, Clone, Copy)]
pub struct Pcen {
    params: PcenParams,
    /// Coefficient of the smoothing.
    b: f64,
    /// `ln(eps)`
    floor: f64,
    /// `bias ^ power`
    scale: f64,
}

impl Pcen {
    /// Plans for spectra `hop_length` samples apart at `sr` Hz.
    ///
    /// # Errors
    /// An impossible parameter.
    pub fn new(params: &PcenParams, sr: f64, hop_length: usize) -> Result<Self> {
        let PcenParams { gain, bias, power, time_constant, eps, b, max_size } = *params;
        for (name, value) in [("gain", gain), ("bias", bias), ("power", power)] {
            if !(value.is_finite() && value >= 0.0) {
                return Err(DspError::parameter(name, value, "0 or more"));
            }
        }
        for (name, value) in [("eps", eps), ("time_constant", time_constant), ("sr", sr)] {
            if !(value.is_finite() && value > 0.0) {
                return Err(DspError::parameter(name, value, "above 0"));
            }
        }
        for (name, value) in [("max_size", max_size), ("hop_length", hop_length)] {
            if value == 0 {
                return Err(DspError::parameter(name, value, "at least 1"));
            }
        }
        let frames = time_constant * sr / hop_length as f64;
        let square = frames * frames;
        let b = b.unwrap_or_else(|| ((1.0 + 4.0 * square).sqrt() - 1.0) / (2.0 * square));
        if !(0.0..=1.0).contains(&b) {
            return Err(DspError::parameter("b", b, "0 to 1"));
        }
        Ok(Self { params: *params, b, floor: eps.ln(), scale: bias.powf(power) })
    }

    /// State of the smoothing before the first frame: that of a constant level of 1.
    pub fn initial(&self) -> f64 {
        1.0 - self.b
    }

    /// Bands of the maximum filter before smoothing.
    pub fn max_size(&self) -> usize {
        self.params.max_size
    }

    /// The value of one band in the next frame. `level` is what is smoothed (the value itself, or
    /// the maximum around it), `state` that of this band.
    #[inline(always)]
    pub fn next(&self, value: f64, level: f64, state: &mut f64) -> f64 {
        let PcenParams { gain, bias, power, eps, .. } = self.params;
        // scipy.signal.lfilter([b], [1, b - 1]), transposed direct form.
        let smooth = *state + self.b * level;
        // The product with the next coefficient of b, which is 0, makes NaN of what is not finite.
        *state = 0.0 * level - (self.b - 1.0) * smooth;
        let gain = (-gain * (self.floor + (smooth / eps).ln_1p())).exp();
        if power == 0.0 {
            (value * gain).ln_1p()
        } else if bias == 0.0 {
            (power * (value.ln() + gain.ln())).exp()
        } else {
            self.scale * (power * (value * gain / bias).ln_1p()).exp_m1()
        }
    }

    /// `[channels, bands, frames]` of a spectrogram of that shape, and the states `[channels, bands]`
    /// after its last frame. `levels` replaces what is smoothed, `state` begins where an earlier
    /// part of the signal ended. Double precision, as librosa's result is.
    ///
    /// # Errors
    /// Levels or a state of another shape.
    pub fn of<'a, T: Real>(
        &self,
        spectrogram: ArrayView3<'a, T>,
        levels: Option<ArrayView3<'a, T>>,
        state: Option<ArrayView2<f64>>,
    ) -> Result<(Array3<f64>, Array2<f64>)> {
        let (channels, bands, frames) = spectrogram.dim();
        let shape = |name, expected: &[usize], actual: &[usize]| {
            let expected = format!("{expected:?}");
            Err(DspError::Shape { name, expected, actual: actual.to_vec() })
        };
        if let Some(levels) = &levels
            && levels.shape() != spectrogram.shape()
        {
            return shape("ref", spectrogram.shape(), levels.shape());
        }
        let mut state = match state {
            None => Array2::from_elem((channels, bands), self.initial()),
            Some(state) if state.dim() == (channels, bands) => state.to_owned(),
            Some(state) => return shape("zi", &[channels, bands], state.shape()),
        };
        let mut out = Array3::zeros((channels, bands, frames));
        let filtered = levels.is_none() && self.params.max_size > 1;
        let levels = levels.unwrap_or(spectrogram);
        let (mut frame, mut highest) = (vec![T::zero(); bands], vec![T::zero(); bands]);
        for c in 0..channels {
            for t in 0..frames {
                for (k, x) in frame.iter_mut().enumerate() {
                    *x = levels[[c, k, t]];
                }
                if filtered {
                    max_filter(&frame, self.params.max_size, &mut highest);
                    frame.copy_from_slice(&highest);
                }
                for (k, level) in frame.iter().enumerate() {
                    let value = spectrogram[[c, k, t]].wide();
                    out[[c, k, t]] = self.next(value, level.wide(), &mut state[[c, k]]);
                }
            }
        }
        Ok((out, state))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::s;

    fn plan(params: PcenParams) -> Pcen {
        Pcen::new(&params, 22_050.0, 512).unwrap()
    }

    #[test]
    fn two_halves_with_the_state_between_them_are_the_whole() {
        let spectrogram =
            Array3::from_shape_fn((2, 5, 30), |(c, k, t)| ((c + 3 * k + 7 * t) % 11) as f32);
        let pcen = plan(PcenParams { max_size: 3, ..PcenParams::default() });
        let (whole, end) = pcen.of(spectrogram.view(), None, None).unwrap();
        let (first, state) = pcen.of(spectrogram.slice(s![.., .., ..13]), None, None).unwrap();
        let second = spectrogram.slice(s![.., .., 13..]);
        let (second, state) = pcen.of(second, None, Some(state.view())).unwrap();
        assert_eq!(whole.slice(s![.., .., ..13]), first);
        assert_eq!(whole.slice(s![.., .., 13..]), second);
        assert_eq!(state, end);
    }

    #[test]
    fn a_constant_level_is_brought_to_one_value() {
        // The level of 1 that the smoothing begins with stays; gain 1 divides by eps + 1.
        let ones = Array3::from_elem((1, 2, 9), 1.0_f64);
        let params = PcenParams { gain: 1.0, ..PcenParams::default() };
        let (out, _) = plan(params).of(ones.view(), None, None).unwrap();
        let want = (1.0 / (1.0 + 1e-6) + 2.0_f64).sqrt() - 2.0_f64.sqrt();
        assert!(out.iter().all(|x| (x - want).abs() < 1e-12), "{out}");
    }

    #[test]
    fn silence_is_zero() {
        for (bias, power) in [(2.0, 0.5), (2.0, 0.0), (0.0, 0.5)] {
            let params = PcenParams { bias, power, ..PcenParams::default() };
            let (out, _) =
                plan(params).of(Array3::<f32>::zeros((1, 3, 4)).view(), None, None).unwrap();
            assert!(out.iter().all(|x| *x == 0.0), "{out}");
        }
    }

    #[test]
    fn impossible_parameters_are_refused_by_name() {
        let refused = |params: PcenParams, sr: f64, hop: usize| {
            Pcen::new(&params, sr, hop).unwrap_err().to_string()
        };
        let p = PcenParams::default();
        assert!(refused(PcenParams { gain: -1.0, ..p }, 22_050.0, 512).contains("gain"));
        assert!(refused(PcenParams { eps: 0.0, ..p }, 22_050.0, 512).contains("eps"));
        assert!(refused(PcenParams { b: Some(1.5), ..p }, 22_050.0, 512).starts_with("b must be "));
        assert!(refused(PcenParams { max_size: 0, ..p }, 22_050.0, 512).contains("max_size"));
        assert!(refused(p, 0.0, 512).contains("sr"));
        assert!(refused(p, 22_050.0, 0).contains("hop_length"));
    }
}
