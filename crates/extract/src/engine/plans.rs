//! Plans for every combination of rate and channels that a run meets, made once.

use std::collections::{HashMap, HashSet};
use std::sync::{Arc, Mutex};

use corsmal_audio::AudioSpec;
use corsmal_dsp::resample::Converter;
use corsmal_dsp::resample::MAX_EXPANSION;

use super::plan::Plan;
use super::signal_chain::channels_out;
use super::workspace::Workspaces;
use crate::config::{Config, SignalConfig};

/// What a recording is computed with.
#[derive(Clone)]
pub struct Planned {
    /// The features.
    pub plan: Arc<Plan>,
    /// The resampling filters, where the rate changes.
    pub resample: Option<Converter>,
}

impl Planned {
    /// Frames to take at a time of recordings at `sample_rate` Hz, so that the signal chain makes about
    /// `frames` of them at most.
    pub fn step(&self, frames: usize, sample_rate: u32) -> usize {
        let ratio = (self.plan.sample_rate / f64::from(sample_rate)).max(1.0);
        ((frames as f64 / ratio) as usize).max(1)
    }
}

type Made = Result<Planned, String>;

/// The plans of a run.
pub struct Plans<'a> {
    config: Arc<Config>,
    warn: Box<dyn Fn(&str) + Send + Sync + 'a>,
    state: Mutex<State>,
    /// One for all plans: a run may meet a thousand rates.
    workspaces: Arc<Workspaces>,
}

#[derive(Default)]
struct State {
    made: HashMap<(u32, u16), Made>,
    /// Each is given once per run, not for every rate and number of channels.
    warnings: HashSet<String>,
}

impl<'a> Plans<'a> {
    /// No plans yet; what a plan warns of goes to `warn`.
    pub fn new(config: Arc<Config>, warn: impl Fn(&str) + Send + Sync + 'a) -> Self {
        let (state, workspaces) = (Mutex::default(), Arc::default());
        Self { config, warn: Box::new(warn), state, workspaces }
    }

    /// How the configuration makes the signal.
    pub fn signal(&self) -> &SignalConfig {
        &self.config.signal
    }

    /// The plan for recordings like this one.
    ///
    /// # Errors
    /// A sentence, where the configuration does not fit.
    pub fn of(&self, spec: &AudioSpec) -> Made {
        // Making a plan takes milliseconds; the lock keeps two workers from making the same one.
        let mut state = self.state.lock().unwrap_or_else(|e| e.into_inner());
        let key = (spec.sample_rate, spec.channels);
        if let Some(made) = state.made.get(&key) {
            return made.clone();
        }
        let made = self.make(spec);
        if let Ok(planned) = &made {
            for warning in planned.plan.warnings() {
                if state.warnings.insert(warning.clone()) {
                    (self.warn)(warning);
                }
            }
        }
        state.made.insert(key, made.clone());
        made
    }

    fn make(&self, spec: &AudioSpec) -> Made {
        let signal = &self.config.signal;
        let native = f64::from(spec.sample_rate);
        let rate = if signal.sample_rate > 0.0 { signal.sample_rate } else { native };
        let channels = channels_out(&signal.channels, usize::from(spec.channels))?;
        if rate > native * MAX_EXPANSION {
            return Err(format!(
                "signal.sample_rate = {rate} is more than {MAX_EXPANSION} times the {native} Hz of the \
                 recording"
            ));
        }
        let resample = (rate != native)
            .then(|| Converter::new(native, rate, signal.res_type))
            .transpose()
            .map_err(|e| e.to_string())?;
        let plan = Plan::new(&self.config, rate, channels).map_err(|e| e.to_string())?;
        Ok(Planned { plan: Arc::new(plan.sharing(self.workspaces.clone())), resample })
    }
}

#[cfg(test)]
mod tests {
    use super::super::extractor::Extractor;
    use super::*;
    use corsmal_audio::SampleEncoding;

    #[test]
    fn plans_share_what_extractors_work_in() {
        let plans = Plans::new(Arc::new(Config::preset("m4-code").unwrap()), |_| {});
        for rate in 44_100..44_120 {
            let spec = AudioSpec {
                sample_rate: rate,
                channels: 2,
                format: "memory".into(),
                encoding: SampleEncoding::Float { bytes: 4 },
                declared_frames: None,
            };
            let mut extractor = Extractor::new(plans.of(&spec).unwrap().plan, 0..u64::MAX, 0);
            extractor.push(&vec![0.1; 100_000]);
            extractor.finish(true).unwrap();
        }
        assert_eq!(plans.workspaces.idle(), 1);
        let bytes = plans.workspaces.bytes();
        assert!((400_000..4 << 20).contains(&bytes), "{bytes}");
    }
}
