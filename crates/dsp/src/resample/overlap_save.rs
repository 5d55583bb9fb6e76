//! A long symmetric filter by fast transforms of thirty-two blocks at once.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use super::common;
use super::frames::Frames;
use super::poly::Poly;
use crate::lanes::{Change, Convolution, LANES, Row, Slots, gather_part};
use crate::pool::Pool;

/// How much less than the length of a transform samples become, so that no sum is infinite whose
/// result is not: a power of two, so that no bit changes.
const HEADROOM: f32 = 64.0;
/// Fewest taps that are worth transforms, at the rate of the input.
const LEAST_TAPS: usize = 96;
/// Logarithms of the lengths of transforms.
const LENGTHS: Range<u32> = 8..14;
/// Points of a transform whose rows fit the nearest cache but one, and how much more longer ones cost.
const CACHED: usize = 2048;
const BEYOND: f64 = 1.2;

/// A symmetric filter of odd length that may double the rate, then keeps some of its outputs or interpolates
/// between them, by overlap-save.
///
/// Outputs come in blocks that begin at multiples of the length of one. Two neighbouring blocks are the real and
/// the imaginary part of a transform of their own: how the input is cut changes no bits. Machines with
/// and without fused multiply-add may differ in the last bits.
#[derive(Clone)]
pub(super) struct OverlapSave(Arc<Tables>);

struct Tables {
    convolution: Convolution,
    after: After,
    /// Frames of a block before that of its first output.
    before: usize,
    /// Row of a result that its first output is, or begins with.
    from: usize,
    /// Filtered samples before those of a block that its outputs depend on.
    earlier: usize,
    /// Inputs from one block to the next.
    block: usize,
    /// Outputs of a block.
    made: usize,
    /// A power of two that keeps the sums of transforms in range, however large the samples are.
    window: Vec<f32>,
    memory: Pool<Memory>,
}

/// What becomes of the samples that the filter gives.
enum After {
    /// Every so-manieth is kept.
    Kept(usize),
    Interpolated(Poly),
}

#[derive(Default)]
struct Memory {
    circle: Vec<[Row; 2]>,
    made: Vec<[Row; 2]>,
}

impl fmt::Debug for OverlapSave {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OverlapSave").field("block", &self.0.block).finish_non_exhaustive()
    }
}

/// What binds the lengths of blocks.
struct Measure {
    /// Inputs of which a block has a multiple.
    multiple: usize,
    /// Inputs around a block that its outputs depend on.
    around: usize,
}

impl Measure {
    /// The length of transform that takes least for each sample, and the inputs of its blocks.
    fn length_and_block(&self) -> Option<(usize, usize)> {
        let block = |n: usize| n.saturating_sub(self.around) / self.multiple * self.multiple;
        let cost = |(n, block): (usize, usize)| {
            let longer = if n > CACHED { BEYOND } else { 1.0 };
            longer * (n as f64 * (n as f64).log2()) / block as f64
        };
        let lengths = LENGTHS.map(|e| (1 << e, block(1 << e))).filter(|(_, block)| *block > 0);
        lengths.min_by(|a, b| cost(*a).total_cmp(&cost(*b)))
    }
}

impl OverlapSave {
    /// `up` and `down` are the rate's change; two blocks are a multiple of `grain` inputs, where they have so many.
    /// `None` where the filter is too short for transforms, or the rate rises by more than 2.
    pub fn new(taps: &[f64], (up, down): (usize, usize), grain: usize) -> Option<Self> {
        let (change, kept) = match (up, down) {
            (1, down) if down.is_multiple_of(2) => (Change::Half, down / 2),
            (1, down) => (Change::Same, down),
            (2, down) => (Change::Double, down),
            _ => return None,
        };
        Self::followed(taps, change, After::Kept(kept), grain)
    }

    /// [`new`](Self::new) with an interpolator after the filter; `None` also where its places do not repeat.
    pub fn interpolating(
        taps: &[f64],
        rates: (usize, usize),
        poly: Poly,
        grain: usize,
    ) -> Option<Self> {
        let change = match rates {
            (1, 1) => Change::Same,
            (2, 1) => Change::Double,
            _ => return None,
        };
        Self::followed(taps, change, After::Interpolated(poly), grain)
    }

    fn followed(taps: &[f64], change: Change, after: After, grain: usize) -> Option<Self> {
        let rate = change.of(2);
        if 2 * taps.len() < rate.max(2) * LEAST_TAPS || taps.len().is_multiple_of(2) {
            return None;
        }
        // Of the filtered samples: those from one place to the next that is alike, the outputs that they become, and
        // what lies around those of a block.
        let (between, outputs, earlier, later) = match &after {
            After::Kept(kept) => (*kept, 1, 0, 0),
            After::Interpolated(poly) => {
                let (between, outputs) = poly.period()?;
                let reach = poly.input_range(&(0..1));
                (between as usize, outputs as usize, -reach.start as usize, reach.end as usize)
            }
        };
        let times = rate / common(rate as u128, 2 * between as u128) as usize;
        let inputs = 2 * between * times / rate;
        let reach = (taps.len() / 2).div_ceil(rate.div_ceil(2));
        let around = |samples: usize| reach + (2 * samples).div_ceil(rate);
        let (before, behind) = (around(earlier).next_multiple_of(2), around(later));
        let half = grain / common(grain as u128, 2) as usize;
        let coarse = inputs / common(inputs as u128, half as u128) as usize * half;
        let measure = |multiple| Measure { multiple, around: before + behind };
        let measures = [measure(coarse), measure(inputs)];
        let (n, block) = measures.iter().find_map(Measure::length_and_block)?;
        let convolution = Convolution::new(taps, n, change);
        let scale = 1.0 / (convolution.rows() as f32 * HEADROOM);
        Some(Self(Arc::new(Tables {
            after,
            before,
            from: change.of(before) - earlier,
            earlier,
            block,
            made: block / inputs * outputs * times,
            window: vec![scale; n],
            convolution,
            memory: Pool::default(),
        })))
    }

    /// Outputs of two neighbouring blocks.
    fn pair(&self) -> u64 {
        2 * self.0.made as u64
    }

    /// Outputs of each channel that one pass over the lanes makes.
    pub fn pass(&self, channels: usize) -> u64 {
        (LANES / channels).max(1) as u64 * self.pair()
    }

    /// [`Self::pass`] of one channel.
    pub fn span(&self) -> usize {
        self.pass(1) as usize
    }

    /// Inputs from one pair of blocks to the next, and the change of rate as a fraction.
    pub fn repeats(&self) -> (u64, u64, u64) {
        let Tables { block, made, .. } = *self.0;
        let both = common(block as u128, made as u128) as u64;
        (2 * block as u64, made as u64 / both, block as u64 / both)
    }

    /// Input frames that cover the pairs of blocks of outputs `out`.
    pub fn input_range(&self, out: &Range<u64>) -> Range<i64> {
        let pairs = self.pairs(out);
        let first = |pair: u64| pair as i64 * 2 * self.0.block as i64 - self.0.before as i64;
        first(pairs.start)..first(pairs.end - 1) + self.reach() as i64
    }

    /// Inputs that a pair of blocks depends on.
    fn reach(&self) -> usize {
        self.0.block + self.0.window.len()
    }

    /// Outputs whose pairs of blocks are complete when inputs before `end` are known.
    pub fn available(&self, end: i64) -> u64 {
        let past = end + self.0.before as i64 - self.reach() as i64;
        if past < 0 { 0 } else { (past as u64 / (2 * self.0.block as u64) + 1) * self.pair() }
    }

    /// The pairs of blocks of outputs `out`.
    fn pairs(&self, out: &Range<u64>) -> Range<u64> {
        out.start / self.pair()..out.end.div_ceil(self.pair())
    }

    /// Outputs from number `first` on into `to` (interleaved), computed from `input`, which covers
    /// [`Self::input_range`].
    pub fn run(&self, channels: usize, first: u64, input: Frames, to: &mut [f32]) {
        let Tables { convolution, after, from, earlier, block, made, window, memory, .. } =
            &*self.0;
        let out = first..first + (to.len() / channels) as u64;
        let pairs = self.pairs(&out);
        let start = (self.input_range(&out).start - input.start) as usize * channels;
        let signal = &input.data[start..];
        let mut work = memory.take().unwrap_or_default();
        work.circle.resize(convolution.rows(), [Row::ZERO; 2]);
        for slots in Slots::blocks((pairs.end - pairs.start) as usize, channels) {
            let circle = &mut work.circle[..window.len()];
            gather_part(signal, 2 * block, window, slots, circle, 0);
            gather_part(&signal[block * channels..], 2 * block, window, slots, circle, 1);
            convolution.run(&mut work.circle);
            let rows = &mut work.circle[*from..];
            if pairs.start == 0 {
                // The filter gives nothing before its first output.
                let first = (0..slots.len).filter(|s| slots.pair(*s).0 == 0);
                for s in first {
                    rows[..*earlier].iter_mut().for_each(|[_, row]| row.0[s] = 0.0);
                }
            }
            let rows = &*rows;
            let (rows, apart) = match after {
                After::Kept(apart) => (rows, *apart),
                After::Interpolated(poly) => {
                    work.made.resize(*made, [Row::ZERO; 2]);
                    poly.run_rows(rows, &mut work.made);
                    (&work.made[..], 1)
                }
            };
            let whole = Made { rows, apart, count: *made, channels };
            whole.scatter(slots, pairs.start, &out, to);
        }
        memory.give_back(work);
    }
}

/// Outputs of a pass.
struct Made<'a> {
    /// Of both blocks of a pair, the second first; outputs are `apart` rows apart.
    rows: &'a [[Row; 2]],
    apart: usize,
    /// Outputs of a block.
    count: usize,
    channels: usize,
}

impl Made<'_> {
    /// Writes the outputs `out` that are among those of `slots` to their places in `to`; slots begin with pair
    /// `first`.
    fn scatter(&self, slots: Slots, first: u64, out: &Range<u64>, to: &mut [f32]) {
        let Self { rows, apart, count, channels } = *self;
        let mut s = 0;
        while s < slots.len {
            let (pair, channel) = slots.pair(s);
            // Neighbouring channels are neighbours on both sides.
            let run = (channels - channel).min(slots.len - s);
            for (part, second) in [(1, 0), (0, 1)] {
                let block = (2 * (first + pair as u64) + second) * count as u64;
                let (from, end) = (out.start.max(block), out.end.min(block + count as u64));
                if from >= end {
                    continue;
                }
                let kept = rows[(from - block) as usize * apart..].iter().step_by(apart);
                let place = (from - out.start) as usize * channels + channel;
                let places = to[place..].chunks_mut(channels).take((end - from) as usize);
                match run {
                    1 => places.zip(kept).for_each(|(to, row)| to[0] = HEADROOM * row[part].0[s]),
                    _ => places.zip(kept).for_each(|(to, row)| {
                        let values = row[part].0[s..s + run].iter();
                        to.iter_mut().zip(values).for_each(|(slot, x)| *slot = HEADROOM * x);
                    }),
                }
            }
            s += run;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_sums_of_products_for_any_channels_and_range() {
        let taps: Vec<f64> = (0..197)
            .map(|i| (f64::from(i) - 98.0) * 0.8)
            .map(|x| if x == 0.0 { 0.3 } else { 0.3 * x.sin() / x })
            .collect();
        let rates = [(1, 1), (1, 2), (1, 3), (2, 1), (2, 3)];
        for ((up, down), grain) in rates.into_iter().zip([1, 30, 12, 1, 7]) {
            let filter = OverlapSave::new(&taps, (up, down), grain).unwrap();
            assert!(filter.repeats().0.is_multiple_of(grain as u64), "{up} {down} {grain}");
            let x = |frame: i64, channel: usize| {
                let n = (frame.rem_euclid(1 << 20)) as usize * 7 + channel * 13;
                ((n * n) % 199) as f32 / 199.0 - 0.5
            };
            for channels in [1, 2, 3, 8] {
                for out in [0..1, 5..4000, 100..101, 3000..12_000] {
                    let needed = filter.input_range(&out);
                    assert!(filter.available(needed.end) >= out.end);
                    assert!(
                        filter.available(needed.end - 1) < out.end.next_multiple_of(filter.pair())
                    );
                    let start = needed.start - 3;
                    let data: Vec<f32> = (start..needed.end)
                        .flat_map(|frame| (0..channels).map(move |c| x(frame, c)))
                        .collect();
                    let mut got = vec![0.0; (out.end - out.start) as usize * channels];
                    filter.run(channels, out.start, Frames { data: &data, start }, &mut got);
                    let frames = out.clone().zip(got.chunks_exact(channels));
                    for (o, frame) in frames.step_by(7) {
                        for (c, y) in frame.iter().enumerate() {
                            let first = (down as u64 * o) as i64 - 98;
                            let term = |(i, w): (i64, &f64)| {
                                let hit = i.rem_euclid(up as i64) == 0;
                                if hit { w * f64::from(x(i.div_euclid(up as i64), c)) } else { 0.0 }
                            };
                            let want: f64 = (first..).zip(&taps).map(term).sum();
                            assert!((f64::from(*y) - want).abs() < 1e-6, "{o} {c}: {y} for {want}");
                        }
                    }
                }
            }
            for channels in 1..=40 {
                let slots = (filter.pass(channels) / filter.pair()) as usize * channels;
                assert!(slots <= LANES.max(channels), "one pass of {channels} channels");
            }
        }
        assert!(OverlapSave::new(&taps[1..], (1, 2), 1).is_none());
        assert!(OverlapSave::new(&taps[..31], (1, 2), 1).is_none());
        assert!(OverlapSave::new(&taps, (3, 1), 1).is_none());
    }
}
