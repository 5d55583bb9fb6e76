//! A tabulated interpolator between samples.

use std::ops::Range;

use pulp::{Arch, Simd, WithSimd};

use super::common;
use super::design::PolyDesign;
use super::dot::{BLOCK, dot};
use super::frames::Frames;
use super::strided::strided;
use crate::lanes::{Lanes, Row};

/// A tabulated interpolator.
#[derive(Debug, Clone)]
pub(super) struct Poly {
    taps: usize,
    order: usize,
    first: u64,
    step: u64,
    /// Position units per input frame.
    unit: u64,
    /// Positions per tabulated phase.
    grain: u64,
    /// Taps with the zeros after them that fill blocks.
    width: usize,
    /// `[phase][order + 1][width]`: coefficients of the polynomial in the rest of the position.
    table: Vec<f32>,
}

impl Poly {
    pub fn new(design: &PolyDesign) -> Self {
        let PolyDesign { taps, phases, order, .. } = *design;
        let unit = if order == 0 { phases as u64 } else { 1 << 32 };
        let value = |i: usize| design.prototype.get(i).copied().unwrap_or(0.0);
        let width = taps.next_multiple_of(BLOCK);
        let mut table = Vec::with_capacity(width * phases * (order + 1));
        for phase in 0..phases {
            for k in 0..=order {
                for tap in (0..taps).rev() {
                    let at = tap * phases + phase;
                    let (f0, f1, f2) = (value(at), value(at + 1), value(at + 2));
                    let second = 0.5 * (f2 + f0) - f1;
                    table.push(match (order, k) {
                        (_, 0) => f0,
                        (1, _) => f1 - f0,
                        (_, 1) => f1 - f0 - second,
                        _ => second,
                    } as f32);
                }
                table.resize(table.len().next_multiple_of(width), 0.0);
            }
        }
        let (first, step) = (design.first, design.step);
        Self { taps, order, first, step, unit, grain: unit / phases as u64, width, table }
    }

    /// Frame and rest of the position of output `o`.
    fn position(&self, o: u64) -> (i64, u64) {
        let at = u128::from(self.first) + u128::from(o) * u128::from(self.step);
        ((at / u128::from(self.unit)) as i64, (at % u128::from(self.unit)) as u64)
    }

    fn end(&self, o: u64) -> i64 {
        self.position(o).0 + (self.taps / 2) as i64 + 1
    }

    /// Input frames that cover what outputs `out` depend on.
    pub fn input_range(&self, out: &Range<u64>) -> Range<i64> {
        self.end(out.start) - self.taps as i64..self.end(out.end - 1)
    }

    /// Outputs that can be computed when inputs before `end` are known.
    pub fn available(&self, end: i64) -> u64 {
        let limit = (i128::from(end) - (self.taps / 2) as i128) * i128::from(self.unit);
        let step = i128::from(self.step);
        ((limit - i128::from(self.first) + step - 1) / step).max(0) as u64
    }

    /// After so many inputs and so many outputs places repeat. `None` where they do not.
    pub fn period(&self) -> Option<(u64, u64)> {
        let both = common(self.unit.into(), self.step.into()) as u64;
        (self.order == 0).then_some((self.step / both, self.unit / both))
    }

    /// Outputs from number `first` on (interleaved) of `input`, which covers
    /// [`input_range`](Self::input_range).
    pub fn run(&self, channels: usize, first: u64, input: Frames, out: &mut [f32]) {
        Arch::new().dispatch(Interpolate { poly: self, channels, first, input, out });
    }

    /// The first `out.len()` outputs of rows that begin with the first frame of output 0.
    ///
    /// # Panics
    /// Places that do not repeat.
    pub fn run_rows(&self, rows: &[[Row; 2]], out: &mut [[Row; 2]]) {
        assert_eq!(self.order, 0, "every phase is tabulated");
        Arch::new().dispatch(InterpolateRows { poly: self, rows, out });
    }
}

struct InterpolateRows<'a> {
    poly: &'a Poly,
    rows: &'a [[Row; 2]],
    out: &'a mut [[Row; 2]],
}

impl WithSimd for InterpolateRows<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { poly, rows, out } = self;
        let Poly { taps, step, unit, grain, width, .. } = *poly;
        let (start, mut rest) = poly.position(0);
        let mut frame = 0;
        debug_assert_eq!(start, 0, "the first output is near the first input");
        for slots in out {
            let phase = (rest / grain) as usize;
            let weights = &poly.table[phase * width..][..taps];
            let rows = &rows[frame..][..taps];
            for v in 0..Row::registers::<S>() {
                let mut sums = [simd.splat_f32s(0.0); 2];
                for (w, row) in weights.iter().zip(rows) {
                    let w = simd.splat_f32s(*w);
                    for (sum, row) in sums.iter_mut().zip(row) {
                        *sum = simd.mul_add_f32s(w, row.load::<S>(v), *sum);
                    }
                }
                for (slot, sum) in slots.iter_mut().zip(sums) {
                    slot.store::<S>(v, sum);
                }
            }
            rest += step;
            frame += (rest / unit) as usize;
            rest %= unit;
        }
    }
}

struct Interpolate<'a> {
    poly: &'a Poly,
    channels: usize,
    first: u64,
    input: Frames<'a>,
    out: &'a mut [f32],
}

impl WithSimd for Interpolate<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { poly, channels, first, input, out } = self;
        let Poly { taps, order, step, unit, grain, width, .. } = *poly;
        let (mut frame, mut rest) = poly.position(first);
        let reach = (taps / 2) as i64 + 1 - taps as i64;
        // Channel by channel, with zeros after that meet those of the last taps.
        let room = input.data.len() / channels + width - taps;
        let mut planar = vec![0.0; room * channels];
        for (c, samples) in planar.chunks_exact_mut(room).enumerate() {
            strided(input.data, c, channels, samples, |x| x);
        }
        let mut coefficients = vec![0.0f32; width];
        for slots in out.chunks_exact_mut(channels) {
            let from = (frame + reach - input.start) as usize;
            let phase = (rest / grain) as usize;
            let table = &poly.table[phase * width * (order + 1)..(phase + 1) * width * (order + 1)];
            let taps = if order == 0 {
                table
            } else {
                let x = (rest % grain) as f32 / grain as f32;
                let (constant, higher) = table.split_at(width);
                for (i, c) in coefficients.iter_mut().enumerate() {
                    let slope = if order == 1 {
                        higher[i]
                    } else {
                        higher[width + i].mul_add(x, higher[i])
                    };
                    *c = slope.mul_add(x, constant[i]);
                }
                &coefficients[..]
            };
            for (slot, samples) in slots.iter_mut().zip(planar.chunks_exact(room)) {
                *slot = dot(simd, taps, &samples[from..from + width]);
            }
            rest += step;
            frame += (rest / unit) as i64;
            rest %= unit;
        }
    }
}
