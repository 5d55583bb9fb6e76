//! A recording of any length reduced to at most a thousand columns while it streams by.

use corsmal_dsp::error::DspError;
use corsmal_dsp::mel::SparseBank;
use corsmal_dsp::stft::{StftParams, spectrogram};
use corsmal_plot::{ChannelPicture, RecordingPicture, WaveScale};
use ndarray::{Array2, s};

use crate::bands::FrequencyAxis;

/// Most columns kept; beyond that, neighbours are merged and columns get twice as long.
const MAX_COLUMNS: usize = 1000;
/// Bands in the picture.
const BANDS: usize = 64;
/// Length of the window, rounded up to a power of two samples.
const WINDOW_SECONDS: f64 = 0.02;
/// Levels shown below the loudest one, in dB.
const RANGE_DB: f32 = 80.0;

/// What of a recording is shown, and how.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Channels, in the order in which they are drawn; all where empty.
    pub channels: Vec<usize>,
    /// Axis of frequency.
    pub axis: FrequencyAxis,
    /// Highest frequency in Hz; half the sample rate by default and at most.
    pub fmax: Option<f64>,
    /// Scale of the waveforms.
    pub wave_scale: WaveScale,
    /// Start of what is pushed, in seconds, for the axis of time.
    pub start: f64,
}

impl Default for View {
    fn default() -> Self {
        Self {
            channels: Vec::new(),
            axis: FrequencyAxis::default(),
            fmax: None,
            wave_scale: WaveScale::Shared,
            start: 0.0,
        }
    }
}

/// Extremes and power of a stretch of time, per channel.
#[derive(Clone)]
struct Column {
    envelope: Vec<(f32, f32)>,
    /// `[channels, bands]`.
    power: Array2<f32>,
}

/// Collects columns. Each holds the extremes of all its samples and the power of one window around
/// its end (or, after merging, the mean of several), so that long recordings cost few transforms.
pub struct Overview {
    sample_rate: u32,
    view: View,
    /// Channels of what is pushed.
    pushed_channels: usize,
    highest: f64,
    stft: StftParams,
    bank: SparseBank,
    /// The latest `n_fft` frames, `[channels, n_fft]`, zeros before the start. Columns take their
    /// extremes from its middle, where the window of the transform is centred.
    recent: Array2<f32>,
    /// Frames per column.
    length: usize,
    columns: Vec<Column>,
    /// Extremes of the column being filled, and its frames so far.
    envelope: Vec<(f32, f32)>,
    filled: usize,
    /// Frames that entered `recent`.
    entered: u64,
}

const NOTHING: (f32, f32) = (f32::INFINITY, f32::NEG_INFINITY);

impl Overview {
    /// An empty overview of a recording of so many channels. Channels of the view that the recording
    /// does not have are left out.
    ///
    /// # Errors
    /// [`DspError`] for a sample rate or a highest frequency that leaves nothing to show.
    pub fn new(channels: usize, sample_rate: u32, view: View) -> Result<Self, DspError> {
        let window = (WINDOW_SECONDS * f64::from(sample_rate)) as usize;
        let n_fft = window.next_power_of_two().max(64);
        let rate = f64::from(sample_rate);
        let highest = view.fmax.map_or(rate / 2.0, |fmax| fmax.min(rate / 2.0));
        let mut view = view;
        if view.channels.is_empty() {
            view.channels = (0..channels).collect();
        }
        view.channels.retain(|channel| *channel < channels);
        let shown = view.channels.len();
        let bank = view.axis.bank(BANDS, n_fft, rate, highest)?;
        Ok(Self {
            sample_rate,
            view,
            pushed_channels: channels,
            highest,
            stft: StftParams { center: false, ..StftParams::new(n_fft, n_fft) },
            bank: SparseBank::new(&bank),
            recent: Array2::zeros((shown, n_fft)),
            length: n_fft / 8,
            columns: Vec::new(),
            envelope: vec![NOTHING; shown],
            filled: 0,
            entered: 0,
        })
    }

    /// Frames between entering `recent` and its middle.
    fn delay(&self) -> usize {
        self.stft.n_fft / 2
    }

    /// Adds interleaved samples of all channels; non-finite ones count as zero.
    ///
    /// # Errors
    /// [`DspError`] when a transform fails.
    pub fn push(&mut self, interleaved: &[f32]) -> Result<(), DspError> {
        let channels = self.pushed_channels;
        let delay = self.delay();
        let mut rest = interleaved;
        while !rest.is_empty() {
            let missing = (delay as u64).saturating_sub(self.entered) as usize;
            let step = if missing > 0 { missing } else { delay.min(self.length - self.filled) };
            let take = step.min(rest.len() / channels);
            if take == 0 {
                break;
            }
            let (now, later) = rest.split_at(take * channels);
            rest = later;
            self.remember(now, take);
            self.entered += take as u64;
            if missing > 0 {
                continue;
            }
            for (row, (low, high)) in self.recent.rows().into_iter().zip(&mut self.envelope) {
                for &x in row.slice(s![delay - take..delay]) {
                    (*low, *high) = (low.min(x), high.max(x));
                }
            }
            self.filled += take;
            if self.filled == self.length {
                self.finish_column()?;
            }
        }
        Ok(())
    }

    /// Shifts `frames` (at most `n_fft`) frames of the shown channels into `recent`.
    fn remember(&mut self, block: &[f32], frames: usize) {
        let n = self.recent.ncols();
        let rows = self.recent.rows_mut().into_iter().zip(&self.view.channels);
        for (mut row, channel) in rows {
            if let Some(row) = row.as_slice_mut() {
                row.copy_within(frames.., 0);
                let samples = block.chunks_exact(self.pushed_channels);
                for (to, x) in row[n - frames..].iter_mut().zip(samples) {
                    *to = if x[*channel].is_finite() { x[*channel] } else { 0.0 };
                }
            }
        }
    }

    fn finish_column(&mut self) -> Result<(), DspError> {
        let power = self.bank.apply(spectrogram(self.recent.view(), &self.stft, 2.0)?.view());
        let channels = self.envelope.len();
        let envelope = std::mem::replace(&mut self.envelope, vec![NOTHING; channels]);
        self.columns.push(Column { envelope, power: power.slice(s![.., .., 0]).to_owned() });
        self.filled = 0;
        if self.columns.len() == MAX_COLUMNS {
            self.columns = self.columns.chunks_exact(2).map(|c| c[0].merged(&c[1])).collect();
            self.length *= 2;
        }
        Ok(())
    }

    /// The picture of everything that was pushed. `notes` gives what is odd about a channel.
    ///
    /// # Errors
    /// [`DspError`] when a transform fails.
    pub fn finish(
        mut self,
        title: String,
        subtitle: String,
        notes: impl Fn(usize) -> Vec<String>,
    ) -> Result<RecordingPicture, DspError> {
        let frames = self.entered;
        self.push(&vec![0.0; self.delay() * self.pushed_channels])?;
        if self.filled > 0 {
            self.finish_column()?;
        }
        let all = self.columns.iter().flat_map(|c| &c.power);
        let loudest = all.fold(0.0f32, |a, b| a.max(*b)).max(f32::MIN_POSITIVE);
        let decibels = |power: f32| 10.0 * (power / loudest).max(1e-12).log10();
        let channel = |(row, number): (usize, &usize)| {
            let level = |(b, t): (usize, usize)| decibels(self.columns[t].power[[row, b]]);
            ChannelPicture {
                label: format!("ch {number}"),
                notes: notes(*number),
                envelope: self.columns.iter().map(|column| column.envelope[row]).collect(),
                levels: Array2::from_shape_fn((BANDS, self.columns.len()), level),
            }
        };
        let seconds = frames as f64 / f64::from(self.sample_rate);
        Ok(RecordingPicture {
            title,
            subtitle,
            time: (self.view.start, self.view.start + seconds),
            frequencies: self.view.axis.labelled(self.highest),
            level_range: (-RANGE_DB, 0.0),
            level_label: "dB re loudest band".into(),
            wave_scale: self.view.wave_scale,
            channels: self.view.channels.iter().enumerate().map(channel).collect(),
        })
    }
}

impl Column {
    fn merged(&self, next: &Self) -> Self {
        let extremes = self.envelope.iter().zip(&next.envelope);
        Self {
            envelope: extremes.map(|(a, b)| (a.0.min(b.0), a.1.max(b.1))).collect(),
            power: (&self.power + &next.power) * 0.5,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tone(frames: usize, channels: usize, hz: f32) -> Vec<f32> {
        let sample = |i: usize| {
            let (t, c) = (i / channels, i % channels);
            0.5 / (c + 1) as f32 * (std::f32::consts::TAU * hz * t as f32 / 16_000.0).sin()
        };
        (0..frames * channels).map(sample).collect()
    }

    fn picture(samples: &[f32], channels: usize, split: usize) -> RecordingPicture {
        viewed(samples, channels, split, View::default())
    }

    fn viewed(samples: &[f32], channels: usize, split: usize, view: View) -> RecordingPicture {
        let mut overview = Overview::new(channels, 16_000, view).unwrap();
        for block in samples.chunks(split * channels) {
            overview.push(block).unwrap();
        }
        overview.finish("t".into(), "s".into(), |c| vec![format!("note {c}")]).unwrap()
    }

    #[test]
    fn a_tone_lies_at_its_frequency_and_level() {
        let picture = picture(&tone(16_000, 2, 1000.0), 2, 500);
        assert_eq!(picture.time, (0.0, 1.0));
        let (_, place) = picture.frequencies.iter().find(|(hz, _)| *hz == 1000.0).unwrap();
        let second = &picture.channels[1];
        assert_eq!(second.levels.nrows(), BANDS);
        assert_eq!(second.levels.ncols(), 250);
        for column in second.levels.columns().into_iter().skip(5).take(240) {
            let best = (0..BANDS).max_by(|a, b| column[*a].total_cmp(&column[*b])).unwrap();
            assert!((best as f64 + 0.5 - place * BANDS as f64).abs() < 1.5, "band {best}");
            // Half the amplitude of the louder channel.
            assert!((column[best] + 6.02).abs() < 0.2, "{}", column[best]);
        }
        // A column of 64 samples holds four periods.
        assert!(second.envelope.iter().all(|(low, high)| (high - low - 0.5).abs() < 0.01));
    }

    #[test]
    fn long_recordings_keep_few_columns_and_all_extremes() {
        let mut samples = tone(800_000, 1, 440.0);
        samples[777_777] = 0.9;
        let whole = picture(&samples, 1, 800_000);
        let columns = whole.channels[0].envelope.len();
        assert!((MAX_COLUMNS / 2 - 1..=MAX_COLUMNS).contains(&columns), "{columns}");
        let length = 800_000usize.div_ceil(columns).next_power_of_two();
        assert_eq!(whole.channels[0].envelope[777_777 / length].1, 0.9);
        let split = picture(&samples, 1, 12_345);
        assert_eq!(split.channels[0].envelope, whole.channels[0].envelope);
        assert_eq!(split.channels[0].levels, whole.channels[0].levels);
    }

    #[test]
    fn a_view_has_its_channels_axis_and_start() {
        let view = View {
            channels: vec![2, 0, 7],
            axis: FrequencyAxis::Linear,
            fmax: Some(4000.0),
            start: 3.5,
            ..View::default()
        };
        let shown = viewed(&tone(16_000, 3, 1000.0), 3, 777, view);
        let whole = picture(&tone(16_000, 3, 1000.0), 3, 500);
        let labels: Vec<_> = shown.channels.iter().map(|c| c.label.as_str()).collect();
        assert_eq!(labels, ["ch 2", "ch 0"]);
        assert_eq!(shown.channels[0].notes, ["note 2"]);
        assert_eq!(shown.channels[0].envelope, whole.channels[2].envelope);
        assert_eq!(shown.time, (3.5, 4.5));
        // A quarter of the way up to 4 kHz.
        let column = shown.channels[1].levels.column(100);
        let best = (0..BANDS).max_by(|a, b| column[*a].total_cmp(&column[*b])).unwrap();
        assert!((15..=16).contains(&best), "{best}");
    }

    #[test]
    fn nothing_and_rubbish_are_drawn_as_silence() {
        assert!(picture(&[], 3, 1).channels.iter().all(|c| c.envelope.is_empty()));
        let rubbish = picture(&[f32::NAN; 4000], 1, 100);
        assert!(rubbish.channels[0].envelope.iter().all(|e| *e == (0.0, 0.0)));
        assert!(rubbish.channels[0].levels.iter().all(|v| v.is_finite()));
    }
}
