//! One filter of the chain, ready to run at any output position.

use std::borrow::Cow;
use std::ops::Range;

use super::design::Design;
use super::frames::Frames;
use super::kernel::{Correlate, Plane, SPAN, dispatch};
use super::overlap_save::OverlapSave;
use super::poly::Poly;
use super::strided::strided;

/// A filter with single-precision coefficients. Outputs are numbered from 0 at input sample 0.
#[derive(Debug, Clone)]
pub(super) enum Stage {
    /// Rational rate change.
    Fir(Fir),
    /// A long filter, perhaps with the interpolator after it.
    Long(OverlapSave),
    /// Tabulated interpolator.
    Poly(Poly),
}

impl Stage {
    /// The stages of a chain. Long filters take blocks of a multiple of `grain` frames, where they can.
    pub fn chain(designs: &[Design], grain: usize) -> Vec<Self> {
        let mut stages = Vec::new();
        let mut rest = designs;
        while let [design, after @ ..] = rest {
            rest = after;
            stages.push(match design {
                Design::Poly(design) => Self::Poly(Poly::new(design)),
                Design::Fir { up, down, taps } => {
                    let rates = (*up, *down);
                    let joined = match after {
                        [Design::Poly(design), ..] => {
                            OverlapSave::interpolating(taps, rates, Poly::new(design), grain)
                        }
                        _ => None,
                    };
                    if joined.is_some() {
                        rest = &after[1..];
                    }
                    let long = joined.or_else(|| OverlapSave::new(taps, rates, grain));
                    long.map_or_else(|| Self::Fir(Fir::new(*up, *down, taps)), Self::Long)
                }
            });
        }
        stages
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
            Self::Poly(p) => p.input_range(out),
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
        match self {
            Self::Long(long) => Some(long.repeats()),
            Self::Fir(f) => Some((f.down as u64, f.up as u64, f.down as u64)),
            Self::Poly(p) => p.period().map(|(inputs, outputs)| (inputs, outputs, inputs)),
        }
    }

    /// Outputs that can be computed when inputs before `end` are known.
    pub fn available(&self, end: i64) -> u64 {
        match self {
            Self::Long(long) => long.available(end),
            Self::Poly(p) => p.available(end),
            Self::Fir(f) => {
                // Outputs at `centre + o * down` before `end * up`, all in fractions of a frame.
                let limit = i128::from(end) * f.up as i128 - f.centre as i128;
                ((limit + f.down as i128 - 1) / f.down as i128).max(0) as u64
            }
        }
    }

    /// Outputs from number `first` on into `to` (interleaved), computed from `input`, which covers
    /// [`Self::input_range`].
    pub fn run(&self, channels: usize, first: u64, input: Frames, to: &mut [f32]) {
        match self {
            Self::Fir(f) => f.run(channels, first, input, to),
            Self::Long(long) => long.run(channels, first, input, to),
            Self::Poly(p) => p.run(channels, first, input, to),
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

    fn run(&self, channels: usize, start: u64, input: Frames, to: &mut [f32]) {
        let count = to.len() / channels;
        let mut scratch = Vec::new();
        for c in 0..channels {
            // One channel's frames by phase: the samples under one tap lie side by side.
            let planes = self.split(channels, c, input.data);
            for r in 0..self.up.min(count) {
                let first = start + r as u64;
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
