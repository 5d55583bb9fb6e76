//! Circular convolution of complex rows with a symmetric real filter.

use pulp::{Arch, Simd, WithSimd};

use super::complex::{C, Dft, Pair, Points, load, store};
use super::passes::Stage;
use super::twiddles::{radices, reversed};
use super::{LaneFft, Lanes, Row};
use crate::real::Real;

/// Convolution of a circle of complex rows with a filter whose response is real, at the same rate, from
/// there to half the rate, or to twice the rate.
///
/// Bins stay in the order in which the passes forward leave them: the response is laid out alike, and the
/// passes back begin there. Both are taken depth first, part by part, in place. Real and imaginary
/// parts are two signals, convolved at once.
pub(crate) struct Convolution<R: Lanes = Row> {
    arch: Arch,
    change: Change,
    /// Rows of the circle, and of the result.
    inputs: usize,
    outputs: usize,
    forward: Vec<Stage<R>>,
    back: Vec<Stage<R>>,
    steps: Vec<Step>,
    /// Leaf by leaf the responses of its bins, as many as the longer transform has there.
    response: Vec<R::Value>,
}

/// What the result has instead of each input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Change {
    Half,
    Same,
    Double,
}

impl Change {
    /// Bins of a leaf before and after.
    fn leaf(self) -> [usize; 2] {
        match self {
            Self::Half => [8, 4],
            Self::Same => [8, 8],
            Self::Double => [4, 8],
        }
    }

    /// Outputs for this many inputs.
    pub fn of(self, inputs: usize) -> usize {
        match self {
            Self::Half => inputs / 2,
            Self::Same => inputs,
            Self::Double => 2 * inputs,
        }
    }
}

/// What is done next, and from which leaf on.
#[derive(Clone, Copy)]
enum Step {
    Forward { stage: usize, leaf: usize },
    Leaves { leaf: usize, count: usize },
    Back { stage: usize, leaf: usize },
}

impl<R: Lanes> Convolution<R> {
    /// Whether a circle may have this length.
    pub fn supports(inputs: usize) -> bool {
        LaneFft::<R>::supports(inputs)
    }

    /// The filter `taps`, an odd number that is symmetric around the middle one, on circles of `inputs` rows,
    /// a power of two from 64 on. Where the rate doubles, taps are at that rate.
    ///
    /// # Panics
    /// Another length, or more taps than the longer transform has points.
    pub fn new(taps: &[f64], inputs: usize, change: Change) -> Self {
        assert!(Self::supports(inputs), "length of the circle");
        let [first, last] = change.leaf();
        let count = inputs / first;
        let radices = radices(count);
        let outputs = change.of(inputs);
        let mut steps = Vec::new();
        schedule(&radices, 0, 0..count, change == Change::Double, &mut steps);
        let bins = inputs.max(outputs);
        let whole = response(taps, bins);
        let mut position = vec![0; bins];
        reversed(&mut position, &[&radices[..], &[first.max(last)]].concat(), 0, 0, 1);
        let mut response = vec![R::Value::of(0.0); bins];
        for (bin, place) in whole.iter().zip(position) {
            response[place as usize] = R::Value::of(*bin);
        }
        Self {
            arch: Arch::new(),
            change,
            inputs,
            outputs,
            forward: Stage::nested(&radices, inputs),
            back: Stage::nested(&radices, outputs),
            steps,
            response,
        }
    }

    /// Rows that [`run`](Self::run) works on.
    pub fn rows(&self) -> usize {
        self.inputs.max(self.outputs)
    }

    /// Replaces the circle at the beginning of `work` by the result, times the length of the longer transform.
    /// Results have the imaginary part first.
    ///
    /// # Panics
    /// `work` of another length than [`rows`](Self::rows).
    pub fn run(&self, work: &mut [[R; 2]]) {
        assert_eq!(work.len(), self.rows());
        self.arch.dispatch(Run { plan: self, work });
    }
}

/// Passes of the leaves `leaves`, in the order in which they can be done in place: where results take more room than
/// what they are made from, from the end.
fn schedule(
    radices: &[usize],
    stage: usize,
    leaves: std::ops::Range<usize>,
    grows: bool,
    steps: &mut Vec<Step>,
) {
    let (leaf, count) = (leaves.start, leaves.len());
    let Some((radix, inner)) = radices.split_first() else { return };
    steps.push(Step::Forward { stage, leaf });
    if inner.is_empty() {
        steps.push(Step::Leaves { leaf, count });
    } else {
        let part = count / radix;
        for i in 0..*radix {
            let first = leaf + if grows { radix - 1 - i } else { i } * part;
            schedule(inner, stage + 1, first..first + part, grows, steps);
        }
    }
    steps.push(Step::Back { stage, leaf });
}

/// Response of the filter around sample 0 of a circle of `bins` samples: it is real.
fn response(taps: &[f64], bins: usize) -> Vec<f64> {
    let reach = taps.len() / 2;
    assert!(taps.len() % 2 == 1 && taps.len() <= bins, "taps around a middle one");
    let mut circle = vec![num_complex::Complex::default(); bins];
    for (i, tap) in taps.iter().enumerate() {
        circle[(bins + i - reach) % bins].re = *tap;
    }
    rustfft::FftPlanner::new().plan_fft_forward(bins).process(&mut circle);
    circle.into_iter().map(|bin: num_complex::Complex<f64>| bin.re).collect()
}

struct Run<'a, R: Lanes> {
    plan: &'a Convolution<R>,
    work: &'a mut [Pair<R>],
}

impl<R: Lanes> WithSimd for Run<'_, R> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { plan, work } = self;
        let [first, last] = plan.change.leaf();
        for step in &plan.steps {
            match *step {
                Step::Forward { stage, leaf } => {
                    let stage = &plan.forward[stage];
                    stage.forward(simd, &mut work[leaf * first..][..stage.size()]);
                }
                Step::Leaves { leaf, count } => match plan.change {
                    Change::Half => leaves::<R, S, 8, 4>(simd, plan, leaf..leaf + count, work),
                    Change::Same => leaves::<R, S, 8, 8>(simd, plan, leaf..leaf + count, work),
                    Change::Double => leaves::<R, S, 4, 8>(simd, plan, leaf..leaf + count, work),
                },
                Step::Back { stage, leaf } => {
                    let stage = &plan.back[stage];
                    stage.join(simd, &mut work[leaf * last..][..stage.size()]);
                }
            }
        }
    }
}

/// The last pass forward, the product with the response, and the first pass back.
#[inline(always)]
fn leaves<R: Lanes, S: Simd, const F: usize, const B: usize>(
    simd: S,
    plan: &Convolution<R>,
    leaves: std::ops::Range<usize>,
    work: &mut [Pair<R>],
) where
    Points: Dft<F> + Dft<B>,
{
    let longer = F.max(B);
    let grows = F < B;
    let count = leaves.len();
    for i in 0..count {
        let leaf = if grows { leaves.end - 1 - i } else { leaves.start + i };
        let weights = &plan.response[leaf * longer..][..longer];
        for v in 0..R::registers::<S>() {
            let from = &work[leaf * F..][..F];
            let x = <Points as Dft<F>>::list(
                #[inline(always)]
                |q| load::<R, S>(&from[q], v),
            );
            let x: [_; F] = Points::of::<R, S>(simd, x);
            // Imaginary parts first: transforms forward of these are transforms back.
            let x = <Points as Dft<B>>::list(
                #[inline(always)]
                |q| {
                    let bin = x[q % F];
                    let w = R::splat(simd, weights[q]);
                    let kept = C { re: R::mul(simd, bin.im, w), im: R::mul(simd, bin.re, w) };
                    if F <= B {
                        return kept;
                    }
                    // Bins that are half the rate apart fall together.
                    let folded = x[(q + B) % F];
                    let w = R::splat(simd, weights[(q + B) % longer]);
                    C {
                        re: R::mul_add_e(simd, folded.im, w, kept.re),
                        im: R::mul_add_e(simd, folded.re, w, kept.im),
                    }
                },
            );
            let y: [_; B] = Points::of::<R, S>(simd, x);
            let to = &mut work[leaf * B..][..B];
            let _: [(); B] = <Points as Dft<B>>::list(
                #[inline(always)]
                |q| store::<R, S>(&mut to[q], v, y[q]),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::DoubleRow;

    fn agrees_with_sums<R: Lanes>(tolerance: f64) {
        for inputs in (6..=12).map(|e| 1_usize << e) {
            for change in [Change::Half, Change::Same, Change::Double] {
                let taps: Vec<f64> = (0..31).map(|i| f64::from(16 - (i - 15_i32).abs())).collect();
                let plan = Convolution::<R>::new(&taps, inputs, change);
                let sample = |n: usize, part: usize, slot: usize| {
                    ((n * n * 7 + 31 * part + 5 * slot) % 101) as f64 / 101.0 - 0.5
                };
                let mut work = vec![[R::EMPTY; 2]; plan.rows()];
                for (n, pair) in work.iter_mut().take(inputs).enumerate() {
                    for (part, row) in pair.iter_mut().enumerate() {
                        let slots = row.values_mut().iter_mut().enumerate();
                        slots.for_each(|(s, x)| *x = R::Value::of(sample(n, part, s)));
                    }
                }
                plan.run(&mut work);
                let (bins, outputs) = (plan.rows(), change.of(inputs));
                for (m, pair) in work.iter().take(outputs).enumerate() {
                    for (part, slot) in [(0, 0), (1, 0), (0, R::SLOTS - 1)] {
                        // Sample `m` of the result among `bins`, of which inputs are every `bins / inputs`-th.
                        let at = m * (bins / outputs);
                        let term = |(i, tap): (usize, &f64)| {
                            let from = (at + bins + 15 - i) % bins;
                            let apart = bins / inputs;
                            let hit = from.is_multiple_of(apart);
                            if hit { tap * sample(from / apart, part, slot) } else { 0.0 }
                        };
                        let want: f64 = taps.iter().enumerate().map(term).sum();
                        let got = pair[1 - part].values()[slot].wide() / bins as f64;
                        let error = (got - want).abs();
                        assert!(error < tolerance * 100.0, "{inputs} {change:?} {m}: {error}");
                    }
                }
            }
        }
    }

    #[test]
    fn sums_of_products_on_a_circle() {
        agrees_with_sums::<Row>(1e-6);
        agrees_with_sums::<DoubleRow>(1e-14);
    }
}
