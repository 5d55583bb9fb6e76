//! A configuration planned for one sample rate and number of channels: transforms, windows, filter
//! banks, all made once and shared by every worker.

use std::sync::{Arc, OnceLock};

use corsmal_dsp::DspError;

use super::signal_chain::SignalChain;
use super::stream::{ExactMember, Framing, SharedStreams, SpectrumMember, Stream};
use super::workspace::Workspaces;
use crate::config::Config;
use crate::features::{Derived, Extent, Feature, Finish, Kernel, WholeKernel};

/// A feature with its place in the output. Its kernel is in the stream that it reads.
pub struct PlannedFeature {
    /// Name in outputs.
    pub name: String,
    /// Values stored per frame and channel before finishing; 0 where it reads another feature.
    pub raw_rows: usize,
    /// Whether pairs of values are real and imaginary parts.
    pub complex: bool,
    /// Coefficients of a finished frame, its own or those of its source.
    pub finished: usize,
    /// Finishing, where values depend on the maximum of the recording.
    pub finish: Option<Box<dyn Finish>>,
    /// What is computed of finished frames in their order of time.
    pub derived: Option<Box<dyn Derived>>,
    /// Index of the feature whose finished frames it reads.
    pub source: Option<usize>,
    /// Coefficients before some are kept.
    pub coefficients: usize,
    /// Coefficients kept, `[first, end)`.
    pub kept: [usize; 2],
    /// Names of the coefficients kept.
    pub labels: Vec<String>,
    /// Where its frames lie.
    pub extent: Extent,
}

impl PlannedFeature {
    /// Whether it is one vector a recording, which statistics leave as it is.
    pub fn is_vector(&self) -> bool {
        self.extent == Extent::Vector && self.source.is_none()
    }
}

/// A feature of the whole recording.
pub struct WholeFeature {
    /// Its index.
    pub feature: usize,
    /// What it computes.
    pub kernel: Box<dyn WholeKernel>,
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
    pub streams: Vec<Box<dyn Stream>>,
    /// Features that are computed at the end of the signal.
    pub whole: Vec<WholeFeature>,
    /// The configuration.
    pub config: Arc<Config>,
    warnings: Vec<String>,
    /// What extractors have worked in.
    pub(super) workspaces: Arc<Workspaces>,
    summary_names: OnceLock<Arc<[String]>>,
}

impl Plan {
    /// Plans `config` for signals of `sample_rate` Hz and `channels` channels (as features see
    /// them, after the signal chain).
    ///
    /// # Errors
    /// A feature whose parameters are impossible at this rate, or coefficients beyond the last.
    pub fn new(
        config: &Arc<Config>,
        sample_rate: f64,
        channels: usize,
    ) -> corsmal_dsp::Result<Self> {
        let mut features: Vec<PlannedFeature> = Vec::new();
        let mut streams = SharedStreams::default();
        let (mut whole, mut warnings) = (Vec::new(), Vec::new());
        for (index, configured) in config.features.iter().enumerate() {
            let feature = configured.plan(sample_rate)?;
            let name = configured.name().to_string();
            let source = match feature.source() {
                None => None,
                Some(of) => {
                    let real = |f: &PlannedFeature| f.name == of && !f.complex;
                    let refuse =
                        || DspError::parameter("of", of, "an earlier feature of real values");
                    Some(features.iter().position(real).ok_or_else(refuse)?)
                }
            };
            let earlier = source.map_or(&[][..], |s| &features[s].labels);
            let finished = if source.is_some() { earlier.len() } else { feature.labels.len() };
            let labels = feature.output_labels(earlier);
            let kept = match configured.coefficients() {
                None => [0, labels.len()],
                Some([_, end]) if end > labels.len() => {
                    let allowed = format!("at most {} for {name}", labels.len());
                    return Err(DspError::parameter("coefficients", end, allowed));
                }
                Some(range) => range,
            };
            let Feature { kernel, raw_rows: rows, complex, finish, derived, .. } = feature;
            warnings.extend(kernel.warning().map(|warning| format!("{name}: {warning}")));
            let extent = match kernel {
                Kernel::Spectrum(params, quantity, kernel) => {
                    let member = SpectrumMember { feature: index, rows, complex, quantity, kernel };
                    streams.spectrum(&params, member)?;
                    Extent::Frames(params.hop_length as f64)
                }
                Kernel::Exact(params, kernel) => {
                    streams.exact(&params, ExactMember { feature: index, rows, kernel })?;
                    Extent::Frames(params.hop_length as f64)
                }
                Kernel::Wave(frame, mode, kernel) => {
                    streams.wave(&frame, mode, index, kernel);
                    Extent::Frames(frame.hop_length as f64)
                }
                Kernel::Whole(extent, kernel) => {
                    whole.push(WholeFeature { feature: index, kernel });
                    extent
                }
                Kernel::Earlier(_) => source.map_or(Extent::Vector, |s| features[s].extent),
            };
            features.push(PlannedFeature {
                name,
                raw_rows: rows,
                complex,
                finished,
                finish,
                derived,
                source,
                coefficients: labels.len(),
                kept,
                labels: labels[kept[0]..kept[1]].to_vec(),
                extent,
            });
        }
        let (streams, config) = (streams.into_streams(), config.clone());
        let workspaces = Arc::default();
        let summary_names = OnceLock::new();
        Ok(Self {
            sample_rate,
            channels,
            features,
            streams,
            whole,
            config,
            warnings,
            workspaces,
            summary_names,
        })
    }

    /// The same plan, whose extractors work in memory that they share with those of other plans.
    pub(super) fn sharing(self, workspaces: Arc<Workspaces>) -> Self {
        Self { workspaces, ..self }
    }

    /// Whether a feature needs the whole recording, which can then not be cut into spans.
    pub fn needs_whole(&self) -> bool {
        !self.whole.is_empty()
    }

    /// How many of the first of a signal's `frames` frames may be left out: no value depends on them.
    pub fn unread(&self, frames: u64) -> u64 {
        match &self.whole[..] {
            [whole] if self.streams.is_empty() => whole.kernel.unread(frames),
            _ => 0,
        }
    }

    /// Why frames cannot be computed from a piece of a recording as they are of the whole; `None` where
    /// every frame depends on a bounded number of samples around it.
    pub fn piece_refusal(&self) -> Option<String> {
        if self.config.summary.is_some() {
            return Some(
                "statistics are computed over the whole recording: leave out [summary]".into(),
            );
        }
        if let Some(reason) = SignalChain::piece_refusal(&self.config.signal) {
            return Some(reason.into());
        }
        if let Some(whole) = self.whole.first() {
            let name = &self.features[whole.feature].name;
            return Some(format!("{name} is computed from the whole recording at once"));
        }
        self.features.iter().find_map(|feature| {
            let name = &feature.name;
            if feature.derived.is_some() {
                return Some(format!("{name} depends on neighbouring frames"));
            }
            let finish = feature.finish.as_ref().filter(|finish| finish.needs_peaks())?;
            let remedy = finish.without_peaks().map(|set| format!(": set its {set}"));
            let remedy = remedy.unwrap_or_default();
            Some(format!("{name} depends on the maximum of the whole recording{remedy}"))
        })
    }

    /// Samples between the frames of a feature; 0 for a vector.
    pub fn hop(&self, name: &str) -> f64 {
        match self.features.iter().find(|f| f.name == name).map(|f| f.extent) {
            Some(Extent::Frames(hop)) => hop,
            Some(Extent::Vector) | None => 0.0,
        }
    }

    /// What the user should know of parameters that are possible but odd.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The longest transform, where there is one.
    pub fn longest_transform(&self) -> Option<usize> {
        self.streams.iter().filter_map(|stream| stream.n_fft()).max()
    }

    /// Names of the statistics of a recording: `feature[coefficient].statistic`, with `chN/` before
    /// where channels stay apart; a vector's values have no statistic in their names.
    pub fn summary_names(&self) -> Arc<[String]> {
        self.summary_names.get_or_init(|| self.make_summary_names().into()).clone()
    }

    fn make_summary_names(&self) -> Vec<String> {
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
        let before = self.streams.iter().map(|s| s.framing().pad).max().unwrap_or(0);
        let after = self.streams.iter().map(|s| s.framing().length).max().unwrap_or(0);
        (before, after)
    }

    /// Samples that the first frame of every feature needs.
    pub fn shortest(&self) -> u64 {
        let needed =
            |framing: Framing| framing.length.saturating_sub(2 * framing.pad).max(1) as u64;
        self.streams.iter().map(|s| needed(s.framing())).max().unwrap_or(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Only features of shared spectra said so.
    #[test]
    fn empty_mel_filters_are_said_of_every_feature() {
        for kind in ["melspectrogram", "mfcc", "pcen", "spectral_flux", "onset_strength"] {
            let warnings = |n_fft: usize| {
                let toml = format!("[features.{kind}]\nn_fft = {n_fft}\n");
                let config = Arc::new(Config::with_overrides(&toml, "test", &[]).unwrap());
                Plan::new(&config, 22_050.0, 1).unwrap().warnings().to_vec()
            };
            let said = warnings(256);
            let expected = format!("{kind}: 20 of 128 mel filters are empty");
            assert!(said.len() == 1 && said[0].starts_with(&expected), "{kind}: {said:?}");
            assert!(warnings(2048).is_empty(), "{kind}");
        }
    }
}
