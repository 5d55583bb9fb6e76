//! The inner loops, on whatever vector unit the machine has.
//!
//! Every output is `fma(tap, sample, sum)` over the taps in a fixed order, whatever the vector
//! width: the results are the same bits on every machine, block size and channel layout. (Long filters
//! by transforms, in `overlap_save.rs`, may differ between machines.)

use pulp::{Arch, Simd, WithSimd};

/// Outputs of a channel that one thread makes at a time: many times the reach of the filters.
pub(super) const SPAN: usize = 1 << 14;

/// Samples of one channel and the taps that meet them.
pub(super) struct Plane<'a> {
    /// Sample `i + k` meets tap `k` for output `i`.
    pub samples: &'a [f32],
    pub taps: &'a [f32],
    /// The taps read the same backwards: both samples that meet one are added first, which halves
    /// the products.
    pub symmetric: bool,
}

impl Plane<'_> {
    /// Output `i` added to `sum`, tap by tap in the order of [`vectors`].
    fn add(&self, i: usize, mut sum: f32) -> f32 {
        let count = self.taps.len();
        let mut step = |k: usize, x: f32| sum = self.taps[k].mul_add(x, sum);
        if self.symmetric {
            for k in (0..COMB).flat_map(|first| (first..count / 2).step_by(COMB)) {
                step(k, self.samples[i + k] + self.samples[i + count - 1 - k]);
            }
            if count % 2 == 1 {
                step(count / 2, self.samples[i + count / 2]);
            }
        } else {
            for k in (0..COMB).flat_map(|first| (first..count).step_by(COMB)) {
                step(k, self.samples[i + k]);
            }
        }
        sum
    }
}

/// `out[i] = sum over planes, taps k of taps[k] * samples[i + k]`.
///
/// Taps (of symmetric ones the first half, then the middle) are taken in the order 0, 16, 32, ..., 1,
/// 17, ...: neighbours in that order read samples a
/// whole number of vectors apart, so that a block of outputs loads each vector only once.
pub(super) struct Correlate<'a> {
    pub planes: &'a [Plane<'a>],
    pub out: &'a mut [f32],
}

/// Distance of successive taps.
const COMB: usize = 16;
/// Vectors of outputs that are summed together.
const UNROLL: usize = 8;
/// Successive taps that share loads.
const GROUP: usize = 4;

impl WithSimd for Correlate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { planes, out } = self;
        let lanes = S::F32_LANES;
        let len = out.len();
        let mut at = 0;
        while at + UNROLL * lanes <= len {
            vectors::<S, UNROLL>(simd, planes, at, out);
            at += UNROLL * lanes;
        }
        while at + lanes <= len {
            vectors::<S, 1>(simd, planes, at, out);
            at += lanes;
        }
        if at < len && len >= lanes {
            // The last vector overlaps the one before: the same sums again.
            vectors::<S, 1>(simd, planes, len - lanes, out);
        } else {
            for (i, slot) in out.iter_mut().enumerate().skip(at) {
                *slot = planes.iter().fold(0.0, |sum, plane| plane.add(i, sum));
            }
        }
    }
}

#[inline(always)]
fn vectors<S: Simd, const N: usize>(simd: S, planes: &[Plane], at: usize, out: &mut [f32]) {
    let lanes = S::F32_LANES;
    let mut sums = [simd.splat_f32s(0.0); N];
    for plane in planes {
        let count = plane.taps.len();
        if plane.symmetric {
            mirrored(simd, plane, at, &mut sums);
            continue;
        }
        for first in 0..COMB {
            let mut k = first;
            if COMB.is_multiple_of(lanes) {
                let apart = COMB / lanes;
                while k + (GROUP - 1) * COMB < count {
                    let taps: [S::f32s; GROUP] =
                        std::array::from_fn(|g| simd.splat_f32s(plane.taps[k + g * COMB]));
                    let width = (N + (GROUP - 1) * apart) * lanes;
                    let (samples, _) = S::as_simd_f32s(&plane.samples[at + k..at + k + width]);
                    for (g, tap) in taps.into_iter().enumerate() {
                        for (sum, &x) in sums.iter_mut().zip(&samples[g * apart..g * apart + N]) {
                            *sum = simd.mul_add_f32s(tap, x, *sum);
                        }
                    }
                    k += GROUP * COMB;
                }
            }
            while k < count {
                let tap = simd.splat_f32s(plane.taps[k]);
                let from = at + k;
                let (samples, _) = S::as_simd_f32s(&plane.samples[from..from + N * lanes]);
                for (sum, &x) in sums.iter_mut().zip(samples) {
                    *sum = simd.mul_add_f32s(tap, x, *sum);
                }
                k += COMB;
            }
        }
    }
    let (slots, _) = S::as_mut_simd_f32s(&mut out[at..at + N * lanes]);
    slots.copy_from_slice(&sums);
}

/// What [`vectors`] adds for a plane of symmetric taps.
#[inline(always)]
fn mirrored<S: Simd, const N: usize>(simd: S, plane: &Plane, at: usize, sums: &mut [S::f32s; N]) {
    let lanes = S::F32_LANES;
    let (count, half) = (plane.taps.len(), plane.taps.len() / 2);
    for first in 0..COMB {
        let mut k = first;
        if COMB.is_multiple_of(lanes) {
            let apart = COMB / lanes;
            let reach = (GROUP - 1) * COMB;
            while k + reach < half {
                let taps: [S::f32s; GROUP] =
                    std::array::from_fn(|g| simd.splat_f32s(plane.taps[k + g * COMB]));
                let width = (N + (GROUP - 1) * apart) * lanes;
                let (early, _) = S::as_simd_f32s(&plane.samples[at + k..at + k + width]);
                // The last tap of the group meets the first of these.
                let from = at + count - 1 - k - reach;
                let (late, _) = S::as_simd_f32s(&plane.samples[from..from + width]);
                for (g, tap) in taps.into_iter().enumerate() {
                    let early = &early[g * apart..g * apart + N];
                    let late = &late[(GROUP - 1 - g) * apart..(GROUP - 1 - g) * apart + N];
                    for ((sum, &a), &b) in sums.iter_mut().zip(early).zip(late) {
                        *sum = simd.mul_add_f32s(tap, simd.add_f32s(a, b), *sum);
                    }
                }
                k += GROUP * COMB;
            }
        }
        while k < half {
            let tap = simd.splat_f32s(plane.taps[k]);
            let (early, late) = (at + k, at + count - 1 - k);
            let (early, _) = S::as_simd_f32s(&plane.samples[early..early + N * lanes]);
            let (late, _) = S::as_simd_f32s(&plane.samples[late..late + N * lanes]);
            for ((sum, &a), &b) in sums.iter_mut().zip(early).zip(late) {
                *sum = simd.mul_add_f32s(tap, simd.add_f32s(a, b), *sum);
            }
            k += COMB;
        }
    }
    if count % 2 == 1 {
        let tap = simd.splat_f32s(plane.taps[half]);
        let (samples, _) = S::as_simd_f32s(&plane.samples[at + half..at + half + N * lanes]);
        for (sum, &x) in sums.iter_mut().zip(samples) {
            *sum = simd.mul_add_f32s(tap, x, *sum);
        }
    }
}

/// Runs `op` on the best vector unit of this machine.
pub(super) fn dispatch<O: WithSimd>(op: O) -> O::Output {
    Arch::new().dispatch(op)
}
