//! Windowed frames of an interleaved signal into rows.

use pulp::bytemuck::cast;
use pulp::{Arch, Simd, WithSimd};

use super::{DoubleRow, LANES, Lanes, Row};
use crate::real::Real;
use crate::simd::vectorized;

/// Which (frame, channel) each lane of a block stands for: slot `s` is the `first + s`-th pair in
/// the order frame by frame, channel by channel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Slots {
    /// Index of the first pair, `frame * channels + channel`.
    pub first: usize,
    /// Pairs in use, at most [`LANES`].
    pub len: usize,
    /// Channels of the signal.
    pub channels: usize,
}

impl Slots {
    /// The blocks that cover `frames` frames of `channels` channels.
    pub fn blocks(frames: usize, channels: usize) -> impl Iterator<Item = Slots> {
        let total = frames * channels;
        (0..total).step_by(LANES).map(move |first| Slots {
            first,
            len: LANES.min(total - first),
            channels,
        })
    }

    /// Whether the block is full and starts with channel 0.
    pub fn aligned(&self) -> bool {
        self.len == LANES && self.first.is_multiple_of(self.channels)
    }

    /// Frame and channel of slot `s`.
    #[inline(always)]
    pub fn pair(&self, s: usize) -> (usize, usize) {
        ((self.first + s) / self.channels, (self.first + s) % self.channels)
    }
}

/// Writes `window[n] * signal[frame * hop + n]` of every slot into `rows[n]`; unused slots are zero.
///
/// `signal` is interleaved and starts at the first sample of frame 0.
pub fn gather(signal: &[f32], hop: usize, window: &[f32], slots: Slots, rows: &mut [Row]) {
    gather_part(signal, hop, window, slots, rows.as_chunks_mut::<1>().0, 0);
}

/// [`gather`] into row `part` of every group.
pub(crate) fn gather_part<const PARTS: usize>(
    signal: &[f32],
    hop: usize,
    window: &[f32],
    slots: Slots,
    rows: &mut [[Row; PARTS]],
    part: usize,
) {
    debug_assert_eq!(window.len(), rows.len());
    if slots.channels == 1 {
        return Arch::new().dispatch(Mono { signal, hop, window, slots, rows, part });
    }
    let (aligned, rows) = (slots.aligned(), Parts { rows, part });
    vectorized(
        #[inline(always)]
        || match slots.channels {
            2 if aligned => groups::<2, 8, PARTS>(signal, hop, window, slots, rows),
            4 if aligned => groups::<4, 4, PARTS>(signal, hop, window, slots, rows),
            8 if aligned => groups::<8, 2, PARTS>(signal, hop, window, slots, rows),
            16 if aligned => groups::<16, 1, PARTS>(signal, hop, window, slots, rows),
            _ => strided(signal, hop, window, slots, rows),
        },
    );
}

/// [`Lanes::gather`] into single-precision rows.
pub(super) fn channel<T: Real>(signal: &[T], hop: usize, window: &[f32], rows: &mut [Row]) {
    let slots = Slots { first: 0, len: LANES, channels: 1 };
    match T::as_f32(signal) {
        Some(signal) => gather(signal, hop, window, slots, rows),
        None => {
            let signal: Vec<f32> = signal.iter().map(|x| x.wide() as f32).collect();
            gather(&signal, hop, window, slots, rows);
        }
    }
}

/// [`Lanes::gather`] into double-precision rows.
pub(super) fn turned<T: Real>(signal: &[T], hop: usize, window: &[f64], rows: &mut [DoubleRow]) {
    debug_assert_eq!(window.len(), rows.len());
    Arch::new().dispatch(Turned { signal, hop, window, rows });
}

/// [`gather`] in double precision: slot `s` of a row is the `first + s`-th pair of frame and channel. Every
/// slot has a frame.
pub(crate) fn gather_double(
    signal: &[f64],
    hop: usize,
    window: &[f64],
    (first, channels): (usize, usize),
    rows: &mut [DoubleRow],
) {
    const SLOTS: usize = DoubleRow::SLOTS;
    match channels {
        1 => turned(&signal[first * hop..], hop, window, rows),
        SLOTS => {
            let frame = signal[first * hop..].as_chunks::<SLOTS>().0;
            vectorized(
                #[inline(always)]
                || {
                    for ((row, w), frame) in rows.iter_mut().zip(window).zip(frame) {
                        for (slot, x) in row.0.iter_mut().zip(frame) {
                            *slot = w * x;
                        }
                    }
                },
            );
        }
        _ => {
            for s in 0..SLOTS {
                let (frame, channel) = ((first + s) / channels, (first + s) % channels);
                let samples = signal[frame * hop * channels + channel..].iter().step_by(channels);
                for ((row, w), x) in rows.iter_mut().zip(window).zip(samples) {
                    row.0[s] = w * x;
                }
            }
        }
    }
}

/// Eight frames of one channel.
struct Turned<'a, T> {
    signal: &'a [T],
    hop: usize,
    window: &'a [f64],
    rows: &'a mut [DoubleRow],
}

/// Samples of a frame that are read together, in double precision.
const PAIR: usize = 2;

impl<T: Real> WithSimd for Turned<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        const SLOTS: usize = DoubleRow::SLOTS;
        let Self { signal, hop, window, rows } = self;
        let wide = S::F64_LANES.is_multiple_of(PAIR);
        let whole = if wide { rows.len() / PAIR * PAIR } else { 0 };
        let (pairs, rest) = rows.split_at_mut(whole);
        let frames = |f: usize| &signal[f * hop..][..window.len()];
        // Slot `PAIR * g + j` is in group `g` of the register that frame set `j` fills.
        let sets: [[&[[T; PAIR]]; SLOTS / PAIR]; PAIR] = std::array::from_fn(|j| {
            std::array::from_fn(|g| &frames(PAIR * g + j).as_chunks::<PAIR>().0[..whole / PAIR])
        });
        let pairs = pairs.as_chunks_mut::<PAIR>().0.iter_mut();
        for (n, (rows, w)) in pairs.zip(window.as_chunks::<PAIR>().0).enumerate() {
            for v in 0..DoubleRow::registers::<S>() {
                // Transposes the square that each group of the two registers makes.
                let x = [pair::<S, T>(&sets[0], v, n), pair::<S, T>(&sets[1], v, n)];
                let x = simd.deinterleave_shfl_f64s(x);
                for (row, (x, w)) in rows.iter_mut().zip(x.into_iter().zip(w)) {
                    row.store::<S>(v, simd.mul_f64s(x, simd.splat_f64s(*w)));
                }
            }
        }
        for (n, row) in rest.iter_mut().enumerate() {
            let n = whole + n;
            for (s, slot) in row.0.iter_mut().enumerate() {
                *slot = window[n] * frames(s)[n].wide();
            }
        }
    }
}

/// `FRAMES` whole frames of `CHANNELS` channels fill the lanes.
#[inline(always)]
fn groups<const CHANNELS: usize, const FRAMES: usize, const PARTS: usize>(
    signal: &[f32],
    hop: usize,
    window: &[f32],
    slots: Slots,
    rows: Parts<PARTS>,
) {
    let frames = Aligned::<CHANNELS, FRAMES>::new(signal, hop, window.len(), slots).0;
    let Parts { rows, part } = rows;
    for (n, (rows, w)) in rows.iter_mut().zip(window).enumerate() {
        let row = &mut rows[part];
        for (group, frame) in row.0.as_chunks_mut::<CHANNELS>().0.iter_mut().zip(&frames) {
            for (slot, x) in group.iter_mut().zip(&frame[n]) {
                *slot = x * w;
            }
        }
    }
}

/// The rows `part` of groups.
struct Parts<'a, const PARTS: usize> {
    rows: &'a mut [[Row; PARTS]],
    part: usize,
}

/// Frames of one channel, up to sixteen.
struct Mono<'a, const PARTS: usize> {
    signal: &'a [f32],
    hop: usize,
    window: &'a [f32],
    slots: Slots,
    rows: &'a mut [[Row; PARTS]],
    part: usize,
}

/// Samples of a frame that are read together: a quarter of the widest register.
const QUAD: usize = 4;

impl<const PARTS: usize> WithSimd for Mono<'_, PARTS> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { signal, hop, window, slots, rows, part } = self;
        let wide = S::F32_LANES.is_multiple_of(QUAD);
        let whole = if wide { rows.len() / QUAD * QUAD } else { 0 };
        let (quads, rest) = rows.split_at_mut(whole);
        let silence = vec![0.0; if slots.len < LANES { window.len() } else { 0 }];
        let frames = |f: usize| match f < slots.len {
            true => &signal[(slots.first + f) * hop..][..window.len()],
            false => &silence[..],
        };
        // Slot `QUAD * g + j` is in group `g` of the register that frame set `j` fills.
        let sets: [[&[[f32; QUAD]]; LANES / QUAD]; QUAD] = std::array::from_fn(|j| {
            std::array::from_fn(|g| &frames(QUAD * g + j).as_chunks::<QUAD>().0[..whole / QUAD])
        });
        let quads = quads.as_chunks_mut::<QUAD>().0.iter_mut();
        for (n, (rows, w)) in quads.zip(window.as_chunks::<QUAD>().0).enumerate() {
            for v in 0..Row::registers::<S>() {
                // Transposes the square that each group of the four registers makes.
                let [a, b, c, d] = &sets;
                let x = [
                    quad::<S>(a, v, n),
                    quad::<S>(b, v, n),
                    quad::<S>(c, v, n),
                    quad::<S>(d, v, n),
                ];
                let x = simd.deinterleave_shfl_f32s(x);
                for (group, (x, w)) in rows.iter_mut().zip(x.into_iter().zip(w)) {
                    group[part].store::<S>(v, simd.mul_f32s(x, simd.splat_f32s(*w)));
                }
            }
        }
        for (n, group) in rest.iter_mut().enumerate() {
            let n = whole + n;
            group[part].0 = std::array::from_fn(|f| frames(f)[n] * window[n]);
        }
    }
}

/// Quad `n` of each frame whose slot is in register `v`: joined in registers, as memory would wait for the parts.
#[inline(always)]
fn quad<S: Simd>(set: &[&[[f32; QUAD]]; LANES / QUAD], v: usize, n: usize) -> S::f32s {
    match S::F32_LANES / QUAD {
        4 => cast([set[0][n], set[1][n], set[2][n], set[3][n]]),
        2 => cast([set[2 * v][n], set[2 * v + 1][n]]),
        _ => cast(set[v][n]),
    }
}

/// [`quad`] of pairs in double precision.
#[inline(always)]
fn pair<S: Simd, T: Real>(
    set: &[&[[T; PAIR]]; DoubleRow::SLOTS / PAIR],
    v: usize,
    n: usize,
) -> S::f64s {
    let wide = |g: usize| [set[g][n][0].wide(), set[g][n][1].wide()];
    match S::F64_LANES / PAIR {
        4 => cast([wide(0), wide(1), wide(2), wide(3)]),
        2 => cast([wide(2 * v), wide(2 * v + 1)]),
        _ => cast(wide(v)),
    }
}

/// Rows of samples, read where they lie.
pub trait Frames<R> {
    /// Sample `n` of every slot's frame, without a window.
    fn row(&self, n: usize) -> R;
}

impl<R: Copy> Frames<R> for &[R] {
    #[inline(always)]
    fn row(&self, n: usize) -> R {
        self[n]
    }
}

/// `FRAMES` whole frames of `CHANNELS` channels of an interleaved signal, which fill the lanes.
pub struct Aligned<'a, const CHANNELS: usize, const FRAMES: usize>([&'a [[f32; CHANNELS]]; FRAMES]);

impl<'a, const CHANNELS: usize, const FRAMES: usize> Aligned<'a, CHANNELS, FRAMES> {
    /// The frames of `length` samples of a full block of slots that starts with channel 0.
    pub fn new(signal: &'a [f32], hop: usize, length: usize, slots: Slots) -> Self {
        let first = slots.first / CHANNELS;
        Self(std::array::from_fn(|f| {
            let start = (first + f) * hop * CHANNELS;
            signal[start..start + length * CHANNELS].as_chunks::<CHANNELS>().0
        }))
    }
}

impl<const CHANNELS: usize, const FRAMES: usize> Frames<Row> for Aligned<'_, CHANNELS, FRAMES> {
    #[inline(always)]
    fn row(&self, n: usize) -> Row {
        let mut row = Row::ZERO;
        for (group, frame) in row.0.as_chunks_mut::<CHANNELS>().0.iter_mut().zip(&self.0) {
            group.copy_from_slice(&frame[n]);
        }
        row
    }
}

/// Any number of channels, and blocks that are not full: runs of neighbouring channels of a frame.
#[inline(always)]
fn strided<const PARTS: usize>(
    signal: &[f32],
    hop: usize,
    window: &[f32],
    slots: Slots,
    Parts { rows, part }: Parts<PARTS>,
) {
    rows.iter_mut().for_each(|group| group[part] = Row::ZERO);
    let channels = slots.channels;
    let mut s = 0;
    while s < slots.len {
        let (frame, channel) = slots.pair(s);
        let run = (channels - channel).min(slots.len - s);
        let samples = signal[frame * hop * channels + channel..].chunks(channels);
        for ((group, w), x) in rows.iter_mut().zip(window).zip(samples) {
            for (slot, x) in group[part].0[s..s + run].iter_mut().zip(x) {
                *slot = x * w;
            }
        }
        s += run;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_layout_puts_the_same_samples_into_its_slots() {
        let cases = [1, 2, 3, 4, 5, 8, 16, 20].into_iter().flat_map(|c| [(c, 32), (c, 35)]);
        for (channels, length) in cases {
            let window: Vec<f32> = (0..length).map(|i| 1.0 + i as f32).collect();
            let signal: Vec<f32> = (0..channels * (length + 40 * 8)).map(|i| i as f32).collect();
            for slots in Slots::blocks(37, channels) {
                let mut rows = vec![Row([f32::NAN; LANES]); length];
                gather(&signal, 8, &window, slots, &mut rows);
                for s in 0..LANES {
                    let (frame, channel) = slots.pair(s);
                    for (n, row) in rows.iter().enumerate() {
                        let x = signal.get((frame * 8 + n) * channels + channel);
                        let want = if s < slots.len { x.unwrap() * window[n] } else { 0.0 };
                        assert_eq!(row.0[s], want);
                    }
                }
            }
        }
    }
}
