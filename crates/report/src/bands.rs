//! Bands of a spectrogram along different axes of frequency.

use corsmal_dsp::error::DspError;
use corsmal_dsp::mel::{MelParams, hz_to_mel, mel_filter, mel_to_hz};
use ndarray::{Array2, ArrayViewMut1};

/// How frequencies are spread over the height of a spectrogram.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum FrequencyAxis {
    /// By the mel scale (Slaney's, as librosa's default).
    #[default]
    Mel,
    /// Each octave as high as the next, from 20 Hz on.
    Log,
    /// Each hertz as high as the next.
    Linear,
}

/// Lowest frequency of a logarithmic axis in Hz.
const LOWEST: f64 = 20.0;

impl FrequencyAxis {
    /// Place of a frequency, 0 at the bottom to 1 at `highest`.
    pub(crate) fn place(self, hz: f64, highest: f64) -> f64 {
        match self {
            Self::Mel => hz_to_mel(hz, false) / hz_to_mel(highest, false),
            Self::Log => (hz / lowest(highest)).ln() / (highest / lowest(highest)).ln(),
            Self::Linear => hz / highest,
        }
    }

    /// Edges of `bands` bands of equal height, in Hz.
    fn edges(self, bands: usize, highest: f64) -> Vec<f64> {
        let at = |i: usize| i as f64 / bands as f64;
        let edge = |share: f64| match self {
            Self::Log => lowest(highest) * (highest / lowest(highest)).powf(share),
            Self::Mel | Self::Linear => highest * share,
        };
        (0..=bands).map(|i| edge(at(i))).collect()
    }

    /// Weights of a power spectrum's bins in each of `bands` bands, `[bands, 1 + n_fft / 2]`. A band is the
    /// mean over its bins, or lies between the nearest two where it is narrower than one.
    pub(crate) fn bank(
        self,
        bands: usize,
        n_fft: usize,
        sample_rate: f64,
        highest: f64,
    ) -> Result<Array2<f32>, DspError> {
        if self == Self::Mel {
            return mel_bank(bands, n_fft, sample_rate, highest);
        }
        let width = sample_rate / n_fft as f64;
        let last = n_fft / 2;
        let mut bank = Array2::zeros((bands, last + 1));
        for (band, ends) in self.edges(bands, highest).windows(2).enumerate() {
            let (from, to) = (ends[0] / width, ends[1] / width);
            let bins: Vec<usize> = (from.ceil() as usize..to.ceil() as usize).collect();
            if bins.is_empty() {
                lie_between(bank.row_mut(band), (from + to) / 2.0, 1.0);
            } else {
                for bin in bins.iter().filter(|bin| **bin <= last) {
                    bank[[band, *bin]] = 1.0 / bins.len() as f32;
                }
            }
        }
        Ok(bank)
    }

    /// Frequencies below `highest` that may be labelled, the most wanted first, with their places.
    pub(crate) fn labelled(self, highest: f64) -> Vec<(f64, f64)> {
        let wanted: Vec<f64> = match self {
            Self::Mel | Self::Log => {
                let decades = [1e3, 1e4, 100.0, 1e5];
                let fives = [5e3, 500.0, 5e4, 50.0];
                let twos = [2e3, 2e4, 200.0, 2e5];
                let rest = [3e3, 7e3, 3e4, 300.0, 700.0, 4e3, 1.5e4];
                [&decades[..], &fives, &twos, &rest].concat()
            }
            Self::Linear => {
                // Steps of 1, 2 or 5 times a power of ten that give about eight labels.
                let rough = highest / 8.0;
                let power = 10f64.powf(rough.log10().floor());
                let steps = [1.0, 2.0, 5.0, 10.0].map(|f| f * power);
                let step = steps.into_iter().find(|s| *s >= rough).unwrap_or(10.0 * power);
                (0..=8).map(|i| f64::from(i) * step).collect()
            }
        };
        let inside = wanted.into_iter().filter(|hz| *hz < highest);
        let placed = inside.map(|hz| (hz, self.place(hz, highest)));
        placed.filter(|(_, place)| *place >= 0.0).collect()
    }
}

/// Of the mel scale, bands that are narrow for the bins lie between the nearest two: some would have none.
fn mel_bank(
    bands: usize,
    n_fft: usize,
    sample_rate: f64,
    highest: f64,
) -> Result<Array2<f32>, DspError> {
    let params = MelParams::new(sample_rate, n_fft);
    let mut bank = mel_filter(&MelParams { n_mels: bands, fmax: Some(highest), ..params })?;
    let (width, top) = (sample_rate / n_fft as f64, hz_to_mel(highest, false));
    let edge = |i: usize| mel_to_hz(top * i as f64 / (bands + 1) as f64, false) / width;
    for (band, row) in bank.outer_iter_mut().enumerate() {
        if edge(band + 2) - edge(band) < 2.0 {
            // As much as a band whose weights have the sum that Slaney's have.
            lie_between(row, edge(band + 1), (1.0 / width) as f32);
        }
    }
    Ok(bank)
}

/// Makes a band a share of the two bins around a place.
fn lie_between(mut row: ArrayViewMut1<'_, f32>, place: f64, sum: f32) {
    let place = place.min((row.len() - 1) as f64);
    let below = place.floor() as usize;
    let share = (place - below as f64) as f32;
    row.fill(0.0);
    row[below] = sum * (1.0 - share);
    if share > 0.0 {
        row[below + 1] = sum * share;
    }
}

fn lowest(highest: f64) -> f64 {
    LOWEST.min(highest / 4.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tone at a bin's frequency is loudest in the band where the axis has its label.
    #[test]
    fn bands_lie_where_the_axis_says() {
        let (n_fft, rate, bands) = (1024, 16_000.0, 64);
        for axis in [FrequencyAxis::Mel, FrequencyAxis::Log, FrequencyAxis::Linear] {
            let bank = axis.bank(bands, n_fft, rate, 8000.0).unwrap();
            for bin in [16usize, 64, 200, 400] {
                let place = axis.place(bin as f64 * rate / n_fft as f64, 8000.0);
                let weights: Vec<f32> = bank.column(bin).to_vec();
                let best =
                    (0..bands).max_by(|a, b| weights[*a].total_cmp(&weights[*b])).unwrap() as f64;
                assert!((best + 0.5 - place * bands as f64).abs() < 1.6, "{axis:?} bin {bin}");
            }
        }
    }

    /// White noise of power 1 has power 1 in every band off the mel scale.
    #[test]
    fn bands_are_means() {
        for axis in [FrequencyAxis::Log, FrequencyAxis::Linear] {
            let bank = axis.bank(200, 512, 44_100.0, 22_050.0).unwrap();
            assert!(bank.rows().into_iter().all(|row| (row.sum() - 1.0).abs() < 1e-5), "{axis:?}");
        }
    }

    #[test]
    fn labels_are_round_and_inside() {
        let log = FrequencyAxis::Log.labelled(22_050.0);
        assert_eq!(log[0].0, 1000.0);
        assert!(log.iter().all(|(hz, place)| *hz < 22_050.0 && (0.0..1.0).contains(place)));
        assert!(log.iter().any(|(hz, _)| *hz == 50.0));
        let linear: Vec<f64> =
            FrequencyAxis::Linear.labelled(22_050.0).into_iter().map(|l| l.0).collect();
        assert_eq!(linear, [0.0, 5000.0, 10_000.0, 15_000.0, 20_000.0]);
    }

    /// Bands without a bin were black stripes.
    #[test]
    fn white_noise_is_even_on_the_mel_axis() {
        for (rate, n_fft) in [(44_100.0, 1024), (16_000.0, 512), (8000.0, 512)] {
            for highest in [300.0, 1000.0, 2000.0, rate / 2.0] {
                let bank = FrequencyAxis::Mel.bank(64, n_fft, rate, highest).unwrap();
                let even = rate / n_fft as f64;
                for (band, row) in bank.outer_iter().enumerate() {
                    let sum = f64::from(row.sum()) * even;
                    assert!((0.5..2.0).contains(&sum), "{rate} {highest} {band}: {sum}");
                }
            }
        }
    }
}
