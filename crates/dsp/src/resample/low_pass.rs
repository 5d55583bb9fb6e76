//! Low-pass filters by Kaiser's window.

use std::f64::consts::PI;

use crate::window::bessel_i0;

/// Kaiser shape for an attenuation of at least 60 dB: cubics in the attenuation, tabulated for
/// transition bands of 0.0005 * 2^k and interpolated between them.
fn kaiser_beta(attenuation: f64, transition: f64) -> f64 {
    const FITS: [[f64; 4]; 10] = [
        [-6.784957e-10, 1.02856e-05, 0.1087556, -0.8978365],
        [-6.897885e-10, 1.027433e-05, 0.10876, -0.8974658],
        [-1.000683e-09, 1.030092e-05, 0.1087677, -0.8977898],
        [-3.654474e-10, 1.040631e-05, 0.1087085, -0.8917766],
        [8.106988e-09, 6.983091e-06, 0.1091387, -0.9022048],
        [9.519571e-09, 7.272678e-06, 0.1090068, -0.8890768],
        [-5.626821e-09, 1.342186e-05, 0.1083999, -0.8565452],
        [-9.965946e-08, 5.073548e-05, 0.1040967, -0.6822778],
        [1.604808e-07, -5.856462e-05, 0.1185998, -1.24824],
        [-1.511964e-07, 6.363034e-05, 0.1064627, -0.8076665],
    ];
    let octave = (transition / 0.0005).log2();
    let at = |k: f64| {
        let fit = FITS[(k.max(0.0) as usize).min(FITS.len() - 1)];
        fit.iter().fold(0.0, |sum, c| sum * attenuation + c)
    };
    let below = octave.trunc();
    at(below) + (at(below + 1.0) - at(below)) * (octave - below)
}

/// A low-pass specification: pass and stop frequencies relative to `nyquist`.
#[derive(Debug, Clone, Copy)]
pub(super) struct LowPass {
    pub pass: f64,
    pub stop: f64,
    pub nyquist: f64,
    pub attenuation: f64,
    /// Phases of an interpolator; 1 for a plain filter.
    pub phases: usize,
}

impl LowPass {
    /// (cut-off, Kaiser beta, taps needed at least)
    pub fn shape(&self) -> (f64, f64, usize) {
        let phases = self.phases as f64;
        let stop = self.stop / self.nyquist / phases;
        let transition = (0.5 * (self.stop - self.pass) / self.nyquist / phases).min(0.5 * stop);
        let cutoff = stop - transition;
        let beta = kaiser_beta(self.attenuation, transition * 0.5 / cutoff);
        let width = ((0.0007528358 - 1.577737e-05 * beta) * beta + 0.6248022) * beta + 0.06186902;
        (cutoff, beta, (width / transition + 1.0).ceil() as usize)
    }

    /// Taps of an interpolator's prototype: one less than a multiple of the phases.
    pub fn prototype_len(&self) -> usize {
        let (_, _, needed) = self.shape();
        needed / self.phases * self.phases + self.phases - 1
    }

    /// `len` taps with a total gain of about `phases`.
    pub fn taps(&self, len: usize) -> Vec<f64> {
        let (cutoff, beta, _) = self.shape();
        // The window is stretched a little beyond the outermost taps.
        let stretch = match self.phases {
            1 => 0.5,
            _ if self.attenuation < 120.0 => 0.63,
            _ => 0.75,
        };
        let centre = 0.5 * (len - 1) as f64;
        let gain = self.phases as f64 / bessel_i0(beta);
        (0..len)
            .map(|i| {
                let z = i as f64 - centre;
                let y = z / (centre + stretch);
                let sinc = if z == 0.0 { cutoff } else { (cutoff * PI * z).sin() / (PI * z) };
                sinc * gain * bessel_i0(beta * (1.0 - y * y).max(0.0).sqrt())
            })
            .collect()
    }
}
