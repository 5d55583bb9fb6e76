//! Plans for every combination of rate and channels that a run meets, made once.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use corsmal_audio::AudioSpec;
use corsmal_dsp::resample::ResamplePlan;

use crate::config::Config;
use crate::engine::Plan;
use crate::frontend::channels_out;

/// What a recording is computed with.
#[derive(Clone)]
pub struct Planned {
    /// The features.
    pub plan: Arc<Plan>,
    /// The resampling filters, where the rate changes.
    pub resample: Option<Arc<ResamplePlan>>,
}

type Made = Result<Planned, String>;

/// The plans of a run.
pub struct Plans {
    config: Arc<Config>,
    made: Mutex<HashMap<(u32, u16), Made>>,
}

impl Plans {
    /// No plans yet.
    pub fn new(config: Arc<Config>) -> Self {
        Self { config, made: Mutex::new(HashMap::new()) }
    }

    /// The plan for recordings like this one.
    ///
    /// # Errors
    /// A sentence, where the configuration does not fit.
    pub fn of(&self, spec: &AudioSpec) -> Made {
        // Making a plan takes milliseconds; the lock keeps two workers from making the same one.
        let mut made = self.made.lock().unwrap_or_else(|e| e.into_inner());
        let key = (spec.sample_rate, spec.channels);
        made.entry(key).or_insert_with(|| self.make(spec)).clone()
    }

    fn make(&self, spec: &AudioSpec) -> Made {
        let signal = &self.config.signal;
        let native = f64::from(spec.sample_rate);
        let rate = if signal.sample_rate > 0.0 { signal.sample_rate } else { native };
        let channels = channels_out(&signal.channels, usize::from(spec.channels))?;
        let resample = (rate != native)
            .then(|| ResamplePlan::new(native, rate).map(Arc::new))
            .transpose()
            .map_err(|e| e.to_string())?;
        let plan = Plan::new(&self.config, rate, channels).map_err(|e| e.to_string())?;
        Ok(Planned { plan: Arc::new(plan), resample })
    }
}
