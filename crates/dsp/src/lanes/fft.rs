//! Real transform of power-of-two length on rows.

use std::f64::consts::PI;

use pulp::{Arch, Simd, WithSimd};

use super::{Row, registers};
use crate::error::{DspError, Result};

/// A complex value of one register.
#[derive(Clone, Copy)]
struct C<V> {
    re: V,
    im: V,
}

/// Plan of a real-to-complex transform of `n_fft` points (a power of two) on rows.
///
/// The samples of a frame are taken as `n_fft / 2` complex values, transformed by radix-4
/// decimation in frequency (in place, digit-reversed), and unpacked into `n_fft / 2 + 1` bins.
/// Tables are computed in double precision.
pub struct LaneFft {
    arch: Arch,
    n_fft: usize,
    /// Twiddles of each radix-4 stage, largest first: `w^j, w^2j, w^3j` as (re, im) pairs.
    stages: Vec<Vec<[f32; 6]>>,
    /// Position of bin `k` of the complex transform in its digit-reversed output.
    position: Vec<u32>,
    /// `exp(-2 pi i k / n_fft)` for the unpacking of bin `k`.
    unpack: Vec<[f32; 2]>,
}

impl LaneFft {
    /// Shortest and longest supported transform.
    pub const RANGE: std::ops::RangeInclusive<usize> = 16..=1 << 20;

    /// Whether a transform length is one of ours.
    pub fn supports(n_fft: usize) -> bool {
        n_fft.is_power_of_two() && Self::RANGE.contains(&n_fft)
    }

    /// Plans the transform.
    ///
    /// # Errors
    /// A length that [`LaneFft::supports`] denies.
    pub fn new(n_fft: usize) -> Result<Self> {
        if !Self::supports(n_fft) {
            return Err(DspError::parameter("n_fft", n_fft, "a power of two from 16 to 2^20"));
        }
        let m = n_fft / 2;
        let turn = |k: usize, n: usize| {
            let angle = -2.0 * PI * k as f64 / n as f64;
            [angle.cos() as f32, angle.sin() as f32]
        };
        let mut stages = Vec::new();
        let mut size = m;
        while size > 8 {
            let table = (0..size / 4).map(|j| {
                let [a, b, c] = [turn(j, size), turn(2 * j, size), turn(3 * j, size)];
                [a[0], a[1], b[0], b[1], c[0], c[1]]
            });
            stages.push(table.collect());
            size /= 4;
        }
        let mut position = vec![0u32; m];
        reversed(&mut position, 0, 0, 1, m);
        let unpack = (0..=m / 2).map(|k| turn(k, n_fft)).collect();
        Ok(Self { arch: Arch::new(), n_fft, stages, position, unpack })
    }

    /// Length of the transform in samples, and rows of its input.
    pub fn n_fft(&self) -> usize {
        self.n_fft
    }

    /// Rows of a power spectrum, `n_fft / 2 + 1`.
    pub fn n_bins(&self) -> usize {
        self.n_fft / 2 + 1
    }

    /// `|X|^2` of the windowed `frames` (`n_fft` rows, overwritten) into `power` (`n_bins` rows).
    pub fn power(&self, frames: &mut [Row], power: &mut [Row]) {
        assert_eq!((frames.len(), power.len()), (self.n_fft, self.n_bins()));
        self.arch.dispatch(PowerKernel { plan: self, frames, power });
    }

    /// The complex spectrum of the windowed `frames` (`n_fft` rows, overwritten): real parts into
    /// the even and imaginary parts into the odd rows of `spectrum` (`2 n_bins` rows).
    pub fn complex(&self, frames: &mut [Row], spectrum: &mut [Row]) {
        assert_eq!((frames.len(), spectrum.len()), (self.n_fft, 2 * self.n_bins()));
        self.arch.dispatch(ComplexKernel { plan: self, frames, spectrum });
    }
}

/// Fills `position[k]` for the sub-transform of `size` that starts at `start` and holds the bins
/// `offset, offset + stride, ...`.
fn reversed(position: &mut [u32], start: usize, offset: usize, stride: usize, size: usize) {
    if size <= 8 {
        // Leaves leave their output in natural order.
        for k in 0..size {
            position[offset + k * stride] = (start + k) as u32;
        }
        return;
    }
    for r in 0..4 {
        reversed(position, start + r * size / 4, offset + r * stride, stride * 4, size / 4);
    }
}

struct PowerKernel<'a> {
    plan: &'a LaneFft,
    frames: &'a mut [Row],
    power: &'a mut [Row],
}

impl WithSimd for PowerKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        transform(simd, self.plan, self.frames);
        let power = self.power;
        unpack(simd, self.plan, self.frames, |k, v, x| {
            let squared = simd.mul_add_e_f32s(x.re, x.re, simd.mul_f32s(x.im, x.im));
            power[k].store::<S>(v, squared);
        });
    }
}

struct ComplexKernel<'a> {
    plan: &'a LaneFft,
    frames: &'a mut [Row],
    spectrum: &'a mut [Row],
}

impl WithSimd for ComplexKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        transform(simd, self.plan, self.frames);
        let spectrum = self.spectrum;
        unpack(simd, self.plan, self.frames, |k, v, x| {
            spectrum[2 * k].store::<S>(v, x.re);
            spectrum[2 * k + 1].store::<S>(v, x.im);
        });
    }
}

/// The complex transform of `n_fft / 2` points in place.
#[inline(always)]
fn transform<S: Simd>(simd: S, plan: &LaneFft, rows: &mut [Row]) {
    let Some((first, rest)) = plan.stages.split_first() else {
        leaf(simd, rows);
        return;
    };
    stage(simd, rows, first);
    // Depth first after the first stage: a quarter of a 2048-point block stays in the L1 cache.
    let quarter = rows.len() / 4;
    for part in rows.chunks_exact_mut(quarter) {
        let mut size = quarter;
        for twiddles in rest {
            for block in part.chunks_exact_mut(size) {
                stage(simd, block, twiddles);
            }
            size /= 4;
        }
        for block in part.chunks_exact_mut(size) {
            leaf(simd, block);
        }
    }
}

#[inline(always)]
fn add<S: Simd>(simd: S, a: C<S::f32s>, b: C<S::f32s>) -> C<S::f32s> {
    C { re: simd.add_f32s(a.re, b.re), im: simd.add_f32s(a.im, b.im) }
}

#[inline(always)]
fn sub<S: Simd>(simd: S, a: C<S::f32s>, b: C<S::f32s>) -> C<S::f32s> {
    C { re: simd.sub_f32s(a.re, b.re), im: simd.sub_f32s(a.im, b.im) }
}

/// `a * (re + i im)`.
#[inline(always)]
fn mul<S: Simd>(simd: S, a: C<S::f32s>, re: f32, im: f32) -> C<S::f32s> {
    let (wr, wi) = (simd.splat_f32s(re), simd.splat_f32s(im));
    C {
        re: simd.negate_mul_add_e_f32s(a.im, wi, simd.mul_f32s(a.re, wr)),
        im: simd.mul_add_e_f32s(a.re, wi, simd.mul_f32s(a.im, wr)),
    }
}

/// `-i a`.
#[inline(always)]
fn turn_back<S: Simd>(simd: S, a: C<S::f32s>) -> C<S::f32s> {
    C { re: a.im, im: simd.neg_f32s(a.re) }
}

#[inline(always)]
fn load<S: Simd>(pair: &[Row; 2], v: usize) -> C<S::f32s> {
    C { re: pair[0].load::<S>(v), im: pair[1].load::<S>(v) }
}

#[inline(always)]
fn store<S: Simd>(pair: &mut [Row; 2], v: usize, x: C<S::f32s>) {
    pair[0].store::<S>(v, x.re);
    pair[1].store::<S>(v, x.im);
}

/// The four-point transform.
#[inline(always)]
fn four<S: Simd>(simd: S, x: [C<S::f32s>; 4]) -> [C<S::f32s>; 4] {
    let (even, odd) = (add(simd, x[0], x[2]), sub(simd, x[0], x[2]));
    let (cross, turned) = (add(simd, x[1], x[3]), turn_back(simd, sub(simd, x[1], x[3])));
    [add(simd, even, cross), add(simd, odd, turned), sub(simd, even, cross), sub(simd, odd, turned)]
}

/// One radix-4 stage over a block: four-point transforms across its quarters, then twiddles.
#[inline(always)]
fn stage<S: Simd>(simd: S, block: &mut [Row], twiddles: &[[f32; 6]]) {
    let pairs = block.as_chunks_mut::<2>().0;
    let quarter = pairs.len() / 4;
    let (a, rest) = pairs.split_at_mut(quarter);
    let (b, rest) = rest.split_at_mut(quarter);
    let (c, d) = rest.split_at_mut(quarter);
    for ((((a, b), c), d), w) in a.iter_mut().zip(b).zip(c).zip(d).zip(twiddles) {
        for v in 0..registers::<S>() {
            let x = [load::<S>(a, v), load::<S>(b, v), load::<S>(c, v), load::<S>(d, v)];
            let y = four(simd, x);
            store::<S>(a, v, y[0]);
            store::<S>(b, v, mul(simd, y[1], w[0], w[1]));
            store::<S>(c, v, mul(simd, y[2], w[2], w[3]));
            store::<S>(d, v, mul(simd, y[3], w[4], w[5]));
        }
    }
}

/// The last 4 or 8 points, in natural order.
#[inline(always)]
fn leaf<S: Simd>(simd: S, block: &mut [Row]) {
    let pairs = block.as_chunks_mut::<2>().0;
    if let Ok(pairs) = <&mut [[Row; 2]; 8]>::try_from(&mut *pairs) {
        eight(simd, pairs);
    } else if let Ok(pairs) = <&mut [[Row; 2]; 4]>::try_from(&mut *pairs) {
        for v in 0..registers::<S>() {
            let y = four(simd, [0, 1, 2, 3].map(|i| load::<S>(&pairs[i], v)));
            for (pair, y) in pairs.iter_mut().zip(y) {
                store::<S>(pair, v, y);
            }
        }
    } else {
        unreachable!("leaves have four or eight points");
    }
}

/// The eight-point transform as two four-point transforms.
#[inline(always)]
fn eight<S: Simd>(simd: S, pairs: &mut [[Row; 2]; 8]) {
    const H: f32 = std::f32::consts::FRAC_1_SQRT_2;
    for v in 0..registers::<S>() {
        let x = [0, 1, 2, 3, 4, 5, 6, 7].map(|i| load::<S>(&pairs[i], v));
        let even = four(simd, [x[0], x[2], x[4], x[6]]);
        let odd = four(simd, [x[1], x[3], x[5], x[7]]);
        let turned =
            [odd[0], mul(simd, odd[1], H, -H), turn_back(simd, odd[2]), mul(simd, odd[3], -H, -H)];
        for i in 0..4 {
            store::<S>(&mut pairs[i], v, add(simd, even[i], turned[i]));
            store::<S>(&mut pairs[i + 4], v, sub(simd, even[i], turned[i]));
        }
    }
}

/// Bins of the real transform from the packed complex one; `each(bin, register, value)`.
#[inline(always)]
fn unpack<S: Simd>(
    simd: S,
    plan: &LaneFft,
    rows: &[Row],
    mut each: impl FnMut(usize, usize, C<S::f32s>),
) {
    let pairs = rows.as_chunks::<2>().0;
    let m = pairs.len();
    let half = simd.splat_f32s(0.5);
    let zero = simd.splat_f32s(0.0);
    for v in 0..registers::<S>() {
        let z = load::<S>(&pairs[0], v);
        each(0, v, C { re: simd.add_f32s(z.re, z.im), im: zero });
        each(m, v, C { re: simd.sub_f32s(z.re, z.im), im: zero });
        let z = load::<S>(&pairs[plan.position[m / 2] as usize], v);
        each(m / 2, v, C { re: z.re, im: simd.neg_f32s(z.im) });
    }
    for k in 1..m / 2 {
        let low = &pairs[plan.position[k] as usize];
        let high = &pairs[plan.position[m - k] as usize];
        let [wr, wi] = plan.unpack[k];
        for v in 0..registers::<S>() {
            let (a, b) = (load::<S>(low, v), load::<S>(high, v));
            // Spectra of the even and (times i) of the odd samples, from z(k) and conj z(m - k).
            let even = C {
                re: simd.mul_f32s(half, simd.add_f32s(a.re, b.re)),
                im: simd.mul_f32s(half, simd.sub_f32s(a.im, b.im)),
            };
            let odd = C {
                re: simd.mul_f32s(half, simd.add_f32s(a.im, b.im)),
                im: simd.mul_f32s(half, simd.sub_f32s(b.re, a.re)),
            };
            let turned = mul(simd, odd, wr, wi);
            each(k, v, add(simd, even, turned));
            let mirrored = sub(simd, even, turned);
            each(m - k, v, C { re: mirrored.re, im: simd.neg_f32s(mirrored.im) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::LANES;
    use num_complex::Complex;
    use realfft::RealFftPlanner;

    fn noise(n: usize) -> Vec<Row> {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (state >> 40) as f32 / (1u64 << 23) as f32 - 1.0
        };
        (0..n).map(|_| Row(std::array::from_fn(|_| next()))).collect()
    }

    fn reference(frames: &[Row], slot: usize) -> Vec<Complex<f64>> {
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(frames.len());
        let mut x: Vec<f64> = frames.iter().map(|r| f64::from(r.0[slot])).collect();
        let mut out = fft.make_output_vec();
        fft.process(&mut x, &mut out).unwrap();
        out
    }

    #[test]
    fn every_length_agrees_with_a_double_precision_transform() {
        for n in (4..=14).map(|e| 1usize << e) {
            let frames = noise(n);
            let plan = LaneFft::new(n).unwrap();
            let mut spectrum = vec![Row::ZERO; 2 * plan.n_bins()];
            plan.complex(&mut frames.clone(), &mut spectrum);
            let mut power = vec![Row::ZERO; plan.n_bins()];
            plan.power(&mut frames.clone(), &mut power);
            for slot in 0..LANES {
                let want = reference(&frames, slot);
                let scale = want.iter().map(|z| z.norm()).fold(0.0, f64::max);
                for (k, z) in want.iter().enumerate() {
                    let got = Complex::new(spectrum[2 * k].0[slot], spectrum[2 * k + 1].0[slot]);
                    let error = (Complex::new(f64::from(got.re), f64::from(got.im)) - z).norm();
                    assert!(error < 4e-7 * scale, "n {n} bin {k}: {error} of {scale}");
                    let p = f64::from(power[k].0[slot]);
                    assert!((p - z.norm_sqr()).abs() < 2e-6 * scale * scale);
                }
            }
        }
    }

    #[test]
    fn other_lengths_are_refused() {
        assert!(LaneFft::new(1000).is_err());
        assert!(LaneFft::new(8).is_err());
    }
}
