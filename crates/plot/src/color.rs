//! Colours: what a mark means, a perceptually ordered ramp for quantities, distinct hues for series.

/// An sRGB colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rgb(pub u8, pub u8, pub u8);

/// The meaning of a mark. A figure on its own takes the colours given here; a page that shows it
/// may give each meaning (`ink`, `muted`, `grid`, …, `s0` to `s7`) another colour in CSS.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Paint {
    /// Text and axes.
    Ink,
    /// Secondary text and ticks.
    Muted,
    /// Grid lines.
    Grid,
    /// Background.
    Paper,
    /// What is right or in focus.
    Accent,
    /// What is wrong or needs attention.
    Warm,
    /// Text over a dark shade of `Accent` or `Warm`.
    Over,
    /// The series with this number.
    Series(usize),
    /// One colour everywhere, such as a level in a spectrogram.
    Fixed(Rgb),
}

/// Hues of series, distinguishable by lightness as well.
const SERIES: [Rgb; 8] = [
    Rgb(11, 110, 117),
    Rgb(200, 106, 30),
    Rgb(78, 84, 168),
    Rgb(176, 52, 84),
    Rgb(96, 140, 46),
    Rgb(134, 106, 178),
    Rgb(140, 104, 66),
    Rgb(110, 114, 124),
];

/// Anchors of the ramp: dark violet over teal to pale yellow, lightness rising evenly, which also
/// reads right in grey and with colour-vision deficiencies.
const RAMP: [[f32; 3]; 7] = [
    [22.0, 12.0, 46.0],
    [62.0, 38.0, 116.0],
    [56.0, 88.0, 146.0],
    [32.0, 132.0, 144.0],
    [58.0, 172.0, 124.0],
    [152.0, 206.0, 84.0],
    [250.0, 234.0, 118.0],
];

impl Paint {
    /// Name in a page's style sheet; none for a fixed colour.
    pub(crate) fn class(self) -> Option<String> {
        Some(match self {
            Self::Ink => "ink".into(),
            Self::Muted => "muted".into(),
            Self::Grid => "grid".into(),
            Self::Paper => "paper".into(),
            Self::Accent => "accent".into(),
            Self::Warm => "warm".into(),
            Self::Over => "over".into(),
            Self::Series(i) => format!("s{}", i % SERIES.len()),
            Self::Fixed(_) => return None,
        })
    }

    /// Colour on white paper.
    pub(crate) fn color(self) -> Rgb {
        match self {
            Self::Ink => Rgb(31, 35, 40),
            Self::Muted => Rgb(92, 100, 112),
            Self::Grid => Rgb(226, 227, 231),
            Self::Paper | Self::Over => Rgb(255, 255, 255),
            Self::Accent => SERIES[0],
            Self::Warm => Rgb(179, 84, 30),
            Self::Series(i) => SERIES[i % SERIES.len()],
            Self::Fixed(color) => color,
        }
    }
}

/// Colour of a quantity, `t` from 0 (dark) to 1 (light); NaN is taken as 0.
pub fn sequential(t: f32) -> Rgb {
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) } * (RAMP.len() - 1) as f32;
    let i = (t as usize).min(RAMP.len() - 2);
    let f = t - i as f32;
    let [r, g, b] = [0, 1, 2].map(|k| (RAMP[i][k] * (1.0 - f) + RAMP[i + 1][k] * f).round() as u8);
    Rgb(r, g, b)
}

impl Rgb {
    /// Brightness from 0 to 1, without linearisation: enough to choose between dark and light text.
    pub(crate) fn lightness(self) -> f32 {
        let Self(r, g, b) = self;
        (0.299 * f32::from(r) + 0.587 * f32::from(g) + 0.114 * f32::from(b)) / 255.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ramp_rises_in_lightness() {
        let steps: Vec<f32> = (0..=100).map(|i| sequential(i as f32 / 100.0).lightness()).collect();
        assert!(steps.windows(2).all(|w| w[1] >= w[0] - 0.002), "{steps:?}");
        assert!(steps[0] < 0.1 && steps[100] > 0.85);
        assert_eq!(sequential(f32::NAN), sequential(-3.0));
    }

    #[test]
    fn text_colours_stand_out_from_the_paper() {
        for paint in [Paint::Ink, Paint::Muted, Paint::Accent, Paint::Warm] {
            assert!(paint.color().lightness() < 0.45, "{paint:?}");
        }
    }
}
