//! Pictures that `inspect` draws.

use std::path::PathBuf;

use clap::ValueEnum;
use corsmal_files::draft;
use corsmal_plot::{DEFAULT_DPI, Figure, WaveScale, to_pdf, to_png, to_svg};
use corsmal_report::{FrequencyAxis, View};

use crate::failure::Failure;
use crate::publish;

/// Arguments of `inspect` that are about the picture.
#[derive(clap::Args)]
pub struct PictureArgs {
    /// Also draw a picture, as .png, .svg or .pdf: of a recording, the waveform and spectrogram of
    /// each channel and what is wrong with it; of a feature file, the features of a recording.
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    /// Replace an existing picture.
    #[arg(long, requires = "picture")]
    overwrite: bool,
    /// Channels to draw, such as 0,3 or 0-3; all by default.
    #[arg(long, value_name = "LIST", requires = "picture", value_parser = channels)]
    channels: Option<Channels>,
    /// Start of the stretch to draw, in seconds.
    #[arg(long, value_name = "SECONDS", requires = "picture", value_parser = seconds)]
    start: Option<f64>,
    /// End of the stretch to draw, in seconds.
    #[arg(long, value_name = "SECONDS", requires = "picture", value_parser = seconds)]
    end: Option<f64>,
    /// Frequency axis of a spectrogram.
    /// [default: mel]
    #[arg(long, value_enum, requires = "picture")]
    frequency_axis: Option<Axis>,
    /// Highest frequency of a spectrogram, in Hz; half the sample rate by default.
    #[arg(long, value_name = "HZ", requires = "picture", value_parser = hertz)]
    fmax: Option<f64>,
    /// Draw all waveforms on one scale, or each channel on its own.
    /// [default: shared]
    #[arg(long, value_enum, requires = "picture")]
    wave_scale: Option<Scale>,
    /// Pixels per inch of a PNG; the picture is about 11 inches wide.
    #[arg(long, value_name = "N", default_value_t = DEFAULT_DPI, requires = "picture",
          value_parser = clap::value_parser!(u16).range(20..=1200))]
    dpi: u16,
    /// Heading of the picture; the name of the file or recording by default.
    #[arg(long, value_name = "TEXT", requires = "picture")]
    title: Option<String>,
    /// The recording of a feature file to draw, by its id; the first by default.
    #[arg(long, value_name = "ID", requires = "picture")]
    recording: Option<String>,
}

#[derive(Clone, Copy, ValueEnum)]
enum Axis {
    /// The mel scale.
    Mel,
    /// Octaves of equal height.
    Log,
    /// Hertz of equal height.
    Linear,
}

#[derive(Clone, Copy, ValueEnum)]
enum Scale {
    /// One scale for all, to compare levels.
    Shared,
    /// Each channel fills its own height.
    Channel,
}

/// Channel numbers; a type of its own so that clap does not take it for a repeated option.
#[derive(Clone)]
struct Channels(Vec<usize>);

fn channels(text: &str) -> Result<Channels, String> {
    let fault =
        || format!("expected channel numbers, counted from 0, such as 0,3 or 0-3, found '{text}'");
    let mut list = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let number = |text: &str| text.trim().parse::<u8>().map_err(|_| fault());
        let (first, last) = (number(first)?, number(last)?);
        if first > last {
            return Err(fault());
        }
        list.extend((first..=last).map(usize::from));
    }
    Ok(Channels(list))
}

fn seconds(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|v| v.is_finite() && *v >= 0.0);
    value.ok_or_else(|| format!("expected seconds from the start, 0 or more, found '{text}'"))
}

fn hertz(text: &str) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0);
    value.ok_or_else(|| format!("expected a frequency above 0, found '{text}'"))
}

/// Format of a picture, by its file name.
#[derive(Clone, Copy)]
enum PictureFormat {
    Png,
    Svg,
    Pdf,
}

/// A picture to be written.
pub struct Picture {
    path: PathBuf,
    format: PictureFormat,
    dpi: u16,
    /// Its heading, where one was given.
    pub title: Option<String>,
    /// The recording of a feature file, where one was named.
    pub recording: Option<String>,
    /// What of a recording is drawn, and how.
    pub view: View,
    /// End of the stretch in seconds; the end of the recording where there is none.
    pub end: Option<f64>,
    /// Options that choose what is drawn.
    given: Vec<&'static str>,
}

impl PictureArgs {
    /// The picture, if one is asked for. Refuses names, folders and stretches that cannot work before
    /// anything is read.
    pub fn check(self) -> Result<Option<Picture>, Failure> {
        let Some(path) = self.picture else { return Ok(None) };
        let name = path.display().to_string();
        let extension = path.extension().map(|e| e.to_ascii_lowercase());
        let format = match extension.as_deref().and_then(|e| e.to_str()) {
            Some("png") => PictureFormat::Png,
            Some("svg") => PictureFormat::Svg,
            Some("pdf") => PictureFormat::Pdf,
            _ => {
                let message = format!("--picture {name}: must end in .png, .svg or .pdf");
                return Err(Failure::new(message));
            }
        };
        publish::check(&path, self.overwrite)?;
        let start = self.start.unwrap_or(0.0);
        if let Some(end) = self.end.filter(|end| *end <= start) {
            let message = format!("--end {end} is not after --start {start}: nothing to draw");
            return Err(Failure::new(message));
        }
        let given = [
            ("--channels", self.channels.is_some()),
            ("--start", self.start.is_some()),
            ("--end", self.end.is_some()),
            ("--frequency-axis", self.frequency_axis.is_some()),
            ("--fmax", self.fmax.is_some()),
            ("--wave-scale", self.wave_scale.is_some()),
            ("--recording", self.recording.is_some()),
        ];
        let given = given.into_iter().filter(|(_, given)| *given).map(|(option, _)| option);
        let view = View {
            channels: self.channels.map(|c| c.0).unwrap_or_default(),
            axis: match self.frequency_axis.unwrap_or(Axis::Mel) {
                Axis::Mel => FrequencyAxis::Mel,
                Axis::Log => FrequencyAxis::Log,
                Axis::Linear => FrequencyAxis::Linear,
            },
            fmax: self.fmax,
            wave_scale: match self.wave_scale.unwrap_or(Scale::Shared) {
                Scale::Shared => WaveScale::Shared,
                Scale::Channel => WaveScale::Channel,
            },
            start,
        };
        let (title, recording) = (self.title, self.recording);
        let (dpi, end, given) = (self.dpi, self.end, given.collect());
        Ok(Some(Picture { path, format, dpi, title, recording, view, end, given }))
    }
}

impl Picture {
    /// Options for pictures of recordings.
    pub const OF_RECORDINGS: [&'static str; 6] =
        ["--channels", "--start", "--end", "--frequency-axis", "--fmax", "--wave-scale"];

    /// Refuses options that a picture of such a thing does not have.
    pub fn takes(&self, what: &str, options: &[&str]) -> Result<(), Failure> {
        match self.given.iter().find(|option| !options.contains(option)) {
            None => Ok(()),
            Some(option) => {
                Err(Failure::new(format!("{option} has no effect on a picture of {what}")))
            }
        }
    }

    /// Refuses channels that a recording of so many does not have.
    pub fn check_channels(&self, channels: usize) -> Result<(), Failure> {
        match self.view.channels.iter().find(|channel| **channel >= channels) {
            None => Ok(()),
            Some(channel) => Err(Failure::new(format!(
                "--channels: there is no channel {channel}; the recording has {channels}, counted \
                 from 0"
            ))),
        }
    }

    /// Draws `figure` and writes the file.
    pub fn save(&self, figure: &dyn Figure) -> Result<(), Failure> {
        let bytes = match self.format {
            PictureFormat::Png => to_png(figure, self.dpi)?,
            PictureFormat::Svg => to_svg(figure)?.into_bytes(),
            PictureFormat::Pdf => to_pdf(figure)?,
        };
        draft::write(&self.path, &bytes)?;
        Ok(())
    }
}
