//! A recording at a glance: waveform and log-mel spectrogram of each channel over one time axis.

use ndarray::Array2;

use crate::color::{GRID, INK, MUTED, WAVE, sequential};
use crate::surface::{Anchor, Figure, Pixels, PlotError, Rect, Surface, TextStyle};
use crate::ticks::{frequency, labels, ticks};

/// One channel of a [`RecordingPicture`].
#[derive(Debug, Clone)]
pub struct ChannelPicture {
    /// Name at the left.
    pub label: String,
    /// Smallest and largest sample of each column.
    pub envelope: Vec<(f32, f32)>,
    /// Level in dB, `[bands, columns]`, lowest band first; NaN is drawn as the lowest level.
    pub levels: Array2<f32>,
}

/// What to draw; all channels share the axes.
#[derive(Debug, Clone)]
pub struct RecordingPicture {
    /// Heading.
    pub title: String,
    /// A line of facts below it.
    pub subtitle: String,
    /// Length of the time axis in seconds.
    pub seconds: f64,
    /// Frequencies in Hz with their place on the axis of bands, 0 at the bottom to 1 at the top.
    pub frequencies: Vec<(f64, f64)>,
    /// Levels in dB of the darkest and the lightest colour.
    pub level_range: (f32, f32),
    /// Name of the levels with their unit.
    pub level_label: String,
    /// The channels, from top to bottom.
    pub channels: Vec<ChannelPicture>,
}

const LEFT: f64 = 92.0;
const WIDTH: f64 = 860.0;
const RIGHT: f64 = 92.0;
const TOP: f64 = 64.0;
const BOTTOM: f64 = 46.0;
const GAP: f64 = 3.0;

fn style(size: f64, anchor: Anchor) -> TextStyle {
    TextStyle { size, color: MUTED, anchor, upwards: false }
}

impl RecordingPicture {
    /// Heights of waveform, spectrogram and the space below: less for many channels.
    fn heights(&self) -> (f64, f64, f64) {
        match self.channels.len() {
            0..=2 => (84.0, 190.0, 22.0),
            3..=4 => (56.0, 120.0, 18.0),
            5..=8 => (36.0, 76.0, 12.0),
            _ => (22.0, 48.0, 10.0),
        }
    }

    fn bottom(&self) -> f64 {
        let (wave, mel, space) = self.heights();
        TOP + (wave + GAP + mel + space) * self.channels.len() as f64 - space
    }

    /// Largest magnitude of all waveforms, so that they share their scale.
    fn peak(&self) -> f32 {
        let all = self.channels.iter().flat_map(|c| &c.envelope);
        all.flat_map(|(low, high)| [low.abs(), high.abs()]).fold(0.0, f32::max)
    }

    fn draw_channel(
        &self,
        on: &mut dyn Surface,
        channel: &ChannelPicture,
        wave: Rect,
        mel: Rect,
        peak: f32,
    ) -> Result<(), PlotError> {
        let middle = wave.y + wave.h / 2.0;
        on.rect(Rect::new(wave.x, middle - 0.5, wave.w, 1.0), GRID);
        let half = wave.h / 2.0 / f64::from(if peak > 0.0 { peak } else { 1.0 });
        let spans: Vec<_> = channel
            .envelope
            .iter()
            .map(|(low, high)| (middle - f64::from(*high) * half, middle - f64::from(*low) * half))
            .collect();
        on.envelope(wave.x, wave.w / spans.len().max(1) as f64, &spans, WAVE);

        let (bands, columns) = channel.levels.dim();
        let (low, high) = self.level_range;
        let color = |v: f32| sequential((v - low) / (high - low));
        if bands > 0 && columns > 0 {
            let rows = (0..bands).rev();
            let colors = rows.flat_map(|b| channel.levels.row(b).to_vec()).map(color).collect();
            on.image(mel, &Pixels { width: columns, height: bands, colors })?;
        }
        let mut above = f64::INFINITY;
        for (hz, place) in &self.frequencies {
            let y = mel.bottom() - place * mel.h;
            // Labels that would run into the one below are left out.
            if above - y >= 12.0 || above.is_infinite() {
                on.rect(Rect::new(mel.x - 4.0, y - 0.5, 4.0, 1.0), MUTED);
                on.text(mel.x - 8.0, y + 3.5, &frequency(*hz), style(10.0, Anchor::End));
                above = y;
            }
        }
        let unit = TextStyle { upwards: true, ..style(10.0, Anchor::Middle) };
        on.text(mel.x - 48.0, mel.y + mel.h / 2.0, "Hz", unit);
        let name = TextStyle { color: INK, ..style(11.0, Anchor::Start) };
        on.text(14.0, middle + 4.0, &channel.label, name);
        Ok(())
    }

    fn draw_color_bar(&self, on: &mut dyn Surface) -> Result<(), PlotError> {
        let height = (self.bottom() - TOP).min(260.0);
        let bar = Rect::new(LEFT + WIDTH + 18.0, TOP, 12.0, height);
        let colors = (0..128).rev().map(|i| sequential(i as f32 / 127.0)).collect();
        on.image(bar, &Pixels { width: 1, height: 128, colors })?;
        let (low, high) = (f64::from(self.level_range.0), f64::from(self.level_range.1));
        let values = ticks(low, high, 5);
        for (value, label) in values.iter().zip(labels(&values)) {
            let y = bar.bottom() - (value - low) / (high - low) * bar.h;
            on.rect(Rect::new(bar.right(), y - 0.5, 4.0, 1.0), MUTED);
            on.text(bar.right() + 7.0, y + 3.5, &label, style(10.0, Anchor::Start));
        }
        let label = TextStyle { upwards: true, ..style(10.0, Anchor::Middle) };
        on.text(bar.right() + 48.0, bar.y + bar.h / 2.0, &self.level_label, label);
        Ok(())
    }
}

impl Figure for RecordingPicture {
    fn size(&self) -> (f64, f64) {
        (LEFT + WIDTH + RIGHT, self.bottom().max(TOP + 40.0) + BOTTOM)
    }

    fn draw(&self, on: &mut dyn Surface) -> Result<(), PlotError> {
        let title = TextStyle { color: INK, ..style(15.0, Anchor::Start) };
        on.text(14.0, 26.0, &self.title, title);
        on.text(14.0, 45.0, &self.subtitle, style(11.0, Anchor::Start));
        let (wave, mel, space) = self.heights();
        let peak = self.peak();
        for (i, channel) in self.channels.iter().enumerate() {
            let y = TOP + (wave + GAP + mel + space) * i as f64;
            let waveform = Rect::new(LEFT, y, WIDTH, wave);
            let spectrogram = Rect::new(LEFT, waveform.bottom() + GAP, WIDTH, mel);
            self.draw_channel(on, channel, waveform, spectrogram, peak)?;
        }
        let scale = format!("waveforms ±{peak:.3}");
        on.text(LEFT + WIDTH, 45.0, &scale, style(11.0, Anchor::End));
        if !self.channels.is_empty() {
            self.draw_color_bar(on)?;
        }

        let axis = self.bottom() + 4.0;
        on.rect(Rect::new(LEFT, axis, WIDTH, 1.0), MUTED);
        let times = ticks(0.0, self.seconds, 8);
        for (time, label) in times.iter().zip(labels(&times)) {
            let x = LEFT + time / self.seconds * WIDTH;
            on.rect(Rect::new(x - 0.5, axis, 1.0, 5.0), MUTED);
            on.text(x, axis + 17.0, &label, style(10.0, Anchor::Middle));
        }
        on.text(LEFT + WIDTH / 2.0, axis + 34.0, "time (s)", style(11.0, Anchor::Middle));
        Ok(())
    }
}
