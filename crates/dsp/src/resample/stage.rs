//! One filter of the chain, ready to run at any output position.

use std::borrow::Cow;
use std::ops::Range;

use pulp::{Simd, WithSimd};

use super::common;
use super::design::{Design, PolyDesign};
use super::dot::{BLOCK, dot};
use super::kernel::{Correlate, Plane, SPAN, dispatch};
use super::overlap_save::OverlapSave;
use super::strided::strided;

/// A filter with single-precision coefficients. Outputs are numbered from 0 at input sample 0.
#[derive(Debug, Clone)]
pub(super) enum Stage {
    /// Rational rate change.
    Fir(Fir),
    /// The same rate or half of it, by a long filter.
    Long(OverlapSave),
    /// Tabulated interpolator.
    Poly(Poly),
}

/// Interleaved frames with the absolute number of the first one.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frames<'a> {
    pub data: &'a [f32],
    pub start: i64,
}

impl Stage {
    /// Long filters take blocks of a multiple of `grain` frames, where they can.
    pub fn new(design: &Design, grain: usize) -> Self {
        match design {
            Design::Fir { up, down, taps } => {
                let long = (*up == 1).then(|| OverlapSave::new(taps, *down, grain)).flatten();
                long.map_or_else(|| Self::Fir(Fir::new(*up, *down, taps)), Self::Long)
            }
            Design::Poly(design) => Self::Poly(Poly::new(design)),
        }
    }

    /// Input frames that cover what outputs `out` depend on (may begin before 0).
    pub fn input_range(&self, out: &Range<u64>) -> Range<i64> {
        if out.is_empty() {
            return 0..0;
        }
        // Ends never fall as outputs rise; before them lies the longest reach of any.
        let last = out.end - 1;
        match self {
            Self::Long(long) => long.input_range(out),
            Self::Fir(f) => {
                let reach = f.residues.iter().map(|r| r.len).max().unwrap_or(0);
                f.end(out.start) - reach as i64..f.end(last)
            }
            Self::Poly(p) => p.end(out.start) - p.taps as i64..p.end(last),
        }
    }

    /// Outputs of each channel that one pass makes.
    pub fn pass(&self, channels: usize) -> u64 {
        match self {
            Self::Long(long) => long.pass(channels),
            Self::Fir(_) | Self::Poly(_) => 1,
        }
    }

    /// Outputs of a channel that one thread should make at a time.
    pub fn span(&self) -> usize {
        match self {
            Self::Long(long) => long.span(),
            Self::Fir(_) | Self::Poly(_) => SPAN,
        }
    }

    /// What must divide the number of frames that are left out before the input, so that outputs keep their
    /// bits, and the change of rate as a fraction. `None` where places of outputs do not repeat.
    pub fn repeats(&self) -> Option<(u64, u64, u64)> {
        Some(match self {
            Self::Long(long) => (long.step() as u64, 1, long.down() as u64),
            Self::Fir(f) => (f.down as u64, f.up as u64, f.down as u64),
            Self::Poly(p) if p.order == 0 => {
                let both = common(p.unit.into(), p.step.into()) as u64;
                (p.step / both, p.unit / both, p.step / both)
            }
            Self::Poly(_) => return None,
        })
    }

    /// Outputs that can be computed when inputs before `end` are known.
    pub fn available(&self, end: i64) -> u64 {
        // Outputs at `first + o * step` before `limit`, all in fractions of a frame.
        let end = i128::from(end);
        let (limit, first, step) = match self {
            Self::Long(long) => return long.available(end as i64),
            Self::Fir(f) => (end * f.up as i128, f.centre as i128, f.down as i128),
            Self::Poly(p) => {
                let limit = (end - (p.taps / 2) as i128) * i128::from(p.unit);
                (limit, i128::from(p.first), i128::from(p.step))
            }
        };
        ((limit - first + step - 1) / step).max(0) as u64
    }

    /// Appends outputs `out` (interleaved) computed from `input`, which covers
    /// [`Self::input_range`].
    pub fn run(&self, channels: usize, out: Range<u64>, input: Frames, to: &mut Vec<f32>) {
        match self {
            Self::Fir(f) => f.run(channels, out, input, to),
            Self::Long(long) => long.run(channels, out, input, to),
            Self::Poly(p) => {
                let base = to.len();
                to.resize(base + (out.end - out.start) as usize * channels, 0.0);
                dispatch(Interpolate {
                    poly: p,
                    channels,
                    first: out.start,
                    input,
                    out: &mut to[base..],
                });
            }
        }
    }
}

/// Rational rate change `up / down`: output `q * up + r` is a plain filter
/// of the residue's own.
#[derive(Debug, Clone)]
pub(super) struct Fir {
    up: usize,
    down: usize,
    centre: usize,
    residues: Vec<Residue>,
}

#[derive(Debug, Clone)]
struct Residue {
    len: usize,
    /// Taps that meet frames `m + j * down` of the `len` frames under an output, for `m < down`.
    phases: Vec<Phase>,
}

#[derive(Debug, Clone)]
struct Phase {
    taps: Vec<f32>,
    /// They read the same backwards.
    symmetric: bool,
}

impl Phase {
    fn new(taps: Vec<f32>) -> Self {
        let symmetric = taps.iter().eq(taps.iter().rev());
        Self { taps, symmetric }
    }
}

impl Fir {
    fn new(up: usize, down: usize, taps: &[f64]) -> Self {
        let centre = taps.len() / 2;
        let residues = (0..up)
            .map(|r| {
                let first = (r * down + centre) % up;
                let own: Vec<f32> =
                    taps.iter().skip(first).step_by(up).rev().map(|&t| t as f32).collect();
                let phases = (0..down)
                    .map(|m| Phase::new(own.iter().skip(m).step_by(down).copied().collect()))
                    .collect();
                Residue { len: own.len(), phases }
            })
            .collect();
        Self { up, down, centre, residues }
    }

    fn end(&self, o: u64) -> i64 {
        ((o * self.down as u64 + self.centre as u64) / self.up as u64) as i64 + 1
    }

    fn run(&self, channels: usize, out: Range<u64>, input: Frames, to: &mut Vec<f32>) {
        let count = (out.end - out.start) as usize;
        let base = to.len();
        to.resize(base + count * channels, 0.0);
        let to = &mut to[base..];
        let mut scratch = Vec::new();
        for c in 0..channels {
            // One channel's frames by phase: the samples under one tap lie side by side.
            let planes = self.split(channels, c, input.data);
            for r in 0..self.up.min(count) {
                let first = out.start + r as u64;
                let residue = &self.residues[(first % self.up as u64) as usize];
                let skip = (self.end(first) - residue.len as i64 - input.start) as usize;
                let parts: Vec<Plane> = residue
                    .phases
                    .iter()
                    .enumerate()
                    .map(|(m, Phase { taps, symmetric })| {
                        let at = skip + m;
                        let samples = &planes[at % self.down][at / self.down..];
                        Plane { samples, taps, symmetric: *symmetric }
                    })
                    .collect();
                if channels == 1 && self.up == 1 {
                    dispatch(Correlate { planes: &parts, out: to });
                    continue;
                }
                scratch.resize((count - r).div_ceil(self.up), 0.0);
                dispatch(Correlate { planes: &parts, out: &mut scratch });
                let slots = to.iter_mut().skip(r * channels + c).step_by(self.up * channels);
                for (slot, v) in slots.zip(&scratch) {
                    *slot = *v;
                }
            }
        }
    }

    /// Plane `m` holds frames `m, m + down, ...` of channel `c`.
    fn split<'a>(&self, channels: usize, c: usize, data: &'a [f32]) -> Vec<Cow<'a, [f32]>> {
        if channels == 1 && self.down == 1 {
            return vec![Cow::Borrowed(data)];
        }
        let stride = self.down * channels;
        let plane = |m: usize| {
            let first = m * channels + c;
            let mut plane = vec![0.0; data.len().saturating_sub(first).div_ceil(stride)];
            strided(data, first, stride, &mut plane, |x| x);
            Cow::Owned(plane)
        };
        (0..self.down).map(plane).collect()
    }
}

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
    /// Taps with the zeros behind them that fill blocks.
    width: usize,
    /// `[phase][order + 1][width]`: coefficients of the polynomial in the rest of the position.
    table: Vec<f32>,
}

impl Poly {
    fn new(design: &PolyDesign) -> Self {
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
        // Channel by channel, with zeros behind that meet those of the last taps.
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
