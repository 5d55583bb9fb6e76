//! A signal from memory instead of a file: pushed block by block, computed as a recording of a run.

use std::ops::Range;
use std::path::PathBuf;
use std::sync::Arc;

use corsmal_audio::{AudioSpec, SampleEncoding};
use thiserror::Error;

use super::extractor::Extractor;
use super::failed::Failed;
use super::plan::Plan;
use super::plans::{Planned, Plans};
use super::reading;
use super::recording::{Features, Recording};
use super::samples::check_samples;
use super::signal_chain::SignalChain;
use crate::config::Config;
use corsmal_files::outcome::Status;

/// Frames that come out of the signal chain at a time.
const BLOCK: usize = 1 << 14;

/// Why a signal has no features.
#[derive(Debug, Error)]
#[error("{status}: {reason}")]
pub struct SignalError {
    /// The verdict, as the outcome of a file would have it.
    pub status: Status,
    /// In words.
    pub reason: String,
}

impl From<Failed> for SignalError {
    fn from(failed: Failed) -> Self {
        Self { status: failed.status, reason: failed.reason }
    }
}

/// Computes signals by one configuration; filters and transforms are made once per sample rate and
/// number of channels.
pub struct Signals {
    plans: Plans<'static>,
    folder: PathBuf,
}

impl Signals {
    /// Signals by `config`. What does not fit in memory goes to the system's temporary folder.
    pub fn new(config: Arc<Config>) -> Self {
        Self { plans: Plans::new(config, |_| {}), folder: std::env::temp_dir() }
    }

    /// Begins a signal of `sample_rate` Hz and `channels` channels.
    ///
    /// # Errors
    /// The configuration does not fit such signals.
    pub fn start(&self, sample_rate: u32, channels: u16) -> Result<Signal, SignalError> {
        let refuse = |reason: String| Failed::new(Status::Unsupported, reason);
        if sample_rate == 0 || !(1..=64).contains(&channels) {
            let reason = format!(
                "{channels} channels at {sample_rate} Hz; expected 1 to 64 channels at more than 0 Hz"
            );
            return Err(refuse(reason).into());
        }
        let spec = AudioSpec {
            sample_rate,
            channels,
            format: "memory".into(),
            encoding: SampleEncoding::Float { bytes: 4 },
            declared_frames: None,
        };
        let planned = self.plans.of(&spec).map_err(refuse)?;
        let step = planned.step(BLOCK, sample_rate);
        let Planned { plan, resample } = planned;
        let config = &plan.config.signal;
        let front = SignalChain::new(config, usize::from(channels), resample, plan.sample_rate)
            .map_err(refuse)?;
        Ok(Signal {
            front,
            extractor: Extractor::new(plan.clone(), 0..u64::MAX, 0),
            crop: reading::crop(config, (None, None), sample_rate),
            channels: usize::from(channels),
            step,
            origin: 0,
            position: 0,
            held: Vec::new(),
            folder: self.folder.clone(),
            plan,
        })
    }
}

/// One signal. Any split into blocks gives the same bits.
pub struct Signal {
    plan: Arc<Plan>,
    front: SignalChain,
    extractor: Extractor,
    /// Input frames that count.
    crop: Range<u64>,
    channels: usize,
    /// Input frames taken at a time.
    step: usize,
    /// Frame of the recording at which it begins.
    origin: u64,
    /// Input frames pushed.
    position: u64,
    /// What the signal chain gave for a block.
    held: Vec<f32>,
    folder: PathBuf,
}

impl Signal {
    /// What is computed.
    pub fn plan(&self) -> &Arc<Plan> {
        &self.plan
    }

    /// The same signal as a part of a recording that begins at this frame: messages name frames of the recording.
    pub(super) fn within(self, origin: u64) -> Self {
        Self { origin, ..self }
    }

    /// Takes interleaved samples; a frame that is not whole is left out.
    ///
    /// # Errors
    /// NaN, infinite or huge samples: then none of them is taken.
    pub fn push(&mut self, samples: &[f32]) -> Result<(), SignalError> {
        let frames = samples.len() / self.channels;
        let (begin, end) = (self.position, self.position + frames as u64);
        let inside = |frame: u64| (frame.clamp(begin, end) - begin) as usize;
        let (from, to) = (inside(self.crop.start), inside(self.crop.end));
        let samples = &samples[from * self.channels..to * self.channels];
        let at = self.origin + begin + from as u64;
        check_samples(samples, at, self.channels, |_| None)?;
        self.position = end;
        for block in samples.chunks(self.step * self.channels) {
            self.front.push(block, &mut self.held);
            self.extractor.push(&self.held);
            self.held.clear();
        }
        Ok(())
    }

    /// The features of the signal, which ends here.
    ///
    /// # Errors
    /// No samples, too few for one frame, or a temporary file that fails.
    pub fn finish(self) -> Result<Features, SignalError> {
        let Self { plan, front, mut extractor, folder, .. } = self;
        front.finish(|block| {
            extractor.push(block);
            Ok::<_, Failed>(true)
        })?;
        let mut recording = Recording::new(plan, &folder);
        let span = extractor.finish(true).map_err(Failed::from)?;
        recording.add(span).map_err(Failed::temporary)?;
        Ok(recording.complete()?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(features: Features) -> Vec<f32> {
        match features {
            Features::Summary(row) => row,
            Features::Frames(_) => panic!("a summary was configured"),
        }
    }

    #[test]
    fn blocks_do_not_matter() {
        for overrides in
            [&[][..], &["signal.normalize=rms", "signal.start=0.01", "signal.end=0.09"]]
        {
            let overrides: Vec<String> = overrides.iter().map(|s| s.to_string()).collect();
            let toml = crate::config::Preset::find("esc26").unwrap().toml;
            let config = Config::with_overrides(toml, "esc26", &overrides).unwrap();
            let signals = Signals::new(Arc::new(config));
            let samples: Vec<f32> =
                (0..2 * 6000_u32).map(|i| (i * i % 997) as f32 / 997.0).collect();
            let mut whole = signals.start(44_100, 2).unwrap();
            whole.push(&samples).unwrap();
            let whole = rows(whole.finish().unwrap());
            assert_eq!(whole.len(), 26);
            for block in [2, 34, 3000] {
                let mut signal = signals.start(44_100, 2).unwrap();
                samples.chunks(block).for_each(|block| signal.push(block).unwrap());
                assert_eq!(rows(signal.finish().unwrap()), whole);
            }
        }
    }

    /// What stood before the sample was kept, or the whole block used up the crop.
    #[test]
    fn a_refused_block_leaves_the_signal_as_it_was() {
        for crop in [&[][..], &["signal.start=0.5", "signal.end=1.5"]] {
            let overrides: Vec<String> = crop.iter().map(|s| s.to_string()).collect();
            let toml = crate::config::Preset::find("esc26").unwrap().toml;
            let config = Config::with_overrides(toml, "esc26", &overrides).unwrap();
            let signals = Signals::new(Arc::new(config));
            let good: Vec<f32> = (0..45_000_u32).map(|i| (i * i % 997) as f32 / 997.0).collect();
            let mut bad = good.clone();
            bad[30_000] = 1e13;
            let computed = |refused: bool| {
                let mut signal = signals.start(22_050, 1).unwrap();
                assert!(!refused || signal.push(&bad).is_err());
                signal.push(&good).unwrap();
                rows(signal.finish().unwrap())
            };
            assert_eq!(computed(true), computed(false), "{crop:?}");
        }
    }

    #[test]
    fn refusals_say_what_a_file_would() {
        let signals = Signals::new(Arc::new(Config::preset("esc26").unwrap()));
        let status = |samples: &[f32]| {
            let mut signal = signals.start(22_050, 1).unwrap();
            signal.push(samples).and_then(|()| signal.finish().map(|_| ())).unwrap_err().status
        };
        assert_eq!(status(&[]), Status::Empty);
        assert_eq!(status(&[0.0, f32::NAN]), Status::NonFinite);
        assert_eq!(status(&[0.0, -1e18]), Status::Unsupported);
        let mut signal = signals.start(22_050, 2).unwrap();
        let refused = signal.push(&[0.0, 1e12, 0.0, 2e12]).unwrap_err().reason;
        let expected = "beyond ±1e12 from frame 1 on (channel 1; 1 sample of this block): their powers overflow";
        assert!(refused.starts_with(expected), "{refused}");
        assert!(signals.start(22_050, 0).is_err());
    }
}
