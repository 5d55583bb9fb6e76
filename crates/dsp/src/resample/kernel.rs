//! The inner loops, on whatever vector unit the machine has.
//!
//! Every output is `fma(tap, sample, sum)` over the taps in a fixed order, whatever the vector
//! width: the results are the same bits on every machine, block size and channel layout.

use pulp::{Arch, Simd, WithSimd};

/// One plane of interleaved samples and the taps that meet it.
pub(super) struct Plane<'a> {
    /// Sample `i + k * stride` meets tap `k` for output `i`.
    pub samples: &'a [f32],
    pub taps: &'a [f32],
}

/// `out[i] = sum over planes, taps k of taps[k] * samples[i + k * stride]`.
pub(super) struct Correlate<'a> {
    pub planes: &'a [Plane<'a>],
    pub stride: usize,
    pub out: &'a mut [f32],
}

/// Vectors of outputs that are summed together.
const UNROLL: usize = 8;

impl WithSimd for Correlate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { planes, stride, out } = self;
        let lanes = S::F32_LANES;
        let block = UNROLL * lanes;
        let len = out.len();
        let mut at = 0;
        while at + block <= len {
            vectors::<S, UNROLL>(simd, planes, stride, at, out);
            at += block;
        }
        while at + lanes <= len {
            vectors::<S, 1>(simd, planes, stride, at, out);
            at += lanes;
        }
        if at < len && len >= lanes {
            // The last vector overlaps the one before: the same sums again.
            vectors::<S, 1>(simd, planes, stride, len - lanes, out);
        } else {
            for (i, slot) in out.iter_mut().enumerate().skip(at) {
                let mut sum = 0.0f32;
                for plane in planes {
                    for (k, &tap) in plane.taps.iter().enumerate() {
                        sum = tap.mul_add(plane.samples[i + k * stride], sum);
                    }
                }
                *slot = sum;
            }
        }
    }
}

#[inline(always)]
fn vectors<S: Simd, const N: usize>(
    simd: S,
    planes: &[Plane],
    stride: usize,
    at: usize,
    out: &mut [f32],
) {
    let width = N * S::F32_LANES;
    let mut sums = [simd.splat_f32s(0.0); N];
    for plane in planes {
        let mut from = at;
        for &tap in plane.taps {
            let tap = simd.splat_f32s(tap);
            let (samples, _) = S::as_simd_f32s(&plane.samples[from..from + width]);
            for (sum, &x) in sums.iter_mut().zip(samples) {
                *sum = simd.mul_add_f32s(tap, x, *sum);
            }
            from += stride;
        }
    }
    let (slots, _) = S::as_mut_simd_f32s(&mut out[at..at + width]);
    slots.copy_from_slice(&sums);
}

/// Runs `op` on the best vector unit of this machine.
pub(super) fn dispatch<O: WithSimd>(op: O) -> O::Output {
    Arch::new().dispatch(op)
}
