//! Real transform of power-of-two length on rows.

use pulp::{Arch, Simd, WithSimd};

use super::complex::{C, Dft, Pair, Points, add, load, mul, store, sub};
use super::passes::{Stage, leaves, parts};
use super::twiddles::{radices, reversed, turn, twiddles};
use super::{Frames, Lanes, Row};
use crate::error::{DspError, Result};
use crate::real::Real;

/// Plan of a real-to-complex transform of `n_fft` points (a power of two) on rows.
///
/// The samples of a frame are taken as `n_fft / 2` complex values and transformed by decimation in
/// frequency, in place: a pass of radix 4 over the whole frame, which can read windowed samples
/// from where they lie, then quarter by quarter passes of radix 8 (and of 4, where the length
/// asks for it) that stay in the cache. Bins `k` and `n_fft / 2 - k` unpack into those of the real
/// transform as soon as their quarters are done. Tables are computed in double precision.
pub struct LaneFft<R: Lanes = Row> {
    arch: Arch,
    n_fft: usize,
    /// The pass over the whole frame: for each column `w^0, w^j, w^2j, w^3j`, halved since
    /// unpacking adds two halves.
    first: Vec<[[R::Value; 2]; 4]>,
    /// Passes over a quarter, all but the last.
    stages: Vec<Stage<R>>,
    /// Points of the last pass, 4 or 8.
    leaf: usize,
    /// Position of value `p` of a quarter in its digit-reversed output.
    position: Vec<u32>,
    /// `exp(-2 pi i k / n_fft)` for the unpacking of bin `k = q + 4 p`, at `[q][p]`.
    unpack: Vec<[R::Value; 2]>,
}

impl<R: Lanes> LaneFft<R> {
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
        let (leaf, passes) = radices.split_last().expect("eight points or more");
        let stages = Stage::nested(passes, quarter);
        let mut position = vec![0; quarter];
        reversed(&mut position, &radices, 0, 0, 1);
        let bin = |q| (0..quarter).map(move |p| turn(q + 4 * p, n_fft).map(R::Value::of));
        Ok(Self {
            arch: Arch::new(),
            n_fft,
            first: twiddles(m, 0.5),
            stages,
            leaf: *leaf,
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
    pub fn power(&self, frames: &mut [R], power: &mut [R]) {
        R::power(self, frames, power);
    }

    /// What [`Lanes::power`] compiles.
    pub(super) fn power_here(&self, frames: &mut [R], power: &mut [R]) {
        self.first_pass(InPlace, frames);
        self.power_of_passed(frames, power);
    }

    /// As [`power`](Self::power), of `frames` times `window` (`n_fft` values), read where they lie.
    /// `work` (`n_fft` rows) is overwritten.
    pub fn power_of(
        &self,
        frames: &impl Frames<R>,
        window: &[R::Value],
        work: &mut [R],
        power: &mut [R],
    ) {
        self.first_pass(Windowed { frames, window: window.as_chunks::<2>().0 }, work);
        self.power_of_passed(work, power);
    }

    /// The complex spectrum of the windowed `frames` (`n_fft` rows, overwritten): real parts into
    /// the even and imaginary parts into the odd rows of `spectrum` (`2 n_bins` rows).
    pub fn complex(&self, frames: &mut [R], spectrum: &mut [R]) {
        R::complex(self, frames, spectrum);
    }

    /// What [`Lanes::complex`] compiles.
    pub(super) fn complex_here(&self, frames: &mut [R], spectrum: &mut [R]) {
        self.first_pass(InPlace, frames);
        assert_eq!(spectrum.len(), 2 * self.n_bins());
        let out = Complex(spectrum.as_chunks_mut::<2>().0);
        self.arch.dispatch(Quarters { plan: self, work: frames, out });
    }

    fn power_of_passed(&self, work: &mut [R], power: &mut [R]) {
        assert_eq!(power.len(), self.n_bins());
        self.arch.dispatch(Quarters { plan: self, work, out: Power(power) });
    }

    fn first_pass(&self, source: impl Source<R>, work: &mut [R]) {
        assert_eq!(work.len(), self.n_fft);
        self.arch.dispatch(FirstPass { plan: self, source, work });
    }
}

/// Where the first pass takes its values.
trait Source<R: Lanes> {
    /// Value `j` of the packed frame; `stored` is what lies there in the working memory.
    fn value<S: Simd>(&self, simd: S, stored: &Pair<R>, j: usize, v: usize) -> C<R::Register<S>>;
}

struct InPlace;

impl<R: Lanes> Source<R> for InPlace {
    #[inline(always)]
    fn value<S: Simd>(&self, _: S, stored: &Pair<R>, _: usize, v: usize) -> C<R::Register<S>> {
        load::<R, S>(stored, v)
    }
}

struct Windowed<'a, F, T> {
    frames: &'a F,
    window: &'a [[T; 2]],
}

impl<R: Lanes, F: Frames<R>> Source<R> for Windowed<'_, F, R::Value> {
    #[inline(always)]
    fn value<S: Simd>(&self, simd: S, _: &Pair<R>, j: usize, v: usize) -> C<R::Register<S>> {
        let [re, im] = self.window[j];
        C {
            re: R::mul(simd, R::splat(simd, re), self.frames.row(2 * j).load::<S>(v)),
            im: R::mul(simd, R::splat(simd, im), self.frames.row(2 * j + 1).load::<S>(v)),
        }
    }
}

struct FirstPass<'a, F, R: Lanes> {
    plan: &'a LaneFft<R>,
    source: F,
    work: &'a mut [R],
}

impl<R: Lanes, F: Source<R>> WithSimd for FirstPass<'_, F, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { plan, source, work } = self;
        let half = R::splat(simd, R::Value::of(0.5));
        let quarter = plan.first.len();
        let parts = parts::<R, 4>(work.as_chunks_mut::<2>().0, quarter);
        for (j, w) in plan.first.iter().enumerate() {
            for v in 0..R::registers::<S>() {
                let x = Points::list(
                    #[inline(always)]
                    |q| source.value(simd, &parts[q][j], j + q * quarter, v),
                );
                let y: [_; 4] = Points::of::<R, S>(simd, x);
                let y0 = C { re: R::mul(simd, half, y[0].re), im: R::mul(simd, half, y[0].im) };
                store::<R, S>(&mut parts[0][j], v, y0);
                store::<R, S>(&mut parts[1][j], v, mul::<R, S>(simd, y[1], w[1]));
                store::<R, S>(&mut parts[2][j], v, mul::<R, S>(simd, y[2], w[2]));
                store::<R, S>(&mut parts[3][j], v, mul::<R, S>(simd, y[3], w[3]));
            }
        }
    }
}

/// What becomes of a bin.
trait Output<R: Lanes> {
    fn put<S: Simd>(&mut self, simd: S, bin: usize, v: usize, x: C<R::Register<S>>);
}

struct Power<'a, R>(&'a mut [R]);

impl<R: Lanes> Output<R> for Power<'_, R> {
    #[inline(always)]
    fn put<S: Simd>(&mut self, simd: S, bin: usize, v: usize, x: C<R::Register<S>>) {
        let squared = R::mul_add_e(simd, x.re, x.re, R::mul(simd, x.im, x.im));
        self.0[bin].store::<S>(v, squared);
    }
}

struct Complex<'a, R>(&'a mut [Pair<R>]);

impl<R: Lanes> Output<R> for Complex<'_, R> {
    #[inline(always)]
    fn put<S: Simd>(&mut self, _: S, bin: usize, v: usize, x: C<R::Register<S>>) {
        store::<R, S>(&mut self.0[bin], v, x);
    }
}

/// Everything after the first pass.
struct Quarters<'a, O, R: Lanes> {
    plan: &'a LaneFft<R>,
    work: &'a mut [R],
    out: O,
}

impl<R: Lanes, O: Output<R>> WithSimd for Quarters<'_, O, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        quarters(simd, self.plan, self.work.as_chunks_mut::<2>().0, self.out);
    }
}

/// Quarter `q` holds the values `q + 4 p`, so that `m - k` of its values lies in quarter `4 - q`.
#[inline(always)]
fn quarters<R: Lanes, S: Simd>(
    simd: S,
    plan: &LaneFft<R>,
    work: &mut [Pair<R>],
    mut out: impl Output<R>,
) {
    let [zeroth, low, middle, high] = parts::<R, 4>(work, plan.first.len());
    transform(simd, plan, zeroth);
    let m = plan.n_fft / 2;
    let zero = R::splat(simd, R::Value::of(0.0));
    for v in 0..R::registers::<S>() {
        let z = load::<R, S>(&zeroth[0], v);
        let (sum, difference) = (R::add(simd, z.re, z.im), R::sub(simd, z.re, z.im));
        out.put(simd, 0, v, C { re: R::add(simd, sum, sum), im: zero });
        out.put(simd, m, v, C { re: R::add(simd, difference, difference), im: zero });
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
fn transform<R: Lanes, S: Simd>(simd: S, plan: &LaneFft<R>, quarter: &mut [Pair<R>]) {
    let mut size = quarter.len();
    let mut nested = &plan.stages[..];
    if let [outer, inner @ ..] = nested {
        outer.forward(simd, quarter);
        size /= outer.radix();
        nested = inner;
    }
    // Part by part, each of which stays in the nearest cache.
    for part in quarter.chunks_exact_mut(size) {
        let mut size = size;
        for stage in nested {
            for block in part.chunks_exact_mut(size) {
                stage.forward(simd, block);
            }
            size /= stage.radix();
        }
        match plan.leaf {
            8 => leaves::<R, S, 8>(simd, part),
            _ => leaves::<R, S, 4>(simd, part),
        }
    }
}

/// Bins `q + 4 p` of quarter `q`, and those that mirror them, for each `(p, mirrored p)`.
#[inline(always)]
fn unpack<R: Lanes, S: Simd>(
    simd: S,
    plan: &LaneFft<R>,
    q: usize,
    low: &[Pair<R>],
    high: &[Pair<R>],
    places: impl Iterator<Item = (usize, usize)>,
    out: &mut impl Output<R>,
) {
    let m = plan.n_fft / 2;
    let turns = &plan.unpack[q * plan.position.len()..];
    for (p, mirrored) in places {
        let k = q + 4 * p;
        let low = &low[plan.position[p] as usize];
        let high = &high[plan.position[mirrored] as usize];
        for v in 0..R::registers::<S>() {
            let (a, b) = (load::<R, S>(low, v), load::<R, S>(high, v));
            // Spectra of the even and (times i) of the odd samples, from z(k) and conj z(m - k).
            let even = C { re: R::add(simd, a.re, b.re), im: R::sub(simd, a.im, b.im) };
            let odd = C { re: R::add(simd, a.im, b.im), im: R::sub(simd, b.re, a.re) };
            let turned = mul::<R, S>(simd, odd, turns[p]);
            let mirror = sub::<R, S>(simd, even, turned);
            out.put(simd, k, v, add::<R, S>(simd, even, turned));
            out.put(simd, m - k, v, C { re: mirror.re, im: R::neg(simd, mirror.im) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::DoubleRow;
    use num_complex::Complex;
    use realfft::RealFftPlanner;

    fn noise<R: Lanes>(n: usize) -> Vec<R> {
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            R::Value::of((state >> 40) as f64 / (1u64 << 23) as f64 - 1.0)
        };
        let mut rows = vec![R::EMPTY; n];
        rows.iter_mut().for_each(|row| row.values_mut().fill_with(&mut next));
        rows
    }

    fn reference<R: Lanes>(frames: &[R], slot: usize) -> Vec<Complex<f64>> {
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(frames.len());
        let mut x: Vec<f64> = frames.iter().map(|r| r.values()[slot].wide()).collect();
        let mut out = fft.make_output_vec();
        fft.process(&mut x, &mut out).unwrap();
        out
    }

    /// Within `tolerance` of the largest bin.
    fn agrees_with_a_double_precision_transform<R: Lanes>(tolerance: f64) {
        for n in (6..=15).map(|e| 1usize << e) {
            let frames = noise::<R>(n);
            let plan = LaneFft::<R>::new(n).unwrap();
            let mut spectrum = vec![R::EMPTY; 2 * plan.n_bins()];
            plan.complex(&mut frames.clone(), &mut spectrum);
            let mut power = vec![R::EMPTY; plan.n_bins()];
            plan.power(&mut frames.clone(), &mut power);
            let (window, mut again) = (vec![R::Value::of(1.0); n], power.clone());
            plan.power_of(&frames.as_slice(), &window, &mut frames.clone(), &mut again);
            for slot in 0..R::SLOTS {
                let value = |rows: &[R], k: usize| rows[k].values()[slot].wide();
                let want = reference(&frames, slot);
                let scale = want.iter().map(|z| z.norm()).fold(0.0, f64::max);
                for (k, z) in want.iter().enumerate() {
                    let got = Complex::new(value(&spectrum, 2 * k), value(&spectrum, 2 * k + 1));
                    let error = (got - z).norm();
                    assert!(error < tolerance * scale, "n {n} bin {k}: {error} of {scale}");
                    let p = value(&power, k);
                    assert!((p - z.norm_sqr()).abs() < 5.0 * tolerance * scale * scale);
                    assert_eq!(p, value(&again, k));
                }
            }
        }
    }

    #[test]
    fn every_length_agrees_in_both_precisions() {
        agrees_with_a_double_precision_transform::<Row>(4e-7);
        agrees_with_a_double_precision_transform::<DoubleRow>(1e-15);
    }

    #[test]
    fn other_lengths_are_refused() {
        assert!(LaneFft::<Row>::new(1000).is_err());
        assert!(LaneFft::<Row>::new(32).is_err());
    }
}
