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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stretches {
    /// frames of a window
    pub frames: usize,
    /// frames from one window to the next
    pub step: usize,
}

impl Stretches {
    /// The whole windows of so many frames.
    pub fn of(self, frames: usize) -> impl Iterator<Item = Range<usize>> {
        let count = frames.checked_sub(self.frames).map_or(0, |rest| rest / self.step + 1);
        (0..count).map(move |w| w * self.step..w * self.step + self.frames)
    }
}

/// How a network's input comes from a recording.
#[derive(Clone, Copy, Debug)]
pub struct FrontEnd {
    /// preset of `extract`
    pub preset: &'static str,
    /// keys of it that are changed
    pub set: &'static [&'static str],
    /// stretches of 10 ms frames that are items of their own; `None`: a recording is one item
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
    pub fn items(&self, network: &Network, tensor: Tensor) -> Result<Vec<Item>> {
        let Tensor { channels, coefficients, frames, .. } = tensor;
        let items: Vec<Item> = match self.windows {
            None => vec![Item { frames: None, values: (self.item)(tensor) }],
            Some(windows) => {
                let width = channels * coefficients;
                let item = |span: Range<usize>| {
                    let values = tensor.values[span.start * width..span.end * width].to_vec();
                    let window = Tensor { channels, coefficients, frames: span.len(), values };
                    Item { frames: Some(span), values: (self.item)(window) }
                };
                windows.of(frames).map(item).collect()
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
        let windows = Stretches { frames: 64, step: 16 };
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
    fn too_few_frames_are_said() {
        let definition = networks::named("m4-type").unwrap();
        let network = definition.build(None, 0).unwrap();
        let values = vec![0.0; 63 * 64 * 8];
        let tensor = Tensor { channels: 8, coefficients: 64, frames: 63, values };
        let error = definition.front_end.unwrap().items(&network, tensor).unwrap_err().to_string();
        assert!(error.contains("63 frames") && error.contains("64"), "{error}");
    }
}
