//! A feature of one's own, used as those of the crate are: in a configuration, in a run over
//! recordings, and in the table that comes out.
//!
//! ```sh
//! cargo run -p corsmal-extract --example own_feature
//! ```

use std::error::Error;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use corsmal_dsp::DspError;
use corsmal_dsp::stft::PadMode;
use corsmal_dsp::time_domain::FrameParams;
use corsmal_extract::config::Config;
use corsmal_extract::engine::{Features, Signals};
use corsmal_extract::features::{self, Feature, FeatureKind, Kernel, WaveKernel};
use corsmal_extract::inputs;
use corsmal_extract::params::{FrameSpec, Keys};
use corsmal_extract::run::{self, Quiet, RunOptions};
use corsmal_files::npz::Compression;
use serde::{Deserialize, Serialize};

/// The keys of `[features.crest_factor]`. The group of frame keys is that of `rms`.
#[derive(Serialize, Deserialize)]
#[serde(default)]
struct CrestFactor {
    #[serde(flatten)]
    frame: FrameSpec,
    quietest: f64,
}

impl Default for CrestFactor {
    fn default() -> Self {
        Self { frame: FrameSpec::default(), quietest: 1e-6 }
    }
}

/// What is computed of the frames.
struct Crest {
    frame: FrameParams,
    quietest: f64,
}

impl WaveKernel for Crest {
    fn frames(&self, samples: &[f32], channels: usize, frames: usize, out: &mut Vec<f32>) {
        for t in 0..frames {
            let start = t * self.frame.hop_length * channels;
            let frame = &samples[start..start + self.frame.frame_length * channels];
            for c in 0..channels {
                let channel = || frame[c..].iter().step_by(channels).map(|x| f64::from(*x));
                let peak = channel().fold(0.0, |peak: f64, x| peak.max(x.abs()));
                let power = channel().map(|x| x * x).sum::<f64>();
                let level = (power / self.frame.frame_length as f64).sqrt();
                out.push((peak / level.max(self.quietest)) as f32);
            }
        }
    }
}

impl FeatureKind for CrestFactor {
    const KIND: &'static str = "crest_factor";
    const ABOUT: &'static str = "Peak of each frame over its root-mean-square level.";
    const KEYS: &'static [Keys] = &[
        FrameSpec::KEYS,
        &[("quietest", "Level that quieter frames are divided by; avoids 0 / 0.")],
    ];

    fn plan(&self, _sample_rate: f64) -> corsmal_dsp::Result<Feature> {
        if self.quietest.is_nan() || self.quietest <= 0.0 {
            return Err(DspError::parameter("quietest", self.quietest, "above 0"));
        }
        let frame = self.frame.params()?;
        let kernel = Box::new(Crest { frame, quietest: self.quietest });
        let kernel = Kernel::Wave(frame, PadMode::Constant, kernel);
        Ok(Feature::new(kernel, vec![String::new()]))
    }
}

/// Registers the feature and shows that it is one like any other.
pub fn main() -> Result<(), Box<dyn Error>> {
    features::register::<CrestFactor>()?;

    // In a configuration: keys are checked, defaults filled in, values stored and hashed.
    let text = "[features.crest_factor]\nframe_length = 1024\n[summary]\nstats = ['mean', 'max']";
    let config = Arc::new(Config::with_overrides(text, "example", &[])?);
    println!("{:#}", config.to_value()["features"]);

    // In a signal from memory: a sine has a crest factor of the square root of 2.
    let sine: Vec<f32> = (0..44_100).map(|i| (0.0625 * f64::from(i)).sin() as f32).collect();
    let mut signal = Signals::new(config.clone()).start(44_100, 1)?;
    signal.push(&sine)?;
    if let Features::Summary(row) = signal.finish()? {
        println!("sine: mean {:.3}, max {:.3}", row[0], row[1]);
    }

    // In a run over recordings.
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("sine.wav");
    let spec = hound::WavSpec {
        channels: 1,
        sample_rate: 44_100,
        bits_per_sample: 32,
        sample_format: hound::SampleFormat::Float,
    };
    let mut wav = hound::WavWriter::create(&path, spec)?;
    sine.iter().try_for_each(|x| wav.write_sample(*x))?;
    wav.finalize()?;
    let inputs = inputs::collect(&[path.into_os_string()])?.inputs;
    let options = RunOptions {
        out: folder.path().join("features.npz"),
        work: None,
        partition_by: None,
        compression: Compression::Stored,
        jobs: 1,
        shard: "0/1".parse()?,
        resume: false,
        overwrite: false,
        max_errors: None,
    };
    let stop = Arc::new(AtomicBool::new(false));
    let report = run::run(&inputs, &config, &options, &Quiet, &stop)?;
    println!("{}: {} of {}", options.out.display(), inputs.len() - report.failed(), inputs.len());
    Ok(())
}
