//! The streams of a plan: features with equal parameters share one.

use corsmal_dsp::stft::{PadMode, StftParams};
use corsmal_dsp::time_domain::FrameParams;

use super::exact::{ExactMember, ExactStream};
use super::framing::Stream;
use super::spectrum::{SpectrumMember, SpectrumStream};
use super::wave::WaveStream;
use crate::features::WaveKernel;

/// Streams as features join them.
#[derive(Default)]
pub struct SharedStreams {
    spectra: Vec<SpectrumStream>,
    exact: Vec<ExactStream>,
    waves: Vec<WaveStream>,
}

impl SharedStreams {
    /// Adds a feature to the spectra with these parameters.
    ///
    /// # Errors
    /// An impossible window or transform.
    pub fn spectrum(
        &mut self,
        params: &StftParams,
        member: SpectrumMember,
    ) -> corsmal_dsp::Result<()> {
        let at = match self.spectra.iter().position(|s| s.params() == params) {
            Some(at) => at,
            None => {
                self.spectra.push(SpectrumStream::new(params)?);
                self.spectra.len() - 1
            }
        };
        self.spectra[at].add(member);
        Ok(())
    }

    /// Adds a feature to the exact magnitudes with these parameters.
    ///
    /// # Errors
    /// An impossible window or transform.
    pub fn exact(&mut self, params: &StftParams, member: ExactMember) -> corsmal_dsp::Result<()> {
        let at = match self.exact.iter().position(|s| s.params() == params) {
            Some(at) => at,
            None => {
                self.exact.push(ExactStream::new(params)?);
                self.exact.len() - 1
            }
        };
        self.exact[at].add(member);
        Ok(())
    }

    /// Adds a feature of the waveform.
    pub fn wave(
        &mut self,
        frame: &FrameParams,
        mode: PadMode,
        feature: usize,
        kernel: Box<dyn WaveKernel>,
    ) {
        self.waves.push(WaveStream::new(frame, mode, feature, kernel));
    }

    /// All of them.
    pub fn into_streams(self) -> Vec<Box<dyn Stream>> {
        let spectra = self.spectra.into_iter().map(|s| Box::new(s) as Box<dyn Stream>);
        let exact = self.exact.into_iter().map(|s| Box::new(s) as Box<dyn Stream>);
        let waves = self.waves.into_iter().map(|s| Box::new(s) as Box<dyn Stream>);
        spectra.chain(exact).chain(waves).collect()
    }
}
