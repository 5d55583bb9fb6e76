//! A recording read once: its format, its health and, on request, its picture.

use std::ops::Range;
use std::path::Path;

use corsmal_audio::{AudioError, AudioSpec, Health, HealthMeter, Repair, open};
use corsmal_plot::RecordingPicture;

use crate::overview::{Overview, View};
use crate::{ReportError, Result};

/// Frames read at once.
const BLOCK: usize = 8192;

/// What is known of a recording after it was read.
#[derive(Debug, Clone)]
pub struct Look {
    /// Format, rate, channels.
    pub spec: AudioSpec,
    /// Levels, clipping, silence, dead and copied channels.
    pub health: Health,
    /// Repairs that the reader made.
    pub repairs: usize,
    /// That of them by which samples are missing, or may be.
    pub loss: Option<Repair>,
    /// Waveforms and spectrograms of each excerpt asked for.
    pub pictures: Vec<RecordingPicture>,
}

impl Look {
    /// Length in seconds.
    pub fn seconds(&self) -> f64 {
        self.health.frames as f64 / f64::from(self.spec.sample_rate)
    }

    /// The level of the loudest channel's peak in dB relative to full scale; `None` for silence.
    pub fn peak_dbfs(&self) -> Option<f64> {
        self.health.channels.iter().filter_map(|c| c.peak_dbfs).max_by(f64::total_cmp)
    }

    /// What is odd about any channel, channels with the same fault together.
    pub fn notes(&self) -> Vec<String> {
        let several = self.health.channels.len() > 1;
        let mut faults: Vec<(String, Vec<String>)> = Vec::new();
        for channel in 0..self.health.channels.len() {
            for note in self.health.notes(channel) {
                match faults.iter_mut().find(|(fault, _)| *fault == note) {
                    Some((_, channels)) => channels.push(channel.to_string()),
                    None => faults.push((note, vec![channel.to_string()])),
                }
            }
        }
        let told = faults.into_iter().map(|(fault, channels)| match several {
            true => format!("ch {} {fault}", channels.join(", ")),
            false => fault,
        });
        told.collect()
    }
}

/// What is drawn of a recording.
#[derive(Debug, Clone, Default)]
pub struct Excerpt {
    /// How, and where it begins.
    pub view: View,
    /// Where it ends, in seconds; the end of the recording where there is none.
    pub end: Option<f64>,
}

impl Excerpt {
    fn frames(&self, sample_rate: u32) -> Range<u64> {
        let frame = |seconds: f64| (seconds * f64::from(sample_rate)).round() as u64;
        frame(self.view.start)..self.end.map_or(u64::MAX, frame)
    }
}

/// Reads a recording.
///
/// # Errors
/// [`ReportError::Audio`] when it cannot be read, [`ReportError::Spectrum`] when a view leaves nothing
/// to show.
pub fn look(path: &Path, excerpts: Vec<Excerpt>) -> Result<Look> {
    let audio = |source: AudioError| ReportError::Audio { path: path.into(), source };
    let spectrum = |source| ReportError::Spectrum { path: path.into(), source };
    let mut source = open(path).map_err(audio)?;
    let spec = source.spec().clone();
    let channels = usize::from(spec.channels);
    let mut meter = HealthMeter::new(channels, spec.sample_rate);
    let begin = |excerpt: Excerpt| {
        let frames = excerpt.frames(spec.sample_rate);
        Ok((frames, Overview::new(channels, spec.sample_rate, excerpt.view).map_err(spectrum)?))
    };
    let mut overviews = excerpts.into_iter().map(begin).collect::<Result<Vec<_>>>()?;
    let mut read = 0;
    let mut block = vec![0.0; BLOCK * channels];
    loop {
        let frames = source.read(&mut block).map_err(audio)?;
        if frames == 0 {
            break;
        }
        let samples = &block[..frames * channels];
        meter.push(samples);
        for (wanted, overview) in &mut overviews {
            let within = |frame: u64| (frame.saturating_sub(read) as usize).min(frames);
            let (first, end) = (within(wanted.start), within(wanted.end));
            if first < end {
                overview.push(&samples[first * channels..end * channels]).map_err(spectrum)?;
            }
        }
        read += frames as u64;
    }
    let health = meter.finish();
    let drawn = overviews.into_iter().map(|(_, overview)| {
        let title = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let facts = format!(
            "{} · {} ch · {} Hz · {:.2} s",
            spec.format,
            spec.channels,
            spec.sample_rate,
            health.frames as f64 / f64::from(spec.sample_rate)
        );
        overview.finish(title, facts, |channel| health.notes(channel)).map_err(spectrum)
    });
    let pictures = drawn.collect::<Result<Vec<_>>>()?;
    let reading = source.health();
    let (repairs, loss) = (reading.repairs.len(), reading.loss().copied());
    Ok(Look { spec, health, repairs, loss, pictures })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_recording_is_measured_and_drawn() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("x.wav");
        let spec = hound::WavSpec {
            channels: 3,
            sample_rate: 8000,
            bits_per_sample: 16,
            sample_format: hound::SampleFormat::Int,
        };
        let mut writer = hound::WavWriter::create(&path, spec).unwrap();
        for t in 0..4000 {
            let tone = (std::f32::consts::TAU * 100.0 * t as f32 / 8000.0).sin();
            for sample in [(tone * 16_384.0) as i16, 0, 0] {
                writer.write_sample(sample).unwrap();
            }
        }
        writer.finalize().unwrap();
        let part = Excerpt { view: View { start: 0.125, ..View::default() }, end: Some(0.25) };
        let found = look(&path, vec![Excerpt::default(), part]).unwrap();
        assert_eq!(found.seconds(), 0.5);
        assert!((found.peak_dbfs().unwrap() + 6.02).abs() < 0.1);
        assert_eq!(found.notes(), ["ch 1, 2 dead (constant)"]);
        let times: Vec<_> = found.pictures.iter().map(|picture| picture.time).collect();
        assert_eq!((found.pictures[0].channels.len(), times), (3, vec![(0.0, 0.5), (0.125, 0.25)]));
        assert!(look(&path, Vec::new()).unwrap().pictures.is_empty());
        std::fs::write(&path, "RIFF").unwrap();
        assert!(matches!(look(&path, Vec::new()), Err(ReportError::Audio { .. })));
    }
}
