//! The layers, a file each.

mod activation;
mod attention;
mod batch_norm;
mod conv;
pub(crate) mod dropout;
pub(crate) mod linear;
mod pool;
pub mod recurrent;
mod reshape;
mod residual;

pub use activation::{Relu, Sigmoid, Softmax, softmax};
pub use attention::Attention;
pub use batch_norm::BatchNorm;
pub(crate) use batch_norm::MOMENTUM;
#[cfg(any(test, feature = "gpu"))]
pub(crate) use batch_norm::moved;
pub use conv::Conv2d;
pub use dropout::Dropout;
pub use linear::Linear;
pub use pool::{AveragePool, FramePool, MaxPool};
pub use recurrent::{Bidirectional, Recurrent};
pub use reshape::{Flatten, FlattenPixels, Join};
pub use residual::Residual;

use crate::parameters::Initial;

/// PyTorch's default: uniform within plus and minus one over the root of the numbers that an output
/// sums.
fn uniform_by(fan_in: usize) -> Initial {
    Initial::Uniform(1.0 / (fan_in.max(1) as f32).sqrt())
}
