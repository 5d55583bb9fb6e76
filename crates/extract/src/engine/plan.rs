//! A configuration planned for one sample rate and number of channels: transforms, windows, filter
//! banks, all made once and shared by every worker.

use std::sync::Arc;

use corsmal_dsp::lanes::{Row, Spectrum};
use corsmal_dsp::stft::{PadMode, StftParams};
use corsmal_dsp::time_domain::FrameParams;
use corsmal_dsp::transform::Forward;

use crate::config::Config;
use crate::features::{Extent, Feature, Kernel, Quantity};

/// A feature with its place in the output.
pub struct PlannedFeature {
    /// Name in outputs.
    pub name: String,
    /// Kernel and finish.
    pub feature: Feature,
    /// Names of the coefficients kept.
    pub labels: Vec<String>,
    /// Coefficients kept, `[first, end)`.
    pub kept: [usize; 2],
    /// Index of the feature that a derived one is computed from.
    pub source: Option<usize>,
}

impl PlannedFeature {
    /// Whether it is one vector a recording, which statistics leave as it is.
    pub fn is_vector(&self) -> bool {
        matches!(self.feature.kernel, Kernel::Whole(Extent::Vector, _))
    }
}

/// Frames of the waveform as a stream cuts them.
#[derive(Debug, Clone, Copy)]
pub struct Framing {
    /// Samples in a frame.
    pub length: usize,
    /// Samples between frames.
    pub hop: usize,
    /// Samples before the first sample of the signal in frame 0.
    pub pad: usize,
    /// What lies outside the signal.
    pub mode: PadMode,
}

impl Framing {
    /// Frames of `n` samples.
    pub fn n_frames(&self, n: u64) -> u64 {
        let padded = n + 2 * self.pad as u64;
        if n == 0 || padded < self.length as u64 {
            0
        } else {
            1 + (padded - self.length as u64) / self.hop as u64
        }
    }
}

/// One pass over the frames of the signal, shared by every feature with the same framing.
pub struct StreamPlan {
    /// How frames are cut.
    pub framing: Framing,
    /// What is computed of them.
    pub kind: StreamKind,
}

/// What a stream computes.
pub enum StreamKind {
    /// Spectra, shared by the features that read them.
    Spectrum {
        /// Transform parameters.
        params: StftParams,
        /// The transform.
        spectrum: Spectrum,
        /// The window in single precision.
        window: Vec<f32>,
        /// Features and what they read.
        members: Vec<(usize, Quantity)>,
    },
    /// Magnitudes of a transform in double precision, shared by the features that read them.
    Exact {
        /// Transform parameters.
        params: StftParams,
        /// The transform of a frame that starts with its first sample.
        forward: Forward<f64>,
        /// Features.
        members: Vec<usize>,
    },
    /// A waveform feature.
    Wave {
        /// Index of the feature.
        member: usize,
    },
}

/// Everything that is computed for signals of one rate and number of channels.
pub struct Plan {
    /// Sample rate that features see, in Hz.
    pub sample_rate: f64,
    /// Channels that features see.
    pub channels: usize,
    /// Features in their order of output.
    pub features: Vec<PlannedFeature>,
    /// Passes over the signal.
    pub streams: Vec<StreamPlan>,
    /// The configuration.
    pub config: Arc<Config>,
}

impl Plan {
    /// Plans `config` for signals of `sample_rate` Hz and `channels` channels (as features see
    /// them, after the front end).
    ///
    /// # Errors
    /// A feature whose parameters are impossible at this rate, or coefficients that it has not.
    pub fn new(
        config: &Arc<Config>,
        sample_rate: f64,
        channels: usize,
    ) -> corsmal_dsp::Result<Self> {
        let mut features: Vec<PlannedFeature> = Vec::new();
        let mut streams: Vec<StreamPlan> = Vec::new();
        for (index, configured) in config.features.iter().enumerate() {
            let feature = configured.plan(sample_rate)?;
            let mut source = None;
            let mut labels = feature.labels.clone();
            match &feature.kernel {
                Kernel::Spectrum(params, quantity, _) => {
                    join_spectrum(&mut streams, params, (index, *quantity))?;
                }
                Kernel::Exact(params, _) => join_exact(&mut streams, params, index)?,
                Kernel::Wave(frame, pad, _) => streams.push(wave(frame, *pad, index)),
                Kernel::Whole(..) => {}
                Kernel::Derived(of, _) => {
                    source = features.iter().position(|f| f.name == *of);
                    labels = source.map(|s| features[s].labels.clone()).unwrap_or_default();
                }
            }
            let kept = match configured.coefficients() {
                None => [0, labels.len()],
                Some([_, end]) if end > labels.len() => {
                    let allowed = format!("at most {} for {}", labels.len(), configured.name());
                    return Err(corsmal_dsp::DspError::parameter("coefficients", end, allowed));
                }
                Some(range) => range,
            };
            let labels = labels[kept[0]..kept[1]].to_vec();
            let name = configured.name().to_string();
            features.push(PlannedFeature { name, feature, labels, kept, source });
        }
        Ok(Self { sample_rate, channels, features, streams, config: config.clone() })
    }

    /// Whether a feature needs the whole recording, which can then not be cut into spans.
    pub fn needs_whole(&self) -> bool {
        self.features.iter().any(|f| matches!(f.feature.kernel, Kernel::Whole(..)))
    }

    /// Samples between the frames of a feature; 0 for a vector.
    pub fn hop(&self, name: &str) -> f64 {
        let Some(mut index) = self.features.iter().position(|f| f.name == name) else {
            return 0.0;
        };
        while let Some(source) = self.features[index].source {
            index = source;
        }
        if let Kernel::Whole(extent, _) = &self.features[index].feature.kernel {
            return match extent {
                Extent::Frames(hop) => *hop,
                Extent::Vector => 0.0,
            };
        }
        let hop = |s: &StreamPlan| {
            let member = match &s.kind {
                StreamKind::Wave { member } => *member == index,
                StreamKind::Exact { members, .. } => members.contains(&index),
                StreamKind::Spectrum { members, .. } => members.iter().any(|(m, _)| *m == index),
            };
            member.then_some(s.framing.hop as f64)
        };
        self.streams.iter().find_map(hop).unwrap_or(0.0)
    }

    /// What the user should know of parameters that are possible but odd.
    pub fn warnings(&self) -> Vec<String> {
        let warning = |f: &PlannedFeature| match &f.feature.kernel {
            Kernel::Spectrum(_, _, kernel) => {
                kernel.warning().map(|warning| format!("{}: {warning}", f.name))
            }
            _ => None,
        };
        self.features.iter().filter_map(warning).collect()
    }

    /// The longest transform, where there is one.
    pub fn longest_transform(&self) -> Option<usize> {
        let n_fft = |s: &StreamPlan| match &s.kind {
            StreamKind::Spectrum { params, .. } | StreamKind::Exact { params, .. } => {
                Some(params.n_fft)
            }
            StreamKind::Wave { .. } => None,
        };
        self.streams.iter().filter_map(n_fft).max()
    }

    /// Names of the statistics of a recording: `feature[coefficient].statistic`, with `chN/` before
    /// where channels stay apart; a vector's values have no statistic in their names.
    pub fn summary_names(&self) -> Vec<String> {
        let Some(summary) = &self.config.summary else { return Vec::new() };
        if let Some(projection) = &self.config.projection {
            return projection.names();
        }
        let mut names = Vec::new();
        for feature in &self.features {
            let statistics: Vec<String> = match feature.is_vector() {
                true => vec![String::new()],
                false => summary.stats.iter().map(|stat| format!(".{stat}")).collect(),
            };
            for stat in &statistics {
                let series = if summary.average_channels { 1 } else { self.channels };
                for channel in 0..series {
                    let place = if series > 1 { format!("ch{channel}/") } else { String::new() };
                    names.extend(feature.labels.iter().map(|label| {
                        let index =
                            if label.is_empty() { String::new() } else { format!("[{label}]") };
                        format!("{place}{}{index}{stat}", feature.name)
                    }));
                }
            }
        }
        names
    }

    /// Samples before and after a position that frames anchored there may need.
    pub fn context(&self) -> (usize, usize) {
        let before = self.streams.iter().map(|s| s.framing.pad).max().unwrap_or(0);
        let after = self.streams.iter().map(|s| s.framing.length).max().unwrap_or(0);
        (before, after)
    }

    /// Samples that the first frame of every feature needs.
    pub fn shortest(&self) -> u64 {
        let needed = |s: &StreamPlan| {
            let Framing { length, pad, .. } = s.framing;
            length.saturating_sub(2 * pad).max(1) as u64
        };
        self.streams.iter().map(needed).max().unwrap_or(1)
    }
}

/// Adds a feature to the spectrum stream with these parameters, made where there is none.
fn join_spectrum(
    streams: &mut Vec<StreamPlan>,
    wanted: &StftParams,
    member: (usize, Quantity),
) -> corsmal_dsp::Result<()> {
    for stream in streams.iter_mut() {
        if let StreamKind::Spectrum { params, members, .. } = &mut stream.kind
            && params == wanted
        {
            members.push(member);
            return Ok(());
        }
    }
    let window =
        corsmal_dsp::window::padded_window(&wanted.window, wanted.win_length, wanted.n_fft)?;
    streams.push(StreamPlan {
        framing: transform_framing(wanted),
        kind: StreamKind::Spectrum {
            params: wanted.clone(),
            spectrum: Spectrum::new(wanted.n_fft)?,
            window: window.iter().map(|w| *w as f32).collect(),
            members: vec![member],
        },
    });
    Ok(())
}

/// Adds a feature to the exact transform with these parameters, made where there is none.
fn join_exact(
    streams: &mut Vec<StreamPlan>,
    wanted: &StftParams,
    member: usize,
) -> corsmal_dsp::Result<()> {
    for stream in streams.iter_mut() {
        if let StreamKind::Exact { params, members, .. } = &mut stream.kind
            && params == wanted
        {
            members.push(member);
            return Ok(());
        }
    }
    // Padding is the stream's: the transform sees whole frames.
    let forward = Forward::new(&StftParams { center: false, ..wanted.clone() })?;
    streams.push(StreamPlan {
        framing: transform_framing(wanted),
        kind: StreamKind::Exact { params: wanted.clone(), forward, members: vec![member] },
    });
    Ok(())
}

fn transform_framing(params: &StftParams) -> Framing {
    Framing {
        length: params.n_fft,
        hop: params.hop_length,
        pad: params.pad(),
        mode: params.pad_mode,
    }
}

fn wave(frame: &FrameParams, mode: PadMode, member: usize) -> StreamPlan {
    let framing =
        Framing { length: frame.frame_length, hop: frame.hop_length, pad: frame.pad(), mode };
    StreamPlan { framing, kind: StreamKind::Wave { member } }
}

/// Rows of a block and of its spectra, reused for every block of a worker.
#[derive(Default)]
pub struct Scratch {
    /// Windowed samples.
    pub frames: Vec<Row>,
    /// Power, magnitude or complex rows.
    pub spectrum: Vec<Row>,
    /// The rows of one feature.
    pub rows: Vec<Row>,
    /// Samples of frames that reach beyond the signal.
    pub edge: Vec<f32>,
}
