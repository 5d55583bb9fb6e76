//! The filter of resampy's `kaiser_best` and `kaiser_fast`: a windowed sinc as a table.

use std::f64::consts::PI;
use std::sync::OnceLock;

use crate::real::Real;
use crate::window::bessel_i0;

/// Table entries per zero crossing.
pub(super) const PRECISION: usize = 512;

/// The right half of a Kaiser-windowed sinc.
pub(super) struct KaiserSinc {
    zeros: usize,
    rolloff: f64,
    beta: f64,
}

const KAISER_BEST: KaiserSinc =
    KaiserSinc { zeros: 64, rolloff: 0.9475937167399596, beta: 14.769656459379492 };
const KAISER_FAST: KaiserSinc = KaiserSinc { zeros: 16, rolloff: 0.85, beta: 8.555504641634386 };

impl KaiserSinc {
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

    /// The half of `kaiser_best` or `kaiser_fast`, made once.
    pub(super) fn shared(fast: bool) -> &'static [f64] {
        static BEST: OnceLock<Vec<f64>> = OnceLock::new();
        static FAST: OnceLock<Vec<f64>> = OnceLock::new();
        if fast {
            FAST.get_or_init(|| KAISER_FAST.half())
        } else {
            BEST.get_or_init(|| KAISER_BEST.half())
        }
    }
}

/// The continuous filter: weights of samples by their distance from an output.
#[derive(Debug, Clone)]
pub(super) struct Table {
    pub(super) half: &'static [f64],
    /// Lower than 1 where the rate falls.
    pub(super) scale: f64,
    /// Table entries between neighbouring samples.
    pub(super) stride: usize,
}

impl Table {
    /// Samples on either side of an output that it may depend on.
    pub(super) fn reach(&self) -> usize {
        self.half.len() / self.stride
    }

    /// Weights of the samples from a distance on, in zero crossings, outwards.
    fn wing(&self, distance: f64) -> impl Iterator<Item = f64> {
        let at = distance * PRECISION as f64;
        let (offset, eta) = (at as usize, at - at.trunc());
        let count = self.half.len().saturating_sub(offset) / self.stride;
        (0..count).map(move |i| {
            let at = offset + i * self.stride;
            let value = self.scale * self.half[at];
            let step = self.half.get(at + 1).map_or(0.0, |next| self.scale * next - value);
            value + eta * step
        })
    }

    /// Weights of the samples around an output that lies `fraction` after a sample, which is number
    /// `before - 1` of them.
    pub(super) fn row<T: Real>(&self, fraction: f64, before: usize, row: &mut [T]) {
        row.fill(T::zero());
        let (left, right) = row.split_at_mut(before);
        let distance = self.scale * fraction;
        left.iter_mut().rev().zip(self.wing(distance)).for_each(|(slot, w)| *slot = T::of(w));
        let wing = self.wing(self.scale - distance);
        right.iter_mut().zip(wing).for_each(|(slot, w)| *slot = T::of(w));
    }
}

/// The symmetric filter of a halving of the rate, an odd number of taps.
pub(crate) fn halving(fast: bool) -> Vec<f64> {
    let table = Table { half: KaiserSinc::shared(fast), scale: 0.5, stride: PRECISION / 2 };
    let mut row = vec![0.0; 2 * table.reach()];
    table.row(0.0, table.reach(), &mut row);
    // The right wing begins one sample later, and ends with a zero.
    row.truncate(2 * table.reach() - 1);
    row
}
