//! Frames of one span of the signal, as samples arrive.

use std::ops::Range;

use corsmal_dsp::lanes::{LANES, Row, Slots, gather, square_roots};
use corsmal_dsp::transform::Forward;

use super::plan::{Framing, Plan, Scratch, StreamKind};
use crate::features::{Kernel, Quantity};

/// The samples in memory: interleaved, those from `first` on.
pub struct Window<'a> {
    /// Interleaved samples.
    pub samples: &'a [f32],
    /// Absolute index of the first sample.
    pub first: u64,
    /// Length of the signal, once it is known.
    pub total: Option<u64>,
}

/// Position of one stream in its span.
pub struct Cursor {
    /// Next frame to compute.
    pub next: u64,
    /// First frame of the next span.
    pub end: u64,
}

impl Cursor {
    /// Frames anchored (`t * hop`) in the sample positions `[start, end)`.
    pub fn new(framing: &Framing, span: &Range<u64>) -> Self {
        let hop = framing.hop as u64;
        Self { next: span.start.div_ceil(hop), end: span.end.div_ceil(hop) }
    }

    /// First sample that is still needed.
    pub fn keep_from(&self, framing: &Framing) -> u64 {
        // Padding by reflection reaches back `pad` samples from the end.
        (self.next * framing.hop as u64).saturating_sub(2 * framing.pad as u64 + 1)
    }

    /// Computes every frame that the window completes; all that remain once the total is known.
    /// Values are appended to `raw[feature]` as `[frames][rows][channels]`.
    pub fn advance(
        &mut self,
        plan: &Plan,
        stream: usize,
        window: &Window,
        raw: &mut [Vec<f32>],
        scratch: &mut Scratch,
    ) {
        let framing = plan.streams[stream].framing;
        let available = window.first + (window.samples.len() / plan.channels) as u64;
        let end = match window.total {
            Some(n) => self.end.min(framing.n_frames(n)),
            None => {
                // Frame t is complete with sample t * hop - pad + length - 1.
                let past = (available + framing.pad as u64).checked_sub(framing.length as u64);
                let complete = past.map_or(0, |p| p / framing.hop as u64 + 1);
                let mut end = self.end.min(complete);
                if end < self.end {
                    // Whole blocks only.
                    let group = (LANES / gcd(LANES, plan.channels)) as u64;
                    end = self.next + end.saturating_sub(self.next) / group * group;
                }
                // The padding before frame 0 may need 2 pad samples.
                if self.next == 0 && available < 2 * framing.pad as u64 + 1 {
                    end = 0;
                }
                end
            }
        };
        while self.next < end {
            let inside = |t: u64| {
                let start = t * framing.hop as u64;
                start >= framing.pad as u64
                    && start - framing.pad as u64 + framing.length as u64 <= available
            };
            let first = self.next;
            let direct = inside(first);
            let mut last = first + 1;
            while last < end && inside(last) == direct {
                last += 1;
            }
            let frames = (last - first) as usize;
            let start = (first * framing.hop as u64) as i64 - framing.pad as i64;
            if direct {
                let offset = (start as u64 - window.first) as usize * plan.channels;
                run(plan, stream, &window.samples[offset..], frames, raw, scratch);
            } else {
                let mut edge = std::mem::take(&mut scratch.edge);
                let length = (frames - 1) * framing.hop + framing.length;
                padded(window, &framing, plan.channels, start, length, &mut edge);
                run(plan, stream, &edge, frames, raw, scratch);
                scratch.edge = edge;
            }
            self.next = last;
        }
    }
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// `length` samples from `start` on, with padding where they lie outside the signal.
fn padded(
    window: &Window,
    framing: &Framing,
    channels: usize,
    start: i64,
    length: usize,
    out: &mut Vec<f32>,
) {
    let available = window.first + (window.samples.len() / channels) as u64;
    let n = window.total.unwrap_or(available) as usize;
    out.clear();
    for i in start..start + length as i64 {
        match framing.mode.index(i as isize, n) {
            None => out.resize(out.len() + channels, 0.0),
            Some(i) => {
                let at = (i as u64 - window.first) as usize * channels;
                out.extend_from_slice(&window.samples[at..at + channels]);
            }
        }
    }
}

/// Computes `frames` frames whose first sample is the first of `samples`.
fn run(
    plan: &Plan,
    stream: usize,
    samples: &[f32],
    frames: usize,
    raw: &mut [Vec<f32>],
    scratch: &mut Scratch,
) {
    let stream = &plan.streams[stream];
    match &stream.kind {
        StreamKind::Exact { forward, members, .. } => {
            exact(plan, forward, members, samples, frames, raw);
        }
        StreamKind::Wave { member } => {
            if let Kernel::Wave(_, _, kernel) = &plan.features[*member].feature.kernel {
                kernel.frames(samples, plan.channels, frames, &mut raw[*member]);
            }
        }
        StreamKind::Spectrum { params, spectrum, window, members } => {
            let bins = spectrum.n_bins();
            scratch.frames.resize(params.n_fft, Row::ZERO);
            scratch.spectrum.resize(2 * bins, Row::ZERO);
            let starts: Vec<usize> = members
                .iter()
                .map(|(m, _)| {
                    let start = raw[*m].len();
                    let width = plan.features[*m].feature.raw_rows * plan.channels;
                    raw[*m].resize(start + frames * width, 0.0);
                    start
                })
                .collect();
            for slots in Slots::blocks(frames, plan.channels) {
                let mut current = None;
                for ((m, quantity), start) in members.iter().zip(&starts) {
                    if current != Some(*quantity) {
                        let (time, out) = (&mut scratch.frames, &mut scratch.spectrum);
                        let hop = params.hop_length;
                        if *quantity == Quantity::Complex {
                            gather(samples, hop, window, slots, time);
                            spectrum.complex(time, out);
                        } else if current != Some(Quantity::Power) {
                            spectrum.power_of(samples, hop, window, slots, time, &mut out[..bins]);
                        }
                        if *quantity == Quantity::Magnitude {
                            square_roots(&mut out[..bins]);
                        }
                        current = Some(*quantity);
                    }
                    let feature = &plan.features[*m].feature;
                    if let Kernel::Spectrum(_, _, kernel) = &feature.kernel {
                        scratch.rows.resize(feature.raw_rows, Row::ZERO);
                        let read = match quantity {
                            Quantity::Complex => &scratch.spectrum[..],
                            _ => &scratch.spectrum[..bins],
                        };
                        kernel.rows(read, &mut scratch.rows);
                        let out = &mut raw[*m][*start..];
                        if feature.complex {
                            scatter_complex(&scratch.rows, slots, out);
                        } else {
                            scatter(&scratch.rows, slots, out);
                        }
                    }
                }
            }
        }
    }
}

/// Computes features of exact magnitudes, one (frame, channel) after the other.
fn exact(
    plan: &Plan,
    forward: &Forward<f64>,
    members: &[usize],
    samples: &[f32],
    frames: usize,
    raw: &mut [Vec<f32>],
) {
    let (params, channels) = (forward.params(), plan.channels);
    let mut transform = forward.scratch();
    let mut signal = vec![0.0_f32; params.n_fft];
    let mut magnitude = vec![0.0_f32; params.n_bins()];
    let mut workers = Vec::with_capacity(members.len());
    for m in members {
        let feature = &plan.features[*m].feature;
        let Kernel::Exact(_, kernel) = &feature.kernel else { continue };
        let (start, rows) = (raw[*m].len(), feature.raw_rows);
        raw[*m].resize(start + frames * rows * channels, 0.0);
        workers.push((*m, start, kernel.worker(), vec![0.0_f64; rows]));
    }
    for t in 0..frames {
        let frame = &samples[t * params.hop_length * channels..];
        for c in 0..channels {
            let source = frame[c..].iter().step_by(channels);
            signal.iter_mut().zip(source).for_each(|(slot, x)| *slot = *x);
            let spectrum = forward.spectrum(&signal, 0, &mut transform);
            for (slot, z) in magnitude.iter_mut().zip(spectrum) {
                *slot = (z.re as f32).hypot(z.im as f32);
            }
            for (m, start, worker, values) in &mut workers {
                worker(&magnitude, values);
                let at = *start + t * values.len() * channels + c;
                let out = raw[*m][at..].iter_mut().step_by(channels);
                out.zip(&*values).for_each(|(slot, v)| *slot = *v as f32);
            }
        }
    }
}

/// Rows of a block to `[frames][rows][channels]`.
fn scatter(rows: &[Row], slots: Slots, out: &mut [f32]) {
    let (channels, n_rows) = (slots.channels, rows.len());
    if channels == 8 && slots.len == LANES && slots.first.is_multiple_of(8) {
        let frame = slots.first / 8;
        let (a, b) = out[frame * n_rows * 8..(frame + 2) * n_rows * 8].split_at_mut(n_rows * 8);
        let pairs = a.as_chunks_mut::<8>().0.iter_mut().zip(b.as_chunks_mut::<8>().0);
        for (row, (a, b)) in rows.iter().zip(pairs) {
            a.copy_from_slice(&row.0[..8]);
            b.copy_from_slice(&row.0[8..]);
        }
        return;
    }
    for s in 0..slots.len {
        let (frame, channel) = slots.pair(s);
        let out = &mut out[frame * n_rows * channels..(frame + 1) * n_rows * channels];
        for (row, out) in rows.iter().zip(out[channel..].iter_mut().step_by(channels)) {
            *out = row.0[s];
        }
    }
}

/// Pairs of rows (real, imaginary) to `[frames][rows / 2][channels][2]`.
fn scatter_complex(rows: &[Row], slots: Slots, out: &mut [f32]) {
    let (channels, bins) = (slots.channels, rows.len() / 2);
    let width = bins * channels * 2;
    for s in 0..slots.len {
        let (frame, channel) = slots.pair(s);
        let out = &mut out[frame * width..(frame + 1) * width];
        for (k, pair) in rows.as_chunks::<2>().0.iter().enumerate() {
            let at = (k * channels + channel) * 2;
            out[at] = pair[0].0[s];
            out[at + 1] = pair[1].0[s];
        }
    }
}
