//! Real transform of power-of-two length on rows.

use pulp::{Arch, Simd, WithSimd};

use super::complex::{C, Dft, Pair, Points, add, load, mul, store, sub};
use super::twiddles::{radices, reversed, turn, twiddles};
use super::{Frames, Row, registers};
use crate::error::{DspError, Result};

/// Plan of a real-to-complex transform of `n_fft` points (a power of two) on rows.
///
/// The samples of a frame are taken as `n_fft / 2` complex values and transformed by decimation in
/// frequency, in place: a pass of radix 4 over the whole frame, which can read windowed samples
/// from where they lie, then quarter by quarter passes of radix 8 (and of 4, where the length
/// asks for it) that stay in the cache. Bins `k` and `n_fft / 2 - k` unpack into those of the real
/// transform as soon as their quarters are done. Tables are computed in double precision.
pub struct LaneFft {
    arch: Arch,
    n_fft: usize,
    /// The pass over the whole frame: for each column `w^0, w^j, w^2j, w^3j`, halved since
    /// unpacking adds two halves.
    first: Vec<[[f32; 2]; 4]>,
    /// Passes over a quarter, all but the last.
    stages: Vec<Stage>,
    /// Points of the last pass, 4 or 8.
    leaf: usize,
    /// Position of value `p` of a quarter in its digit-reversed output.
    position: Vec<u32>,
    /// `exp(-2 pi i k / n_fft)` for the unpacking of bin `k = q + 4 p`, at `[q][p]`.
    unpack: Vec<[f32; 2]>,
}

/// Twiddles of a pass over blocks, for each column `w^0, w^j, w^2j, ...`.
enum Stage {
    Four(Vec<[[f32; 2]; 4]>),
    Eight(Vec<[[f32; 2]; 8]>),
}

impl LaneFft {
    /// Shortest and longest supported transform.
    pub const RANGE: std::ops::RangeInclusive<usize> = 64..=1 << 20;

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
            return Err(DspError::parameter("n_fft", n_fft, "a power of two from 64 to 2^20"));
        }
        let m = n_fft / 2;
        let quarter = m / 4;
        let radices = radices(quarter);
        let mut size = quarter;
        let mut stages = Vec::new();
        for radix in &radices[..radices.len() - 1] {
            stages.push(match radix {
                8 => Stage::Eight(twiddles(size, 1.0)),
                _ => Stage::Four(twiddles(size, 1.0)),
            });
            size /= radix;
        }
        let mut position = vec![0; quarter];
        reversed(&mut position, &radices, 0, 0, 1);
        let bin = |q| (0..quarter).map(move |p| turn(q + 4 * p, n_fft).map(|x| x as f32));
        Ok(Self {
            arch: Arch::new(),
            n_fft,
            first: twiddles(m, 0.5),
            stages,
            leaf: size,
            position,
            unpack: (0..4).flat_map(bin).collect(),
        })
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
        self.first_pass(InPlace, frames);
        self.power_of_passed(frames, power);
    }

    /// As [`power`](Self::power), of `frames` times `window` (`n_fft` values), read where they lie.
    /// `work` (`n_fft` rows) is overwritten.
    pub fn power_of(
        &self,
        frames: &impl Frames,
        window: &[f32],
        work: &mut [Row],
        power: &mut [Row],
    ) {
        self.first_pass(Windowed { frames, window: window.as_chunks::<2>().0 }, work);
        self.power_of_passed(work, power);
    }

    /// The complex spectrum of the windowed `frames` (`n_fft` rows, overwritten): real parts into
    /// the even and imaginary parts into the odd rows of `spectrum` (`2 n_bins` rows).
    pub fn complex(&self, frames: &mut [Row], spectrum: &mut [Row]) {
        self.first_pass(InPlace, frames);
        assert_eq!(spectrum.len(), 2 * self.n_bins());
        let out = Complex(spectrum.as_chunks_mut::<2>().0);
        self.arch.dispatch(Quarters { plan: self, work: frames, out });
    }

    fn power_of_passed(&self, work: &mut [Row], power: &mut [Row]) {
        assert_eq!(power.len(), self.n_bins());
        self.arch.dispatch(Quarters { plan: self, work, out: Power(power) });
    }

    fn first_pass(&self, source: impl Source, work: &mut [Row]) {
        assert_eq!(work.len(), self.n_fft);
        self.arch.dispatch(FirstPass { plan: self, source, work });
    }
}

/// Where the first pass takes its values.
trait Source {
    /// Value `j` of the packed frame; `stored` is what lies there in the working memory.
    fn value<S: Simd>(&self, simd: S, stored: &Pair, j: usize, v: usize) -> C<S::f32s>;
}

struct InPlace;

impl Source for InPlace {
    #[inline(always)]
    fn value<S: Simd>(&self, _: S, stored: &Pair, _: usize, v: usize) -> C<S::f32s> {
        load::<S>(stored, v)
    }
}

struct Windowed<'a, F> {
    frames: &'a F,
    window: &'a [[f32; 2]],
}

impl<F: Frames> Source for Windowed<'_, F> {
    #[inline(always)]
    fn value<S: Simd>(&self, simd: S, _: &Pair, j: usize, v: usize) -> C<S::f32s> {
        let [re, im] = self.window[j];
        C {
            re: simd.mul_f32s(simd.splat_f32s(re), self.frames.row(2 * j).load::<S>(v)),
            im: simd.mul_f32s(simd.splat_f32s(im), self.frames.row(2 * j + 1).load::<S>(v)),
        }
    }
}

struct FirstPass<'a, F> {
    plan: &'a LaneFft,
    source: F,
    work: &'a mut [Row],
}

impl<F: Source> WithSimd for FirstPass<'_, F> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { plan, source, work } = self;
        let half = simd.splat_f32s(0.5);
        let quarter = plan.first.len();
        let parts = parts::<4>(work.as_chunks_mut::<2>().0, quarter);
        for (j, w) in plan.first.iter().enumerate() {
            for v in 0..registers::<S>() {
                let x = Points::list(
                    #[inline(always)]
                    |q| source.value(simd, &parts[q][j], j + q * quarter, v),
                );
                let y: [_; 4] = Points::of(simd, x);
                let y0 = C { re: simd.mul_f32s(half, y[0].re), im: simd.mul_f32s(half, y[0].im) };
                store::<S>(&mut parts[0][j], v, y0);
                store::<S>(&mut parts[1][j], v, mul(simd, y[1], w[1]));
                store::<S>(&mut parts[2][j], v, mul(simd, y[2], w[2]));
                store::<S>(&mut parts[3][j], v, mul(simd, y[3], w[3]));
            }
        }
    }
}

/// The first `R` parts of `length` values.
#[inline(always)]
fn parts<const R: usize>(block: &mut [Pair], length: usize) -> [&mut [Pair]; R]
where
    Points: Dft<R>,
{
    let mut parts = block.chunks_exact_mut(length);
    Points::list(|_| parts.next().map_or(&mut [][..], |part| &mut part[..length]))
}

/// A pass over a block: transforms across its parts, then twiddles.
#[inline(always)]
fn pass<S: Simd, const R: usize>(simd: S, block: &mut [Pair], twiddles: &[[[f32; 2]; R]])
where
    Points: Dft<R>,
{
    let length = twiddles.len();
    let mut parts = parts::<R>(block, length);
    for (j, w) in twiddles.iter().enumerate() {
        for v in 0..registers::<S>() {
            let x = Points::list(
                #[inline(always)]
                |q| load::<S>(&parts[q][j], v),
            );
            let y: [_; R] = Points::of(simd, x);
            let _: [(); R] = Points::list(
                #[inline(always)]
                |q| {
                    let turned = if q == 0 { y[0] } else { mul(simd, y[q], w[q]) };
                    store::<S>(&mut parts[q][j], v, turned);
                },
            );
        }
    }
}

/// The last pass: neighbouring points, into natural order.
#[inline(always)]
fn leaves<S: Simd, const R: usize>(simd: S, quarter: &mut [Pair])
where
    Points: Dft<R>,
{
    for leaf in quarter.as_chunks_mut::<R>().0 {
        for v in 0..registers::<S>() {
            let x = Points::list(
                #[inline(always)]
                |q| load::<S>(&leaf[q], v),
            );
            let y: [_; R] = Points::of(simd, x);
            let _: [(); R] = Points::list(
                #[inline(always)]
                |q| store::<S>(&mut leaf[q], v, y[q]),
            );
        }
    }
}

/// What becomes of a bin.
trait Output<S: Simd> {
    fn put(&mut self, simd: S, bin: usize, v: usize, x: C<S::f32s>);
}

struct Power<'a>(&'a mut [Row]);

impl<S: Simd> Output<S> for Power<'_> {
    #[inline(always)]
    fn put(&mut self, simd: S, bin: usize, v: usize, x: C<S::f32s>) {
        let squared = simd.mul_add_e_f32s(x.re, x.re, simd.mul_f32s(x.im, x.im));
        self.0[bin].store::<S>(v, squared);
    }
}

struct Complex<'a>(&'a mut [Pair]);

impl<S: Simd> Output<S> for Complex<'_> {
    #[inline(always)]
    fn put(&mut self, _: S, bin: usize, v: usize, x: C<S::f32s>) {
        store::<S>(&mut self.0[bin], v, x);
    }
}

/// Everything behind the first pass.
struct Quarters<'a, O> {
    plan: &'a LaneFft,
    work: &'a mut [Row],
    out: O,
}

macro_rules! quarters_with_simd {
    ($out:ty) => {
        impl WithSimd for Quarters<'_, $out> {
            type Output = ();

            #[inline(always)]
            fn with_simd<S: Simd>(self, simd: S) {
                quarters(simd, self.plan, self.work.as_chunks_mut::<2>().0, self.out);
            }
        }
    };
}
quarters_with_simd!(Power<'_>);
quarters_with_simd!(Complex<'_>);

/// Quarter `q` holds the values `q + 4 p`, so that `m - k` of its values lies in quarter `4 - q`.
#[inline(always)]
fn quarters<S: Simd>(simd: S, plan: &LaneFft, work: &mut [Pair], mut out: impl Output<S>) {
    let [zeroth, low, middle, high] = parts::<4>(work, plan.first.len());
    transform(simd, plan, zeroth);
    let m = plan.n_fft / 2;
    let zero = simd.splat_f32s(0.0);
    for v in 0..registers::<S>() {
        let z = load::<S>(&zeroth[0], v);
        let (sum, difference) = (simd.add_f32s(z.re, z.im), simd.sub_f32s(z.re, z.im));
        out.put(simd, 0, v, C { re: simd.add_f32s(sum, sum), im: zero });
        out.put(simd, m, v, C { re: simd.add_f32s(difference, difference), im: zero });
    }
    let n = plan.position.len();
    unpack(simd, plan, 0, zeroth, zeroth, (1..=n / 2).map(|p| (p, n - p)), &mut out);
    transform(simd, plan, middle);
    unpack(simd, plan, 2, middle, middle, (0..n / 2).map(|p| (p, n - 1 - p)), &mut out);
    transform(simd, plan, low);
    transform(simd, plan, high);
    unpack(simd, plan, 1, low, high, (0..n).map(|p| (p, n - 1 - p)), &mut out);
}

/// The remaining passes over a quarter, depth first.
#[inline(always)]
fn transform<S: Simd>(simd: S, plan: &LaneFft, quarter: &mut [Pair]) {
    let mut size = quarter.len();
    for stage in &plan.stages {
        for block in quarter.chunks_exact_mut(size) {
            match stage {
                Stage::Four(twiddles) => pass(simd, block, twiddles),
                Stage::Eight(twiddles) => pass(simd, block, twiddles),
            }
        }
        size /= match stage {
            Stage::Four(_) => 4,
            Stage::Eight(_) => 8,
        };
    }
    match plan.leaf {
        8 => leaves::<S, 8>(simd, quarter),
        _ => leaves::<S, 4>(simd, quarter),
    }
}

/// Bins `q + 4 p` of quarter `q`, and those that mirror them, for each `(p, mirrored p)`.
#[inline(always)]
fn unpack<S: Simd>(
    simd: S,
    plan: &LaneFft,
    q: usize,
    low: &[Pair],
    high: &[Pair],
    places: impl Iterator<Item = (usize, usize)>,
    out: &mut impl Output<S>,
) {
    let m = plan.n_fft / 2;
    let turns = &plan.unpack[q * plan.position.len()..];
    for (p, mirrored) in places {
        let k = q + 4 * p;
        let low = &low[plan.position[p] as usize];
        let high = &high[plan.position[mirrored] as usize];
        for v in 0..registers::<S>() {
            let (a, b) = (load::<S>(low, v), load::<S>(high, v));
            // Spectra of the even and (times i) of the odd samples, from z(k) and conj z(m - k).
            let even = C { re: simd.add_f32s(a.re, b.re), im: simd.sub_f32s(a.im, b.im) };
            let odd = C { re: simd.add_f32s(a.im, b.im), im: simd.sub_f32s(b.re, a.re) };
            let turned = mul(simd, odd, turns[p]);
            let mirror = sub(simd, even, turned);
            out.put(simd, k, v, add(simd, even, turned));
            out.put(simd, m - k, v, C { re: mirror.re, im: simd.neg_f32s(mirror.im) });
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
        for n in (6..=15).map(|e| 1usize << e) {
            let frames = noise(n);
            let plan = LaneFft::new(n).unwrap();
            let mut spectrum = vec![Row::ZERO; 2 * plan.n_bins()];
            plan.complex(&mut frames.clone(), &mut spectrum);
            let mut power = vec![Row::ZERO; plan.n_bins()];
            plan.power(&mut frames.clone(), &mut power);
            let mut again = power.clone();
            plan.power_of(&frames.as_slice(), &vec![1.0; n], &mut frames.clone(), &mut again);
            assert_eq!(again, power);
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
        assert!(LaneFft::new(32).is_err());
    }
}
