//! What flows through a network on a GPU.

use burn_tensor::{Device, Tensor, TensorData};

use crate::batch::{Batch, Shape};

/// Items of one shape.
#[derive(Clone, Debug)]
pub enum Flow {
    /// `[items, numbers]`
    Vector(Tensor<2>),
    /// `[items, channels, height, width]`
    Image(Tensor<4>),
    /// `[items, steps, numbers]`, and the steps of each item
    Sequence(Tensor<3>, Option<Vec<usize>>),
}

impl Flow {
    /// A batch on this device.
    pub(super) fn of(batch: &Batch, device: &Device) -> Self {
        let values = batch.values.values().to_vec();
        Self::new(values, batch.shape, batch.lengths.clone(), device)
    }

    /// Numbers in the order of [`Batch`]: channels last.
    pub(super) fn new(
        values: Vec<f32>,
        shape: Shape,
        lengths: Option<Vec<usize>>,
        device: &Device,
    ) -> Self {
        let items = values.len() / shape.len().max(1);
        match shape {
            Shape::Vector(n) => {
                Self::Vector(Tensor::from_data(TensorData::new(values, [items, n]), device))
            }
            Shape::Image { height, width, channels } => {
                let data = TensorData::new(values, [items, height, width, channels]);
                let pixels: Tensor<4> = Tensor::from_data(data, device);
                Self::Image(pixels.permute([0, 3, 1, 2]))
            }
            Shape::Sequence { steps, numbers } => {
                let data = TensorData::new(values, [items, steps, numbers]);
                Self::Sequence(Tensor::from_data(data, device), lengths)
            }
        }
    }

    /// How many items, and the shape of each.
    pub(crate) fn shape(&self) -> (usize, Shape) {
        match self {
            Self::Vector(x) => {
                let [items, n] = x.dims();
                (items, Shape::Vector(n))
            }
            Self::Image(x) => {
                let [items, channels, height, width] = x.dims();
                (items, Shape::Image { height, width, channels })
            }
            Self::Sequence(x, _) => {
                let [items, steps, numbers] = x.dims();
                (items, Shape::Sequence { steps, numbers })
            }
        }
    }

    /// Each number by itself.
    pub(crate) fn map(self, f: impl FnOnce(Tensor<1>) -> Tensor<1>) -> Self {
        match self {
            Self::Vector(x) => {
                let dims = x.dims();
                Self::Vector(f(x.reshape([-1])).reshape(dims))
            }
            Self::Image(x) => {
                let dims = x.dims();
                Self::Image(f(x.reshape([-1])).reshape(dims))
            }
            Self::Sequence(x, lengths) => {
                let dims = x.dims();
                Self::Sequence(f(x.reshape([-1])).reshape(dims), lengths)
            }
        }
    }

    /// Each number with that in the same place of another flow of the same shape.
    pub(crate) fn zip(
        self,
        other: Self,
        f: impl FnOnce(Tensor<1>, Tensor<1>) -> Tensor<1>,
    ) -> Self {
        let other: Tensor<1> = match other {
            Self::Vector(x) => x.reshape([-1]),
            Self::Image(x) => x.reshape([-1]),
            Self::Sequence(x, _) => x.reshape([-1]),
        };
        self.map(|own| f(own, other))
    }
}
