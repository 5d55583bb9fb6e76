//! resampy 0.2.2's windowed-sinc interpolation, which librosa used up to 0.9.

use std::f64::consts::PI;

use ndarray::{Array2, ArrayView2};

use super::check_rates;
use crate::error::{DspError, Result};
use crate::real::Real;
use crate::window::bessel_i0;

/// Table entries per zero crossing.
const PRECISION: usize = 512;

/// The right half of a Kaiser-windowed sinc.
struct Kernel {
    zeros: usize,
    rolloff: f64,
    beta: f64,
}

const KAISER_BEST: Kernel =
    Kernel { zeros: 64, rolloff: 0.9475937167399596, beta: 14.769656459379492 };
const KAISER_FAST: Kernel = Kernel { zeros: 16, rolloff: 0.85, beta: 8.555504641634386 };

impl Kernel {
    fn half(&self) -> Vec<f64> {
        let n = PRECISION * self.zeros;
        let gain = self.rolloff / bessel_i0(self.beta);
        (0..=n)
            .map(|i| {
                let x = self.rolloff * i as f64 / PRECISION as f64 * PI;
                let r = i as f64 / n as f64;
                let sinc = if i == 0 { 1.0 } else { x.sin() / x };
                gain * sinc * bessel_i0(self.beta * (1.0 - r * r).max(0.0).sqrt())
            })
            .collect()
    }
}

/// `y [channels, samples]` at another rate by resampy's `kaiser_best` (or `fast`: `kaiser_fast`),
/// `floor(samples * target_sr / orig_sr)` samples long. Sums are rounded to `T` at every tap, as
/// resampy's are.
///
/// # Errors
/// Impossible rates, or a target more than 512 times lower.
pub fn resample_windowed_sinc<T: Real>(
    y: ArrayView2<T>,
    orig_sr: f64,
    target_sr: f64,
    fast: bool,
) -> Result<Array2<T>> {
    check_rates(orig_sr, target_sr)?;
    let ratio = target_sr / orig_sr;
    let scale = ratio.min(1.0);
    let stride = (scale * PRECISION as f64) as usize;
    if stride == 0 {
        let allowed = format!("at least {} hertz with a windowed sinc", orig_sr / PRECISION as f64);
        return Err(DspError::parameter("target_sr", target_sr, allowed));
    }
    let kernel = if fast { KAISER_FAST } else { KAISER_BEST };
    let half: Vec<f64> = kernel.half().iter().map(|w| w * scale).collect();
    let weight = |at: usize, eta: f64| {
        let step = half.get(at + 1).map_or(0.0, |next| next - half[at]);
        half[at] + eta * step
    };
    // First table entry and the rest of a distance, in input samples of the lower rate.
    let split = |distance: f64| {
        let at = distance * PRECISION as f64;
        (at as usize, at - at.trunc())
    };

    let (channels, n) = y.dim();
    let count = (n as f64 * ratio) as usize;
    let mut out = Array2::zeros((channels, count));
    for (signal, mut row) in y.outer_iter().zip(out.outer_iter_mut()) {
        let mut time = 0.0;
        for slot in &mut row {
            let frame = (time as usize).min(n - 1);
            let before = scale * (time - frame as f64);
            let mut sum = T::zero();
            let mut add = |weight: f64, x: T| sum = T::of(sum.wide() + weight * x.wide());
            let (offset, eta) = split(before);
            for i in 0..(frame + 1).min(half.len().saturating_sub(offset) / stride) {
                add(weight(offset + i * stride, eta), signal[frame - i]);
            }
            let (offset, eta) = split(scale - before);
            for i in 0..(n - frame - 1).min(half.len().saturating_sub(offset) / stride) {
                add(weight(offset + i * stride, eta), signal[frame + i + 1]);
            }
            *slot = sum;
            time += 1.0 / ratio;
        }
    }
    Ok(out)
}
