//! Spectra of rows for any transform length.

use std::sync::Arc;

use num_complex::Complex;
use realfft::{RealFftPlanner, RealToComplex};

use super::{Aligned, LANES, LaneFft, Row, Slots, gather};
use crate::error::{DspError, Result};

/// A real transform of rows: the lane kernel for powers of two, one slot after another (realfft in
/// single precision) for every other length.
pub struct Spectrum {
    n_fft: usize,
    kind: Kind,
}

enum Kind {
    Lanes(LaneFft),
    Slots(Arc<dyn RealToComplex<f32>>),
}

impl Spectrum {
    /// Plans a transform of `n_fft` points.
    ///
    /// # Errors
    /// A length of 0.
    pub fn new(n_fft: usize) -> Result<Self> {
        if n_fft == 0 {
            return Err(DspError::parameter("n_fft", 0, "at least 1"));
        }
        let kind = if LaneFft::supports(n_fft) {
            Kind::Lanes(LaneFft::new(n_fft)?)
        } else {
            Kind::Slots(RealFftPlanner::new().plan_fft_forward(n_fft))
        };
        Ok(Self { n_fft, kind })
    }

    /// Bins, `n_fft / 2 + 1`.
    pub fn n_bins(&self) -> usize {
        self.n_fft / 2 + 1
    }

    /// Complex spectrum: real parts into the even, imaginary parts into the odd rows of `out`
    /// (`2 n_bins` rows). `frames` (`n_fft` rows) is overwritten.
    pub fn complex(&self, frames: &mut [Row], out: &mut [Row]) {
        match &self.kind {
            Kind::Lanes(plan) => plan.complex(frames, out),
            Kind::Slots(plan) => slots(plan.as_ref(), frames, |k, s, z| {
                out[2 * k].0[s] = z.re;
                out[2 * k + 1].0[s] = z.im;
            }),
        }
    }

    /// Power spectrum (`n_bins` rows). `frames` is overwritten.
    pub fn power(&self, frames: &mut [Row], out: &mut [Row]) {
        match &self.kind {
            Kind::Lanes(plan) => plan.power(frames, out),
            Kind::Slots(plan) => {
                slots(plan.as_ref(), frames, |k, s, z| out[k].0[s] = z.re * z.re + z.im * z.im);
            }
        }
    }

    /// Power spectrum of the frames `slots` of an interleaved signal that starts with the first
    /// sample of frame 0, times `window` (`n_fft` values). `work` (`n_fft` rows) is overwritten.
    pub fn power_of(
        &self,
        signal: &[f32],
        hop: usize,
        window: &[f32],
        slots: Slots,
        work: &mut [Row],
        out: &mut [Row],
    ) {
        if let Kind::Lanes(plan) = &self.kind
            && slots.aligned()
        {
            // Wide enough to be read where they lie.
            let n = self.n_fft;
            match slots.channels {
                4 => {
                    let frames = Aligned::<4, 4>::new(signal, hop, n, slots);
                    return plan.power_of(&frames, window, work, out);
                }
                8 => {
                    let frames = Aligned::<8, 2>::new(signal, hop, n, slots);
                    return plan.power_of(&frames, window, work, out);
                }
                16 => {
                    let frames = Aligned::<16, 1>::new(signal, hop, n, slots);
                    return plan.power_of(&frames, window, work, out);
                }
                _ => {}
            }
        }
        gather(signal, hop, window, slots, work);
        self.power(work, out);
    }

    /// Magnitude spectrum (`n_bins` rows). `frames` is overwritten.
    pub fn magnitude(&self, frames: &mut [Row], out: &mut [Row]) {
        self.power(frames, out);
        square_roots(out);
    }
}

/// Magnitudes from powers.
pub fn square_roots(rows: &mut [Row]) {
    crate::simd::vectorized(
        #[inline(always)]
        || {
            for row in rows.iter_mut() {
                for x in &mut row.0 {
                    *x = x.sqrt();
                }
            }
        },
    );
}

/// `each(bin, slot, value)` of every slot.
fn slots(
    plan: &dyn RealToComplex<f32>,
    frames: &[Row],
    mut each: impl FnMut(usize, usize, Complex<f32>),
) {
    let (mut x, mut spectrum, mut scratch) =
        (plan.make_input_vec(), plan.make_output_vec(), plan.make_scratch_vec());
    for s in 0..LANES {
        for (x, row) in x.iter_mut().zip(frames) {
            *x = row.0[s];
        }
        plan.process_with_scratch(&mut x, &mut spectrum, &mut scratch)
            .expect("buffers made by the plan itself");
        spectrum.iter().enumerate().for_each(|(k, z)| each(k, s, *z));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odd_lengths_take_the_same_interface() {
        let spectrum = Spectrum::new(15).unwrap();
        let mut frames = vec![Row([1.0; LANES]); 15];
        let mut out = vec![Row::ZERO; spectrum.n_bins()];
        spectrum.magnitude(&mut frames, &mut out);
        assert_eq!(out.len(), 8);
        assert!((out[0].0[3] - 15.0).abs() < 1e-5);
        assert!(out[1].0[3].abs() < 1e-5);
    }
}
