//! Colours: a perceptually ordered ramp for quantities, distinct hues for series.

/// An sRGB colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rgb(pub u8, pub u8, pub u8);

/// Text and axes.
pub(crate) const INK: Rgb = Rgb(38, 38, 48);
/// Secondary text.
pub(crate) const MUTED: Rgb = Rgb(104, 106, 120);
/// Grid lines.
pub(crate) const GRID: Rgb = Rgb(226, 227, 233);
/// Background.
pub(crate) const PAPER: Rgb = Rgb(255, 255, 255);
/// Waveforms.
pub(crate) const WAVE: Rgb = Rgb(52, 92, 158);

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

/// Hues of series, distinguishable by lightness as well.
const SERIES: [Rgb; 8] = [
    Rgb(46, 94, 170),
    Rgb(232, 138, 46),
    Rgb(52, 152, 126),
    Rgb(190, 62, 82),
    Rgb(134, 106, 178),
    Rgb(146, 112, 74),
    Rgb(108, 168, 214),
    Rgb(122, 124, 134),
];

/// Colour of a quantity, `t` from 0 (dark) to 1 (light); NaN is taken as 0.
pub fn sequential(t: f32) -> Rgb {
    let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) } * (RAMP.len() - 1) as f32;
    let i = (t as usize).min(RAMP.len() - 2);
    let f = t - i as f32;
    let [r, g, b] = [0, 1, 2].map(|k| (RAMP[i][k] * (1.0 - f) + RAMP[i + 1][k] * f).round() as u8);
    Rgb(r, g, b)
}

/// Colour of the series `i`.
pub(crate) fn series(i: usize) -> Rgb {
    SERIES[i % SERIES.len()]
}

impl Rgb {
    /// Relative luminance of sRGB, 0 to 1, without linearisation: good enough to choose between
    /// dark and light text.
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
}
