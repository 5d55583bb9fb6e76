//! Networks that learn from recordings and hear them, and the systems of the paper that are made of
//! networks.
//!
//! [`examples`] makes labelled items of recordings, [`training`] trains and validates, [`listening`]
//! classifies recordings and streams, [`embedding`] gives the numbers that a network makes of them.
//! Two kinds of sound, learned and told apart:
//!
//! ```
//! use std::sync::Arc;
//!
//! use corsmal_extract::inputs;
//! use corsmal_models::dataset::LabelSource;
//! use corsmal_nets::device::Device;
//! use corsmal_nets::networks;
//! use corsmal_nets::recipe::Recipe;
//! use corsmal_systems::SystemError;
//! use corsmal_systems::examples::Examples;
//! use corsmal_systems::listening::{Formats, Listener};
//! use corsmal_systems::training::{Trained, Training};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let audio = folder.path();
//! # let spec = hound::WavSpec {
//! #     channels: 1,
//! #     sample_rate: 44_100,
//! #     bits_per_sample: 16,
//! #     sample_format: hound::SampleFormat::Int,
//! # };
//! # for (class, step) in [("deep", 300), ("high", 3000)] {
//! #     std::fs::create_dir(audio.join(class))?;
//! #     for take in 0..3 {
//! #         let mut wav = hound::WavWriter::create(audio.join(class).join(format!("{take}.wav")), spec)?;
//! #         (0..44_100).try_for_each(|i: i32| wav.write_sample((i * (step + take)) as i16 / 2))?;
//! #         wav.finalize()?;
//! #     }
//! # }
//! let (jobs, stop) = (1, Arc::default());
//! let found = inputs::collect(&[audio])?.inputs;
//! let network = networks::classifier("m1")?;
//! let mut examples =
//!     Examples::of_recordings(network, (audio, &found), jobs, &stop, |input, reason| {
//!         eprintln!("{}: {reason}", input.id);
//!     })?;
//! examples.table.add_labels(&LabelSource::Folders { column: "class".into() })?;
//!
//! let recipe = Recipe { epochs: 20, ..network.recipe };
//! let (device, target) = (Device::Cpu, "class");
//! let training = Training { target, groups: None, recipe, checkpoints: None, weights: None, device };
//! let Trained { model, .. } = training.train(&examples, serde_json::Value::Null, |_| true)?;
//!
//! let listener = Listener::new(&model, &[], Formats::AsTrained, jobs)?;
//! let mut heard = Vec::new();
//! listener.recordings(&found, None, &stop, &mut |input, verdict| {
//!     let class = verdict.decision.map(|(class, _)| model.header.labels[class].clone());
//!     heard.push((input.id.clone(), class.unwrap_or_default()));
//!     Ok::<_, SystemError>(true)
//! })?;
//! assert_eq!(heard[0], ("deep/0".into(), "deep".into()));
//! assert_eq!(heard[5], ("high/2".into(), "high".into()));
//! # Ok(())
//! # }
//! ```
//!
//! The systems M1 to M6 and the vision baseline join front ends and networks of `corsmal-nets` by votes, cascades and fusion,
//! and are run by [`corsmal_ccm::benchmark`]. Adding one: a file here with a [`Definition`], and one
//! line in the list below.

mod definition;
pub mod embedding;
mod error;
pub mod examples;
mod learning;
pub mod listening;
pub mod pictures;
pub mod recordings;
pub mod training;

use corsmal_ccm::{CcmError, Result};

pub use definition::{Definition, Settings};
pub use error::SystemError;

macro_rules! systems {
    ($($module:ident: $definition:ident;)*) => {
        $(mod $module;)*

        /// All systems of the paper.
        pub const SYSTEMS: &[Definition] = &[$($module::$definition),*];
    };
}

systems! {
    m1: M1;
    m2: M2;
    m3: M3;
    m4: M4;
    m5: M5;
    m6: M6;
    mask_rn: MASK_RN;
}

/// The system of this name.
///
/// # Errors
/// [`CcmError::Request`] with the names there are.
pub fn named(name: &str) -> Result<&'static Definition> {
    let wanted = name.replace('_', "-");
    SYSTEMS.iter().find(|s| s.name.eq_ignore_ascii_case(&wanted)).ok_or_else(|| {
        let names: Vec<&str> = SYSTEMS.iter().map(|s| s.name).collect();
        CcmError::Request(format!("there is no system {name}: {}", names.join(", ")))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn systems_are_made_of_known_networks() {
        let letters = |name: &str| -> String {
            let letters = name.chars().filter(char::is_ascii_alphanumeric);
            letters.map(|c| c.to_ascii_lowercase()).collect()
        };
        for system in SYSTEMS {
            for network in system.networks {
                corsmal_nets::networks::named(network).unwrap();
            }
            let made = system.make(&Settings::default());
            assert_eq!(letters(made.name()), letters(system.name));
        }
        assert!(named("m7").is_err_and(|e| e.to_string().contains("m1, m2")));
    }
}
