//! Spectra of sixteen (frame, channel) slots at a time, shared by the features that read them.

use corsmal_dsp::lanes::{LANES, Row, Slots, Spectrum, gather, square_roots};
use corsmal_dsp::simd::vectorized;
use corsmal_dsp::stft::StftParams;

use super::framing::{Frames, Framing, Scratch, Stream};
use crate::features::{Quantity, SpectrumKernel};

/// Spectra with these parameters.
pub struct SpectrumStream {
    params: StftParams,
    spectrum: Spectrum,
    /// The window in single precision.
    window: Vec<f32>,
    members: Vec<SpectrumMember>,
}

/// A feature of spectra.
pub struct SpectrumMember {
    /// Its index.
    pub feature: usize,
    /// Values stored per frame and channel.
    pub rows: usize,
    /// Whether pairs of rows are real and imaginary parts.
    pub complex: bool,
    /// What it reads.
    pub quantity: Quantity,
    /// What it computes.
    pub kernel: Box<dyn SpectrumKernel>,
}

impl SpectrumStream {
    /// Spectra that no feature reads yet.
    ///
    /// # Errors
    /// An impossible window or transform.
    pub fn new(params: &StftParams) -> corsmal_dsp::Result<Self> {
        let StftParams { window, win_length, n_fft, .. } = params;
        let window = corsmal_dsp::window::padded_window(window, *win_length, *n_fft)?;
        Ok(Self {
            params: params.clone(),
            spectrum: Spectrum::new(*n_fft)?,
            window: window.iter().map(|w| *w as f32).collect(),
            members: Vec::new(),
        })
    }

    /// Parameters of the transform.
    pub fn params(&self) -> &StftParams {
        &self.params
    }

    /// Adds a feature.
    pub fn add(&mut self, member: SpectrumMember) {
        self.members.push(member);
    }
}

impl Stream for SpectrumStream {
    fn framing(&self) -> Framing {
        Framing::of_transform(&self.params)
    }

    fn n_fft(&self) -> Option<usize> {
        Some(self.params.n_fft)
    }

    fn run(&self, frames: Frames<'_>, raw: &mut [Vec<f32>], scratch: &mut Scratch) {
        let Frames { samples, count, channels } = frames;
        let (bins, hop) = (self.spectrum.n_bins(), self.params.hop_length);
        scratch.frames.resize(self.params.n_fft, Row::ZERO);
        scratch.spectrum.resize(2 * bins, Row::ZERO);
        let starts: Vec<usize> = self
            .members
            .iter()
            .map(|member| {
                let raw = &mut raw[member.feature];
                let start = raw.len();
                raw.resize(start + count * member.rows * channels, 0.0);
                start
            })
            .collect();
        for slots in Slots::blocks(count, channels) {
            let mut current = None;
            for (member, start) in self.members.iter().zip(&starts) {
                let quantity = member.quantity;
                if current != Some(quantity) {
                    let (time, out) = (&mut scratch.frames, &mut scratch.spectrum);
                    if quantity == Quantity::Complex {
                        gather(samples, hop, &self.window, slots, time);
                        self.spectrum.complex(time, out);
                    } else if current != Some(Quantity::Power) {
                        let out = &mut out[..bins];
                        self.spectrum.power_of(samples, hop, &self.window, slots, time, out);
                    }
                    if quantity == Quantity::Magnitude {
                        square_roots(&mut out[..bins]);
                    }
                    current = Some(quantity);
                }
                scratch.rows.resize(member.rows, Row::ZERO);
                let read = match quantity {
                    Quantity::Complex => &scratch.spectrum[..],
                    _ => &scratch.spectrum[..bins],
                };
                member.kernel.rows(read, &mut scratch.rows);
                let out = &mut raw[member.feature][*start..];
                if member.complex {
                    scatter_complex(&scratch.rows, slots, out);
                } else {
                    scatter(&scratch.rows, slots, out);
                }
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
    vectorized(
        #[inline(always)]
        || {
            // So few rows at a time that they stay in the nearest cache for all slots.
            for (i, rows) in rows.chunks(TILE).enumerate() {
                for s in 0..slots.len {
                    let (frame, channel) = slots.pair(s);
                    let start = (frame * n_rows + i * TILE) * channels;
                    let out = &mut out[start..start + rows.len() * channels];
                    if channels == 1 {
                        out.iter_mut().zip(rows).for_each(|(out, row)| *out = row.0[s]);
                        continue;
                    }
                    for (row, out) in rows.iter().zip(out[channel..].iter_mut().step_by(channels)) {
                        *out = row.0[s];
                    }
                }
            }
        },
    );
}

/// Rows that [`scatter`] takes at a time.
const TILE: usize = 64;

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
