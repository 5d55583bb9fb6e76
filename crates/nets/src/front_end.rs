//! From the features of a recording to what a network takes.
//!
//! The features themselves are a configuration of `extract`, a preset and what changes it; this
//! crate knows neither recordings nor features, only how their numbers are laid out.

use std::ops::Range;

use crate::batch::Shape;
use crate::error::{NetError, Result};
use crate::network::Network;

/// Features of one recording; those of a summary have one frame and one channel.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tensor {
    /// channels
    pub channels: usize,
    /// coefficients of a frame
    pub coefficients: usize,
    /// frames
    pub frames: usize,
    /// `[frames][coefficients][channels]`
    pub values: Vec<f32>,
}

impl Tensor {
    /// The numbers of a summary.
    pub fn vector(values: Vec<f32>) -> Self {
        Self { channels: 1, coefficients: values.len(), frames: 1, values }
    }

    fn frame(&self, frame: usize) -> &[f32] {
        let width = self.coefficients * self.channels;
        &self.values[frame * width..(frame + 1) * width]
    }

    /// The values coefficient by coefficient, as an array `[coefficients, frames]` has them.
    pub fn by_coefficient(&self) -> Vec<f32> {
        let width = self.coefficients * self.channels;
        let of = |place: usize| (0..self.frames).map(move |frame| (frame, place));
        (0..width).flat_map(of).map(|(frame, place)| self.frame(frame)[place]).collect()
    }
}

/// Equal stretches of frames that a network takes one by one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretches {
    /// frames of a window
    pub frames: usize,
    /// frames from one window to the next
    pub step: usize,
    /// seconds from one frame to the next
    pub hop: f64,
    /// decibels that take the place of missing frames where a recording is shorter than a stretch; `None`: it is
    /// refused
    pub fill: Option<f32>,
    /// stretches so many decibels quieter than the loudest are left out; values are decibels then
    pub quiet: Option<f32>,
}

impl Stretches {
    /// Stretches of 10 ms frames, all that are whole.
    pub const fn whole(frames: usize, step: usize) -> Self {
        Self { frames, step, hop: 0.01, fill: None, quiet: None }
    }

    /// The whole windows of so many frames.
    pub fn of(self, frames: usize) -> impl Iterator<Item = Range<usize>> {
        let count = frames.checked_sub(self.frames).map_or(0, |rest| rest / self.step + 1);
        (0..count).map(move |w| w * self.step..w * self.step + self.frames)
    }

    /// Of these stretches of a tensor, those that are not quiet.
    fn heard(self, tensor: &Tensor) -> Vec<Range<usize>> {
        let all: Vec<Range<usize>> = self.of(tensor.frames).collect();
        let Some(quiet) = self.quiet else { return all };
        let power = |frame: usize| -> f64 {
            tensor.frame(frame).iter().map(|v| 10.0_f64.powf(f64::from(*v) / 10.0)).sum()
        };
        let powers: Vec<f64> = (0..tensor.frames).map(power).collect();
        let sums: Vec<f64> = all.iter().map(|w| powers[w.clone()].iter().sum()).collect();
        let loudest = sums.iter().copied().fold(0.0, f64::max);
        let least = loudest * 10.0_f64.powf(-f64::from(quiet) / 10.0);
        // What is not a number is refused later, and said.
        let is_heard = |sum: f64| sum.is_nan() || sum >= least;
        all.into_iter().zip(sums).filter(|(_, sum)| is_heard(*sum)).map(|(w, _)| w).collect()
    }

    /// Seconds of a recording before this frame.
    pub fn seconds(self, frame: usize) -> f64 {
        frame as f64 * self.hop
    }
}

/// How a network's input comes from a recording.
#[derive(Clone, Copy, Debug)]
pub struct FrontEnd {
    /// preset of `extract`
    pub preset: &'static str,
    /// keys of it that are changed
    pub set: &'static [&'static str],
    /// stretches of frames that are items of their own; `None`: a recording is one item
    pub windows: Option<Stretches>,
    /// the numbers of an item from a recording, or a window of it
    pub item: fn(Tensor) -> Vec<f32>,
}

/// What a network takes of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct Item {
    /// the frames that it covers, where it is a window
    pub frames: Option<Range<usize>>,
    /// its numbers, channels last
    pub values: Vec<f32>,
}

impl FrontEnd {
    /// A recording as one item, its numbers as the features have them.
    pub const fn of(preset: &'static str) -> Self {
        Self { preset, set: &[], windows: None, item: |tensor| tensor.values }
    }

    /// The items of a recording.
    ///
    /// # Errors
    /// [`NetError::InputShape`] for features of another shape, such as those of another number of
    /// channels; [`NetError::TooShort`].
    pub fn items(&self, network: &Network, mut tensor: Tensor) -> Result<Vec<Item>> {
        let Tensor { channels, coefficients, frames, .. } = tensor;
        if let Some(Stretches { frames: needed, fill: Some(fill), .. }) = self.windows
            && let Some(&first) = tensor.values.first()
        {
            // Silence, whose decibels below its own maximum are 0.
            if tensor.values.iter().all(|value| *value == first) {
                tensor.values.fill(fill);
            }
            if frames < needed {
                tensor.values.resize(needed * channels * coefficients, fill);
                tensor.frames = needed;
            }
        }
        let items: Vec<Item> = match self.windows {
            None => vec![Item { frames: None, values: (self.item)(tensor) }],
            Some(windows) => {
                let width = channels * coefficients;
                let item = |span: Range<usize>| {
                    let values = tensor.values[span.start * width..span.end * width].to_vec();
                    let window = Tensor { channels, coefficients, frames: span.len(), values };
                    Item { frames: Some(span), values: (self.item)(window) }
                };
                windows.heard(&tensor).into_iter().map(item).collect()
            }
        };
        let input = &network.inputs()[0];
        let Some(first) = items.first() else {
            let needed = self.windows.map_or(1, |w| w.frames);
            return Err(NetError::TooShort { network: network.name().into(), frames, needed });
        };
        let fits = match input.shape {
            Shape::Sequence { numbers, .. } => first.values.len() % numbers == 0,
            shape => first.values.len() == shape.len(),
        };
        if !fits {
            return Err(NetError::InputShape {
                network: network.name().into(),
                input: input.name.clone(),
                expected: input.shape.to_string(),
                actual: format!("{} numbers ({channels} channels)", first.values.len()),
            });
        }
        Ok(items)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::networks;

    #[test]
    fn windows_are_whole() {
        let windows = Stretches::whole(64, 16);
        let starts = |frames| windows.of(frames).map(|w| w.start).collect::<Vec<_>>();
        assert!(starts(63).is_empty());
        assert_eq!(starts(64), [0]);
        assert_eq!(starts(79), [0]);
        assert_eq!(starts(80), [0, 16]);
        assert!((64..400).all(|n| windows.of(n).all(|w| w.end <= n)));
    }

    #[test]
    fn every_front_end_gives_what_its_network_takes() {
        // Channels, coefficients and frames of each preset.
        let shapes = [
            ("m1", (1, 2050, 1)),
            ("m2_type", (1, 40, 1501)),
            ("m3_mlp", (1, 563, 11)),
            ("m4_type", (8, 64, 100)),
            ("m6_action", (1, 9216, 1)),
            ("m6_pouring", (1, 9216, 1)),
            ("m6_shaking", (1, 9216, 1)),
            ("vggish", (1, 64, 192)),
            ("mel_cnn", (1, 64, 300)),
        ];
        for definition in networks::NETWORKS {
            let shape = shapes.iter().find(|(name, _)| *name == definition.name);
            let Some(front_end) = definition.front_end else {
                assert!(shape.is_none(), "{}", definition.name);
                continue;
            };
            let (channels, coefficients, frames) = shape.expect(definition.name).1;
            let values = vec![0.5; channels * coefficients * frames];
            let tensor = Tensor { channels, coefficients, frames, values };
            let network = definition.build(None, 0).unwrap();
            let items = front_end.items(&network, tensor.clone()).unwrap();
            let shape = network.inputs()[0].shape;
            assert!(items.iter().all(|i| i.values.len() == shape.len()), "{}", definition.name);
            assert_eq!(items.len() > 1, front_end.windows.is_some(), "{}", definition.name);
            let other = Tensor { coefficients: coefficients - 1, ..tensor };
            let width = channels * (coefficients - 1) * frames;
            let values = other.values[..width].to_vec();
            let refused = front_end.items(&network, Tensor { values, ..other });
            assert!(matches!(refused, Err(NetError::InputShape { .. })), "{}", definition.name);
        }
    }

    #[test]
    fn stretches_are_filled_up_and_quiet_ones_left_out() {
        let definition = networks::named("mel_cnn").unwrap();
        let (network, front_end) =
            (definition.build(None, 0).unwrap(), definition.front_end.unwrap());
        let Stretches { frames, step, .. } = front_end.windows.unwrap();
        let tensor = |levels: &[f32]| Tensor {
            channels: 1,
            coefficients: 64,
            frames: levels.len(),
            values: levels.iter().flat_map(|level| [*level; 64]).collect(),
        };
        // Sound at the start, silence, and 30 dB less at the end.
        let mut levels = vec![-80.0; 5 * frames];
        levels[..frames].fill(0.0);
        levels[4 * frames..].fill(-30.0);
        let items = front_end.items(&network, tensor(&levels)).unwrap();
        let starts: Vec<usize> = items.iter().map(|i| i.frames.clone().unwrap().start).collect();
        let expected = (0..=4 * frames).step_by(step).filter(|s| *s < frames || *s > 3 * frames);
        assert_eq!(starts, expected.collect::<Vec<_>>());
        let short = front_end.items(&network, tensor(&[0.0, -1.0, 0.0])).unwrap();
        assert_eq!((short.len(), short[0].values.len()), (1, 64 * frames));
        assert!(short[0].values[3 * 64..].iter().all(|v| *v == -1.0), "silence");
        assert!(front_end.items(&network, tensor(&[])).is_err());
        let silent = front_end.items(&network, tensor(&vec![0.0; 2 * frames])).unwrap();
        assert!(silent.iter().all(|item| item.values.iter().all(|v| *v == -1.0)));
        let broken = front_end.items(&network, tensor(&vec![f32::NAN; frames])).unwrap();
        assert!(broken[0].values[0].is_nan(), "left for the check of inputs");
    }

    #[test]
    fn too_few_frames_are_said() {
        let definition = networks::named("m4-type").unwrap();
        let network = definition.build(None, 0).unwrap();
        let values = vec![0.0; 63 * 64 * 8];
        let tensor = Tensor { channels: 8, coefficients: 64, frames: 63, values };
        let error = definition.front_end.unwrap().items(&network, tensor).unwrap_err().to_string();
        assert!(error.contains("63 frames") && error.contains("64"), "{error}");
    }
}
