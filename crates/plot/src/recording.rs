//! A recording at a glance: waveform and spectrogram of each channel over one time axis.

use ndarray::Array2;

use crate::axis::{below, color_bar, share};
use crate::color::{Paint, sequential};
use crate::drawing::{Anchor, Drawing, Pixels, Rect, TextStyle};
use crate::error::PlotError;
use crate::export::Figure;
use crate::font;
use crate::ticks::{apart, frequency, signed};

/// One channel of a [`RecordingPicture`].
#[derive(Debug, Clone)]
pub struct ChannelPicture {
    /// Name at the left.
    pub label: String,
    /// What is odd about it, such as "clipped in 3 places"; drawn over the waveform.
    pub notes: Vec<String>,
    /// Smallest and largest sample of each column.
    pub envelope: Vec<(f32, f32)>,
    /// Level in dB, `[bands, columns]`, lowest band first; NaN is drawn as the lowest level.
    pub levels: Array2<f32>,
}

/// What the height of a waveform means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WaveScale {
    /// The same for all channels: levels can be compared.
    Shared,
    /// Each channel fills its own height: quiet channels can be seen beside loud ones.
    Channel,
}

/// What to draw; all channels share the axes of time, frequency and level.
#[derive(Debug, Clone)]
pub struct RecordingPicture {
    /// Heading.
    pub title: String,
    /// A line of facts below it.
    pub subtitle: String,
    /// Start and end of the time axis in seconds.
    pub time: (f64, f64),
    /// Frequencies in Hz that may be labelled, the most wanted first, with their place on the axis
    /// of bands, 0 at the bottom to 1 at the top.
    pub frequencies: Vec<(f64, f64)>,
    /// Levels in dB of the darkest and the lightest colour.
    pub level_range: (f32, f32),
    /// Name of the levels with their unit.
    pub level_label: String,
    /// Scale of the waveforms.
    pub wave_scale: WaveScale,
    /// The channels, from top to bottom.
    pub channels: Vec<ChannelPicture>,
}

const LEFT: f64 = 112.0;
const WIDTH: f64 = 840.0;
const RIGHT: f64 = 92.0;
const TOP: f64 = 64.0;
const BOTTOM: f64 = 46.0;
const GAP: f64 = 3.0;

impl RecordingPicture {
    /// Heights of waveform, spectrogram and the space below: less for many channels.
    fn heights(&self) -> (f64, f64, f64) {
        match self.channels.len() {
            0..=2 => (84.0, 190.0, 22.0),
            3..=4 => (56.0, 120.0, 18.0),
            5..=8 => (40.0, 76.0, 12.0),
            _ => (28.0, 48.0, 10.0),
        }
    }

    fn bottom(&self) -> f64 {
        let (wave, mel, space) = self.heights();
        TOP + (wave + GAP + mel + space) * self.channels.len() as f64 - space
    }

    fn draw_wave(&self, on: &mut Drawing, channel: &ChannelPicture, wave: Rect, peak: f32) {
        let middle = wave.y + wave.h / 2.0;
        on.rect(Rect::new(wave.x, middle - 0.5, wave.w, 1.0), Paint::Grid);
        let peak = f64::from(if peak > 0.0 { peak } else { 1.0 });
        let half = wave.h / 2.0 / peak;
        let spans: Vec<_> = channel
            .envelope
            .iter()
            .map(|(low, high)| (middle - f64::from(*high) * half, middle - f64::from(*low) * half))
            .collect();
        on.envelope(wave.x, wave.w / spans.len().max(1) as f64, &spans, Paint::Series(2));
        for (value, y) in [(peak, wave.y), (0.0, middle), (-peak, wave.bottom())] {
            // In low plots zero would run into its neighbours.
            if wave.h < 40.0 && value == 0.0 {
                continue;
            }
            on.rect(Rect::new(wave.x - 4.0, y - 0.5, 4.0, 1.0), Paint::Muted);
            let text = if value == 0.0 { "0".into() } else { signed(&short(value)) };
            let shift = if value > 0.0 {
                7.0
            } else if value < 0.0 {
                0.5
            } else {
                3.5
            };
            let style = TextStyle { size: 9.5, ..TextStyle::tick(Anchor::End) };
            on.text(wave.x - 7.0, y + shift, &text, style);
        }
        let name = TextStyle { bold: true, ..TextStyle::new(11.5, Paint::Ink, Anchor::Start) };
        on.text(14.0, middle + 4.0, &font::fitted(&channel.label, 11.5, true, 56.0), name);
        if !channel.notes.is_empty() {
            on.note(wave.right() - 2.0, wave.y + 12.0, &channel.notes.join(" · "));
        }
    }

    fn draw_levels(
        &self,
        on: &mut Drawing,
        channel: &ChannelPicture,
        mel: Rect,
    ) -> Result<(), PlotError> {
        let (bands, columns) = channel.levels.dim();
        let (low, high) = self.level_range;
        let color = |v: f32| sequential((v - low) / (high - low));
        if bands > 0 && columns > 0 {
            let rows = (0..bands).rev();
            let colors = rows.flat_map(|b| channel.levels.row(b).to_vec()).map(color).collect();
            on.image(mel, &Pixels { width: columns, height: bands, colors })?;
        }
        for (hz, place) in apart(&self.frequencies, mel.h, 13.0) {
            let y = mel.bottom() - place * mel.h;
            on.rect(Rect::new(mel.x - 4.0, y - 0.5, 4.0, 1.0), Paint::Muted);
            let style = TextStyle { size: 10.0, ..TextStyle::tick(Anchor::End) };
            on.text(mel.x - 7.0, y + 3.5, &frequency(hz), style);
        }
        Ok(())
    }
}

/// A value with two digits that matter.
fn short(value: f64) -> String {
    let decimals = (1.0 - value.abs().log10().floor()).clamp(0.0, 6.0) as usize;
    format!("{value:.decimals$}")
}

fn peak_of(channel: &ChannelPicture) -> f32 {
    channel.envelope.iter().flat_map(|(low, high)| [low.abs(), high.abs()]).fold(0.0, f32::max)
}

impl Figure for RecordingPicture {
    fn size(&self) -> (f64, f64) {
        (LEFT + WIDTH + RIGHT, self.bottom().max(TOP + 40.0) + BOTTOM)
    }

    fn title(&self) -> &str {
        &self.title
    }

    fn draw(&self, on: &mut Drawing) -> Result<(), PlotError> {
        let room = LEFT + WIDTH + RIGHT - 28.0;
        on.text(14.0, 26.0, &font::fitted(&self.title, 15.0, true, room), TextStyle::title());
        let facts = TextStyle::tick(Anchor::Start);
        on.text(14.0, 45.0, &font::fitted(&self.subtitle, 11.0, false, room), facts);
        let (wave, mel, space) = self.heights();
        let loudest = self.channels.iter().map(peak_of).fold(0.0, f32::max);
        for (i, channel) in self.channels.iter().enumerate() {
            let y = TOP + (wave + GAP + mel + space) * i as f64;
            let waveform = Rect::new(LEFT, y, WIDTH, wave);
            let spectrogram = Rect::new(LEFT, waveform.bottom() + GAP, WIDTH, mel);
            let peak = match self.wave_scale {
                WaveScale::Shared => loudest,
                WaveScale::Channel => peak_of(channel),
            };
            self.draw_wave(on, channel, waveform, peak);
            self.draw_levels(on, channel, spectrogram)?;
        }
        if !self.channels.is_empty() {
            let unit = TextStyle::new(10.0, Paint::Muted, Anchor::Middle).upwards();
            on.text(66.0, TOP + wave + GAP + mel / 2.0, "Hz", unit);
            let bar = Rect::new(LEFT + WIDTH + 18.0, TOP, 12.0, (self.bottom() - TOP).min(260.0));
            let (low, high) = self.level_range;
            color_bar(on, bar, (low.into(), high.into()), &self.level_label)?;
        }
        let plot = Rect::new(LEFT, TOP, WIDTH, self.bottom() + 4.0 - TOP);
        on.rect(Rect::new(LEFT, plot.bottom(), WIDTH, 1.0), Paint::Muted);
        if share(self.time.1, self.time).is_finite() && self.time.1 > self.time.0 {
            below(on, plot, self.time, false, "time, seconds");
        }
        Ok(())
    }
}
