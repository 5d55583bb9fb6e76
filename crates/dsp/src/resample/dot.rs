//! Sums of products of a filter's taps and samples.

use pulp::Simd;

use crate::vector::Lane;

/// Products that are summed side by side, whatever the vector unit is: taps come in whole blocks.
pub(super) const BLOCK: usize = 16;

/// Running sums of a lane, so that none waits for the one before.
const SUMS: usize = 4;

/// Sum of the products of `taps` (whole blocks) with as many `samples`, in an order that does not
/// depend on the vector unit, each product fused with its sum.
#[inline(always)]
pub(super) fn dot<T: Lane, S: Simd>(simd: S, taps: &[T], samples: &[T]) -> T {
    let (fours, rest) = taps.as_chunks::<BLOCK>().0.as_chunks::<SUMS>();
    let (four_samples, rest_samples) = samples.as_chunks::<BLOCK>().0.as_chunks::<SUMS>();
    let lanes = T::lanes::<S>();
    let (zero, one) = (T::splat(simd, T::zero()), T::splat(simd, T::one()));
    let mut sums = [T::zero(); BLOCK];
    for v in (0..BLOCK).step_by(lanes) {
        let add = |taps: &[T; BLOCK], samples: &[T; BLOCK], sum| {
            let (w, x) = (T::load(simd, &taps[v..]), T::load(simd, &samples[v..]));
            T::fused(simd, w, x, sum)
        };
        let (mut a, mut b, mut c, mut d) = (zero, zero, zero, zero);
        for (w, x) in fours.iter().zip(four_samples) {
            a = add(&w[0], &x[0], a);
            b = add(&w[1], &x[1], b);
            c = add(&w[2], &x[2], c);
            d = add(&w[3], &x[3], d);
        }
        for (w, x) in rest.iter().zip(rest_samples) {
            a = add(w, x, a);
        }
        let (ab, cd) = (T::fused(simd, a, one, b), T::fused(simd, c, one, d));
        T::store(simd, &mut sums[v..v + lanes], T::fused(simd, ab, one, cd));
    }
    let sums: [T; 8] = std::array::from_fn(|i| sums[i] + sums[i + 8]);
    let sums: [T; 4] = std::array::from_fn(|i| sums[i] + sums[i + 4]);
    (sums[0] + sums[2]) + (sums[1] + sums[3])
}

#[cfg(test)]
mod tests {
    use pulp::{Arch, Scalar, WithSimd};

    use super::*;

    struct Sum<'a, T>(&'a [T], &'a [T]);

    impl<T: Lane> WithSimd for Sum<'_, T> {
        type Output = T;
        fn with_simd<S: Simd>(self, simd: S) -> T {
            dot(simd, self.0, self.1)
        }
    }

    fn every_length_on_every_unit<T: Lane + std::fmt::Debug>(tolerance: f64) {
        let value = |i: usize| (i * i % 101) as f64 / 101.0 - 0.4;
        for blocks in 0..11 {
            let taps: Vec<T> = (0..blocks * BLOCK).map(|i| T::of(value(i))).collect();
            let samples: Vec<T> = (0..blocks * BLOCK + 3).map(|i| T::of(value(i + 7))).collect();
            let got = Arch::new().dispatch(Sum(&taps, &samples));
            assert_eq!(got, Sum(&taps, &samples).with_simd(Scalar::new()));
            let want: f64 = taps.iter().zip(&samples).map(|(w, x)| w.wide() * x.wide()).sum();
            assert!((got.wide() - want).abs() < tolerance, "{got:?} for {want}");
        }
    }

    #[test]
    fn products_are_summed_once_and_alike_everywhere() {
        every_length_on_every_unit::<f32>(1e-5);
        every_length_on_every_unit::<f64>(1e-13);
    }
}
