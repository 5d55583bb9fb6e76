//! A long symmetric filter by fast transforms of sixteen blocks at once, at the rate or half of it.

use std::fmt;
use std::ops::Range;
use std::sync::Arc;

use realfft::RealFftPlanner;

use super::stage::Frames;
use crate::lanes::{LANES, LaneFft, Row, Slots, gather};
use crate::pool::Pool;
use crate::simd::vectorized;

/// How much less than the length of a transform samples become, so that no sum is infinite whose
/// result is not: a power of two, so that no bit changes.
const HEADROOM: f32 = 64.0;
/// Fewest taps that are worth transforms.
const LEAST_TAPS: usize = 96;

/// A symmetric filter of odd length that keeps every output or every second, by overlap-save.
///
/// Outputs come in blocks that begin at multiples of the length of one, each from a transform of its
/// own: how the input is cut changes no bits. Machines with and without fused multiply-add may differ
/// in the last bits.
#[derive(Clone)]
pub(super) struct OverlapSave(Arc<Tables>);

struct Tables {
    /// 1, or 2 where every second output is kept.
    down: usize,
    /// Frames of a block before that of its first output: the reach of the filter, or one more.
    before: usize,
    /// Outputs of a block.
    block: usize,
    forward: LaneFft,
    /// Back to time, of as many points for each output that is kept.
    back: LaneFft,
    /// The real response of each bin, over the lengths of both transforms.
    response: Vec<f32>,
    /// A power of two that keeps the sums of transforms in range, however large the samples are.
    window: Vec<f32>,
    memory: Pool<Memory>,
}

#[derive(Default)]
struct Memory {
    frames: Vec<Row>,
    spectrum: Vec<Row>,
}

impl fmt::Debug for OverlapSave {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OverlapSave").field("block", &self.0.block).finish_non_exhaustive()
    }
}

impl OverlapSave {
    /// `down` is 1 or 2; blocks are a multiple of `grain` inputs, where one has so many. `None` where the
    /// filter is too short for transforms.
    pub fn new(taps: &[f64], down: usize, grain: usize) -> Option<Self> {
        if taps.len() < LEAST_TAPS || taps.len().is_multiple_of(2) || !(1..=2).contains(&down) {
            return None;
        }
        let reach = taps.len() / 2;
        let before = reach.next_multiple_of(2);
        let n = (4 * taps.len()).next_power_of_two();
        // The filter around sample 0 of a circle: its transform is real.
        let mut circle = vec![0.0; n];
        for (i, tap) in taps.iter().enumerate() {
            circle[(n + i - reach) % n] = *tap;
        }
        let fft = RealFftPlanner::<f64>::new().plan_fft_forward(n);
        let mut bins = fft.make_output_vec();
        fft.process(&mut circle, &mut bins).ok()?;
        let block = (n - 1 - before - reach) / down + 1;
        let grain = if grain.is_multiple_of(down) { grain / down } else { grain };
        let block = if grain <= block { block / grain * grain } else { block };
        Some(Self(Arc::new(Tables {
            down,
            before,
            block,
            forward: LaneFft::new(n).ok()?,
            back: LaneFft::new(n / down).ok()?,
            response: bins.iter().map(|bin| bin.re as f32).collect(),
            window: vec![1.0 / (n as f32 * HEADROOM); n],
            memory: Pool::default(),
        })))
    }

    /// Outputs of each channel that one pass over the lanes makes.
    pub fn pass(&self, channels: usize) -> u64 {
        ((LANES / channels).max(1) * self.0.block) as u64
    }

    /// [`Self::pass`] of one channel.
    pub fn span(&self) -> usize {
        LANES * self.0.block
    }

    /// Inputs from one block to the next.
    pub fn step(&self) -> usize {
        self.0.down * self.0.block
    }

    /// Outputs for one of which there are so many inputs.
    pub fn down(&self) -> usize {
        self.0.down
    }

    /// Input frames that cover the blocks of outputs `out`.
    pub fn input_range(&self, out: &Range<u64>) -> Range<i64> {
        let blocks = self.blocks(out);
        let (first, last) = (blocks.start as i64, blocks.end as i64 - 1);
        let start = |block: i64| block * self.step() as i64 - self.0.before as i64;
        start(first)..start(last) + self.0.forward.n_fft() as i64
    }

    /// Outputs whose blocks are complete when inputs before `end` are known.
    pub fn available(&self, end: i64) -> u64 {
        let past = end + self.0.before as i64 - self.0.forward.n_fft() as i64;
        let step = self.step() as i64;
        if past < 0 { 0 } else { (past / step + 1) as u64 * self.0.block as u64 }
    }

    /// The blocks of outputs `out`.
    fn blocks(&self, out: &Range<u64>) -> Range<u64> {
        let block = self.0.block as u64;
        out.start / block..out.end.div_ceil(block)
    }

    /// Appends outputs `out` (interleaved) computed from `input`, which covers
    /// [`Self::input_range`].
    pub fn run(&self, channels: usize, out: Range<u64>, input: Frames, to: &mut Vec<f32>) {
        let Tables { block, window, .. } = &*self.0;
        let blocks = self.blocks(&out);
        let base = to.len();
        to.resize(base + (out.end - out.start) as usize * channels, 0.0);
        let to = &mut to[base..];
        let from = (self.input_range(&out).start - input.start) as usize * channels;
        let signal = &input.data[from..];
        let mut memory = self.0.memory.take();
        memory.frames.resize(window.len(), Row::ZERO);
        memory.spectrum.resize(window.len() + 2, Row::ZERO);
        for slots in Slots::blocks((blocks.end - blocks.start) as usize, channels) {
            gather(signal, self.step(), window, slots, &mut memory.frames);
            self.filter(&mut memory);
            for s in 0..slots.len {
                let (at, channel) = slots.pair(s);
                let first = (blocks.start + at as u64) * *block as u64;
                let skipped = out.start.saturating_sub(first) as usize;
                let kept = (out.end - first).min(*block as u64) as usize;
                let place = (first + skipped as u64 - out.start) as usize * channels + channel;
                let rows = &memory.frames[skipped..kept];
                if channels == 1 {
                    to[place..].iter_mut().zip(rows).for_each(|(slot, row)| *slot = row.0[s]);
                    continue;
                }
                let places = to[place..].chunks_mut(channels);
                places.zip(rows).for_each(|(frame, row)| frame[0] = row.0[s]);
            }
        }
        self.0.memory.give_back(memory);
    }

    /// Blocks of samples to blocks of outputs, at the start of `frames`.
    fn filter(&self, Memory { frames, spectrum }: &mut Memory) {
        let Tables { down, before, block, forward, back, response, .. } = &*self.0;
        let n = back.n_fft();
        forward.complex(frames, spectrum);
        let bins = spectrum.as_chunks::<2>().0;
        vectorized(
            #[inline(always)]
            || {
                // The spectrum of a real signal becomes a real sequence, whose transform is that signal,
                // mirrored halves added and subtracted (Hartley's transform). Where every second
                // output is kept, bins above half of those that remain fold down onto them.
                for k in 0..=n / 2 {
                    let mirrored = n - k;
                    let (w, [re, im]) = (response[k], &bins[k]);
                    let (mut sum, mut difference) = (Row::ZERO, Row::ZERO);
                    if *down == 1 {
                        for s in 0..LANES {
                            difference.0[s] = w * re.0[s] - w * im.0[s];
                            sum.0[s] = w * re.0[s] + w * im.0[s];
                        }
                    } else {
                        let (v, [high_re, high_im]) = (response[mirrored], &bins[mirrored]);
                        for s in 0..LANES {
                            let real = w * re.0[s] + v * high_re.0[s];
                            let imaginary = w * im.0[s] - v * high_im.0[s];
                            difference.0[s] = real - imaginary;
                            sum.0[s] = real + imaginary;
                        }
                    }
                    frames[k] = difference;
                    if k > 0 {
                        frames[mirrored] = sum;
                    }
                }
            },
        );
        let spectrum = &mut spectrum[..n + 2];
        back.complex(&mut frames[..n], spectrum);
        let bins = spectrum.as_chunks::<2>().0;
        vectorized(
            #[inline(always)]
            || {
                for (at, row) in (before / down..).zip(&mut frames[..*block]) {
                    let (bin, sign) = if at <= n / 2 { (at, -1.0) } else { (n - at, 1.0) };
                    let [re, im] = &bins[bin];
                    for s in 0..LANES {
                        row.0[s] = HEADROOM * (re.0[s] + sign * im.0[s]);
                    }
                }
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outputs_are_sums_of_products_for_any_channels_and_range() {
        let taps: Vec<f64> = (0..97)
            .map(|i| (f64::from(i) - 48.0) * 0.8)
            .map(|x| if x == 0.0 { 0.3 } else { 0.3 * x.sin() / x })
            .collect();
        for (down, grain) in [(1, 1), (1, 30), (2, 1), (2, 12)] {
            let filter = OverlapSave::new(&taps, down, grain).unwrap();
            assert!(filter.step().is_multiple_of(grain), "{down} {grain}");
            let x = |frame: i64, channel: usize| {
                let n = (frame.rem_euclid(1 << 20)) as usize * 7 + channel * 13;
                ((n * n) % 199) as f32 / 199.0 - 0.5
            };
            for channels in [1, 2, 3, 8] {
                for out in [0..1, 5..4000, 100..101, 3000..12_000] {
                    let needed = filter.input_range(&out);
                    assert!(filter.available(needed.end) >= out.end);
                    assert!(
                        filter.available(needed.end - 1)
                            < out.end.next_multiple_of(filter.0.block as u64)
                    );
                    let start = needed.start - 3;
                    let data: Vec<f32> = (start..needed.end)
                        .flat_map(|frame| (0..channels).map(move |c| x(frame, c)))
                        .collect();
                    let mut got = Vec::new();
                    filter.run(channels, out.clone(), Frames { data: &data, start }, &mut got);
                    assert_eq!(got.len(), (out.end - out.start) as usize * channels);
                    let frames = out.clone().zip(got.chunks_exact(channels));
                    for (o, frame) in frames.step_by(7) {
                        for (c, y) in frame.iter().enumerate() {
                            let first = down as i64 * o as i64 - 48;
                            let want: f64 =
                                (first..).zip(&taps).map(|(i, w)| w * f64::from(x(i, c))).sum();
                            assert!((f64::from(*y) - want).abs() < 1e-6, "{o} {c}: {y} for {want}");
                        }
                    }
                }
            }
        }
        let filter = OverlapSave::new(&taps, 2, 1).unwrap();
        for channels in 1..=40 {
            let slots = filter.pass(channels) as usize / filter.0.block * channels;
            assert!(slots <= LANES.max(channels), "one pass of {channels} channels");
        }
        assert!(OverlapSave::new(&taps[1..], 2, 1).is_none());
        assert!(OverlapSave::new(&taps[..31], 2, 1).is_none());
    }
}
