//! Halving of the sample rate between octaves.

use std::f64::consts::PI;
use std::sync::OnceLock;

use pulp::{Arch, Simd, WithSimd};

use crate::vector::Lane;
use crate::window::bessel_i0;

/// Taps on either side of the middle one.
const HALF: usize = 194;
/// Samples over which an impulse spreads, before decimation.
pub(super) const REACH: usize = HALF;
/// Outputs of one pass over the taps, in registers.
const REGISTERS: usize = 8;

/// Taps of soxr's 2:1 "HQ" filter: a Kaiser-windowed sinc whose pass band ends at 0.913743 of the
/// lower Nyquist frequency and whose stop band starts there. `taps()[k]` is the tap at `k - HALF`.
fn taps() -> &'static [f64] {
    static TAPS: OnceLock<Vec<f64>> = OnceLock::new();
    TAPS.get_or_init(|| {
        const BETA: f64 = 13.04;
        const PASS: f64 = 0.913743;
        let cutoff = 0.5 - (1.0 - PASS) / 4.0;
        let width = HALF as f64 + 0.5;
        (0..=2 * HALF)
            .map(|k| {
                let k = k as f64 - HALF as f64;
                let x = PI * cutoff * k;
                let sinc = if k == 0.0 { 1.0 } else { x.sin() / x };
                let window = bessel_i0(BETA * (1.0 - (k / width).powi(2)).sqrt());
                cutoff * sinc * window / bessel_i0(BETA)
            })
            .collect()
    })
}

/// Every second sample of the low-passed `y`, times `gain`: `n` samples, the first one aligned with
/// `y[0]`; the signal is zero outside. librosa 0.11 `resample(y, orig_sr=2, target_sr=1)` with
/// soxr's "HQ" quality, for `n = ceil(len / 2)`.
pub fn decimate<T: Lane>(y: &[T], n: usize, gain: f64) -> Vec<T> {
    // Taps at even distances weigh the even samples, the others the odd ones. Both run over
    // contiguous outputs, as convolutions whose inputs start `HALF / 2` samples early.
    let reversed: Vec<T> = taps().iter().map(|h| T::of(h * gain)).collect();
    let even: Vec<T> = reversed.iter().copied().step_by(2).collect();
    let odd: Vec<T> = reversed.iter().copied().skip(1).step_by(2).collect();
    let room = n.next_multiple_of(64 * REGISTERS) + HALF + 1;
    let phase = |offset: usize| {
        let mut samples = vec![T::zero(); room];
        let values = y.iter().skip(offset).step_by(2);
        samples[HALF / 2..].iter_mut().zip(values).for_each(|(slot, x)| *slot = *x);
        samples
    };
    let mut out = vec![T::zero(); n];
    Arch::new().dispatch(Decimate {
        even: (&even, &phase(0)),
        odd: (&odd, &phase(1)),
        out: &mut out,
    });
    out
}

struct Decimate<'a, T> {
    /// Taps and samples `x[2 (i - HALF / 2)]`.
    even: (&'a [T], &'a [T]),
    /// Taps and samples `x[2 (i - HALF / 2) + 1]`.
    odd: (&'a [T], &'a [T]),
    out: &'a mut [T],
}

impl<T: Lane> WithSimd for Decimate<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let lanes = T::lanes::<S>();
        for (i, out) in self.out.chunks_mut(REGISTERS * lanes).enumerate() {
            let first = i * REGISTERS * lanes;
            let mut sum = [T::splat(simd, T::zero()); REGISTERS];
            for (taps, samples) in [self.even, self.odd] {
                for (k, tap) in taps.iter().enumerate() {
                    let tap = T::splat(simd, *tap);
                    let samples = &samples[first + k..first + k + REGISTERS * lanes];
                    for (sum, x) in sum.iter_mut().zip(samples.chunks_exact(lanes)) {
                        *sum = T::multiply_add(simd, tap, T::load(simd, x), *sum);
                    }
                }
            }
            for (out, sum) in out.chunks_mut(lanes).zip(sum) {
                T::store(simd, out, sum);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equals_the_convolution() {
        let h = taps();
        for n in [1_usize, 2, 3, 200, 389, 1000, 1031] {
            let y: Vec<f64> = (0..n).map(|i| ((i * i) % 17) as f64 - 8.0).collect();
            let got = decimate(&y, n.div_ceil(2), 2.0);
            for (m, got) in got.iter().enumerate() {
                let term = |k: usize| {
                    let i = (2 * m + HALF).checked_sub(k).and_then(|i| y.get(i));
                    2.0 * h[k] * i.copied().unwrap_or(0.0)
                };
                let want: f64 = (0..h.len()).map(term).sum();
                assert!((got - want).abs() < 1e-12, "{n} samples, output {m}: {got} for {want}");
            }
        }
    }

    #[test]
    fn low_frequencies_pass_and_high_ones_do_not() {
        let tone = |f: f64| -> Vec<f32> {
            (0..4000).map(|i| (2.0 * PI * f * f64::from(i)).cos() as f32).collect()
        };
        let low = decimate(&tone(0.2), 2000, 1.0);
        let peak = |y: &[f32]| y[500..1500].iter().fold(0.0_f32, |m, x| m.max(x.abs()));
        assert!((peak(&low) - 1.0).abs() < 2e-3);
        assert!(peak(&decimate(&tone(0.26), 2000, 1.0)) < 1e-5);
    }
}
