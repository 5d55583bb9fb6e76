//! Spectra of rows for any transform length.

use std::sync::Arc;

use num_complex::Complex;
use num_traits::Float;
use realfft::RealToComplex;

use super::{Aligned, LaneFft, Lanes, Row, Slots, gather};
use crate::error::{DspError, Result};
use crate::real::Real;

/// A real transform of rows: the lane kernel for powers of two, one slot after another (realfft) for every other length.
pub struct Spectrum<R: Lanes = Row> {
    n_fft: usize,
    kind: Kind<R>,
}

enum Kind<R: Lanes> {
    Lanes(LaneFft<R>),
    Slots(Arc<dyn RealToComplex<R::Value>>),
}

impl<R: Lanes> Spectrum<R> {
    /// Plans a transform of `n_fft` points.
    ///
    /// # Errors
    /// A length of 0.
    pub fn new(n_fft: usize) -> Result<Self> {
        if n_fft == 0 {
            return Err(DspError::parameter("n_fft", 0, "at least 1"));
        }
        let kind = if LaneFft::<R>::supports(n_fft) {
            Kind::Lanes(LaneFft::new(n_fft)?)
        } else {
            Kind::Slots(R::Value::forward_transform(n_fft))
        };
        Ok(Self { n_fft, kind })
    }

    /// Bins, `n_fft / 2 + 1`.
    pub fn n_bins(&self) -> usize {
        self.n_fft / 2 + 1
    }

    /// Complex spectrum: real parts into the even, imaginary parts into the odd rows of `out`
    /// (`2 n_bins` rows). `frames` (`n_fft` rows) is overwritten.
    pub fn complex(&self, frames: &mut [R], out: &mut [R]) {
        match &self.kind {
            Kind::Lanes(plan) => plan.complex(frames, out),
            Kind::Slots(plan) => slots(plan.as_ref(), frames, |k, s, z| {
                out[2 * k].values_mut()[s] = z.re;
                out[2 * k + 1].values_mut()[s] = z.im;
            }),
        }
    }

    /// Power spectrum (`n_bins` rows). `frames` is overwritten.
    pub fn power(&self, frames: &mut [R], out: &mut [R]) {
        match &self.kind {
            Kind::Lanes(plan) => plan.power(frames, out),
            Kind::Slots(plan) => {
                slots(plan.as_ref(), frames, |k, s, z| {
                    out[k].values_mut()[s] = z.re * z.re + z.im * z.im;
                });
            }
        }
    }
}

impl Spectrum {
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
pub fn square_roots<R: Lanes>(rows: &mut [R]) {
    crate::simd::vectorized(
        #[inline(always)]
        || {
            for row in rows.iter_mut() {
                for x in row.values_mut() {
                    *x = x.sqrt();
                }
            }
        },
    );
}

/// `each(bin, slot, value)` of every slot.
fn slots<R: Lanes>(
    plan: &dyn RealToComplex<R::Value>,
    frames: &[R],
    mut each: impl FnMut(usize, usize, Complex<R::Value>),
) {
    let (mut x, mut spectrum, mut scratch) =
        (plan.make_input_vec(), plan.make_output_vec(), plan.make_scratch_vec());
    for s in 0..R::SLOTS {
        for (x, row) in x.iter_mut().zip(frames) {
            *x = row.values()[s];
        }
        plan.process_with_scratch(&mut x, &mut spectrum, &mut scratch)
            .expect("buffers made by the plan itself");
        spectrum.iter().enumerate().for_each(|(k, z)| each(k, s, *z));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lanes::LANES;

    #[test]
    fn odd_lengths_take_the_same_interface() {
        let spectrum = Spectrum::<Row>::new(15).unwrap();
        let mut frames = vec![Row([1.0; LANES]); 15];
        let mut out = vec![Row::ZERO; spectrum.n_bins()];
        spectrum.magnitude(&mut frames, &mut out);
        assert_eq!(out.len(), 8);
        assert!((out[0].0[3] - 15.0).abs() < 1e-5);
        assert!(out[1].0[3].abs() < 1e-5);
    }
}
