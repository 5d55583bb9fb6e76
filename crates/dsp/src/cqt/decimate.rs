//! Halving of the sample rate between octaves.

use std::f64::consts::PI;

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use crate::resample::halving;
use crate::vector::Lane;
use crate::window::bessel_i0;

/// Outputs of one pass over the taps, in registers.
const REGISTERS: usize = 8;

/// A 2:1 low-pass filter, of soxr's "HQ" quality unless made otherwise.
///
/// Of soxr's, the last or only halving is a Kaiser-windowed sinc whose pass band ends at 0.913743 of the lower
/// Nyquist frequency and whose stop band starts there. Halvings before it are short half-band
/// filters, equiripple up to an eighth of the rate. soxr shares the ripple that it allows among all
/// stages, which makes the filters longer the more there are. Found from the impulse responses of
/// soxr 1.1; 2:1 to 16:1 agree with it to 6e-7 on noise, ends included.
pub(super) struct Decimator {
    /// Taps from the latest to the earliest sample, an odd number; symmetric.
    taps: Vec<f64>,
}

impl Decimator {
    /// Any but the last of `stages` successive halvings.
    pub fn early(stages: u32) -> Self {
        // Minimax designs (Parks-McClellan); the weights at odd distances, from the middle on.
        const SHORT: [f64; 8] = [
            0.311546566276,
            -0.0873450257442,
            0.0368145860302,
            -0.0151893092056,
            0.00545414869909,
            -0.00156441378729,
            0.000318173663526,
            -3.48005741972e-5,
        ];
        const LONG: [f64; 9] = [
            0.312270209818,
            -0.0892211608697,
            0.0391392646429,
            -0.0172501719215,
            0.00685868340036,
            -0.00230436972998,
            0.000609585254399,
            -0.000113224412482,
            1.11959085817e-5,
        ];
        let weights: &[f64] = if stages <= 3 { &SHORT } else { &LONG };
        // A zero at either end makes the reach even.
        let half = 2 * weights.len();
        let mut taps = vec![0.0; 2 * half + 1];
        taps[half] = 0.5;
        for (i, w) in weights.iter().enumerate() {
            taps[half + 1 + 2 * i] = *w;
            taps[half - 1 - 2 * i] = *w;
        }
        Self { taps }
    }

    /// The last of `stages` successive halvings.
    pub fn last(stages: u32) -> Self {
        const PASS: f64 = 0.913743;
        let transition = (1.0 - PASS) / 4.0;
        let cutoff = 0.5 - transition;
        // Attenuation in dB beyond that of a single stage.
        let extra = 20.0 * f64::from(stages).log10();
        let beta = 13.04 + 0.1115 * extra;
        let needed = (8.307 + extra / 14.262) / transition + 1.0;
        let half = 2 * ((needed.ceil() as usize).div_ceil(4));
        let width = half as f64 + 0.5;
        let taps = (0..=2 * half).map(|k| {
            let k = k as f64 - half as f64;
            let x = PI * cutoff * k;
            let sinc = if k == 0.0 { 1.0 } else { x.sin() / x };
            let window = bessel_i0(beta * (1.0 - (k / width).powi(2)).sqrt());
            cutoff * sinc * window / bessel_i0(beta)
        });
        Self { taps: taps.collect() }
    }

    /// resampy's windowed sinc, librosa's converter up to 0.9.
    pub fn windowed_sinc(fast: bool) -> Self {
        let mut taps = halving(fast);
        // A zero at either end makes the reach even.
        if taps.len() / 2 % 2 == 1 {
            taps.insert(0, 0.0);
            taps.push(0.0);
        }
        Self { taps }
    }

    /// Samples before and after an input that its response reaches, an even number.
    pub fn reach(&self) -> usize {
        self.taps.len() / 2
    }

    /// Every second sample of the low-passed `y`, times `sqrt(2)`: `n` samples, the first one
    /// aligned with `y[0]`; the signal is zero outside.
    ///
    /// For `n = ceil(len / 2)` librosa 0.11 `resample(y, orig_sr=2, target_sr=1, scale=True)`. `at_once`
    /// uses all threads of the pool.
    pub fn halve<T: Lane>(&self, y: &[T], n: usize, at_once: bool) -> Vec<T> {
        // Taps at even distances weigh the even samples, the others the odd ones. Both run over
        // contiguous outputs, as convolutions whose inputs start `reach / 2` samples early.
        let tap = |h: &f64| T::of(h * std::f64::consts::SQRT_2);
        let even: Vec<T> = self.taps.iter().step_by(2).map(tap).collect();
        let odd: Vec<T> = self.taps.iter().skip(1).step_by(2).map(tap).collect();
        let mut out = vec![T::zero(); n];
        let part = |(i, out): (usize, &mut [T])| {
            // Samples of one phase from `reach / 2` before those under the first output on.
            let room = out.len().next_multiple_of(64 * REGISTERS) + self.reach() + 1;
            let early = self.reach() / 2;
            let skipped = early.saturating_sub(i * PART);
            let phase = |offset: usize| {
                let mut samples = vec![T::zero(); room];
                let first = 2 * (i * PART + skipped - early) + offset;
                let values = y.get(first..).unwrap_or_default().iter().step_by(2);
                samples[skipped..].iter_mut().zip(values).for_each(|(slot, x)| *slot = *x);
                samples
            };
            Arch::new().dispatch(Decimate {
                even: (&even, &phase(0)),
                odd: (&odd, &phase(1)),
                out,
            });
        };
        if at_once {
            out.par_chunks_mut(PART).enumerate().for_each(part);
        } else {
            out.chunks_mut(PART).enumerate().for_each(part);
        }
        out
    }
}

/// Outputs that one thread makes at a time, a multiple of those of a pass.
const PART: usize = 1 << 13;

struct Decimate<'a, T> {
    /// Taps and samples `x[2 (i - reach / 2)]`.
    even: (&'a [T], &'a [T]),
    /// Taps and samples `x[2 (i - reach / 2) + 1]`.
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
        for stages in 1..=3 {
            let decimator = Decimator::last(stages);
            let (h, reach) = (&decimator.taps, decimator.reach());
            for n in [1_usize, 2, 3, 200, 389, 1000, 1031, 2 * PART + 1, 4 * PART + 100] {
                let y: Vec<f64> = (0..n).map(|i| ((i * i) % 17) as f64 - 8.0).collect();
                let got = decimator.halve(&y, n.div_ceil(2), false);
                assert_eq!(decimator.halve(&y, n.div_ceil(2), true), got);
                for (m, got) in got.iter().enumerate() {
                    let term = |k: usize| {
                        let i = (2 * m + reach).checked_sub(k).and_then(|i| y.get(i));
                        h[k] * i.copied().unwrap_or(0.0)
                    };
                    let sum: f64 = (0..h.len()).map(term).sum();
                    let want = sum * std::f64::consts::SQRT_2;
                    assert!((got - want).abs() < 1e-12, "{n} samples, output {m}: {got}, {want}");
                }
            }
        }
    }

    #[test]
    fn lengths_are_those_measured_of_soxr() {
        let lengths: Vec<usize> = (1..=4).map(|n| Decimator::last(n).taps.len()).collect();
        assert_eq!(lengths, [389, 409, 421, 429]);
    }

    #[test]
    fn early_stages_stop_what_folds_onto_the_last_pass_band() {
        for stages in [2, 4] {
            let tone: Vec<f64> =
                (0..4000).map(|i| (2.0 * PI * 0.38 * f64::from(i)).cos()).collect();
            let y = Decimator::early(stages).halve(&tone, 2000, false);
            assert!(y[500..1500].iter().all(|x| x.abs() < 3e-7));
        }
    }

    #[test]
    fn low_frequencies_pass_and_high_ones_do_not() {
        let tone = |f: f64| -> Vec<f32> {
            (0..4000).map(|i| (2.0 * PI * f * f64::from(i)).cos() as f32).collect()
        };
        let peak = |f: f64| {
            let y = Decimator::last(1).halve(&tone(f), 2000, false);
            y[500..1500].iter().fold(0.0_f32, |m, x| m.max(x.abs()))
        };
        assert!((peak(0.2) - std::f32::consts::SQRT_2).abs() < 3e-3);
        assert!(peak(0.26) < 1e-5);
    }
}
