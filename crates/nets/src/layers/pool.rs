//! Pooling over images.

#[cfg(any(test, feature = "gpu"))]
use burn_tensor::ops::MaxPoolOptions;
use rayon::prelude::*;

use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::layer::{Backward, Layer, Pass, Saved};
use crate::matrix::Matrix;

/// The largest number of each window, channel by channel. The first of equal ones counts.
#[derive(Clone, Copy, Debug)]
pub struct MaxPool {
    size: usize,
    stride: usize,
    padding: usize,
}

impl MaxPool {
    /// Windows of `size` x `size` side by side.
    pub fn new(size: usize) -> Self {
        Self { size, stride: size, padding: 0 }
    }

    /// Steps between windows.
    pub fn stride(mut self, stride: usize) -> Self {
        self.stride = stride;
        self
    }

    /// Pixels on each side that never are the largest.
    pub fn padding(mut self, padding: usize) -> Self {
        self.padding = padding;
        self
    }

    fn sizes(&self, input: Shape) -> Option<(usize, usize)> {
        let Shape::Image { height, width, .. } = input else { return None };
        let out = |n: usize| Some((n + 2 * self.padding).checked_sub(self.size)? / self.stride + 1);
        // A window offset is kept in a byte.
        (self.size * self.size <= 256).then_some((out(height)?, out(width)?))
    }

    /// Rows (or columns) of a window that lie in the image: offset in the window, place.
    fn inside(&self, at: usize, size: usize) -> impl Iterator<Item = (usize, usize)> + use<> {
        let (start, padding) = (at * self.stride, self.padding);
        (0..self.size).filter_map(move |k| {
            let place = (start + k).checked_sub(padding)?;
            (place < size).then_some((k, place))
        })
    }
}

impl Layer for MaxPool {
    fn describe(&self) -> String {
        let Self { size, stride, .. } = self;
        format!("largest of {size} x {size}, stride {stride}")
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        let refusal = || {
            NetError::layer(
                self.describe(),
                "an image at least as large as the pooling window",
                input,
            )
        };
        let (height, width) = self.sizes(input).ok_or_else(refusal)?;
        Ok(Shape::Image { height, width, channels: input.numbers() })
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let Shape::Image { height, width, channels } = input.shape else {
            unreachable!("shapes were checked")
        };
        let Some((out_height, out_width)) = self.sizes(input.shape) else {
            unreachable!("shapes were checked")
        };
        let row = out_width * channels;
        let mut out = Matrix::zeros(input.items() * out_height * out_width, channels);
        let training = pass.training.is_some();
        let mut chosen = vec![0u8; if training { out.values().len() } else { 0 }];
        let values = input.values.values();
        let one = |r: usize, out: &mut [f32], chosen: &mut [u8]| {
            let (item, y) = (r / out_height, r % out_height);
            let image = &values[item * input.shape.len()..][..input.shape.len()];
            for x in 0..out_width {
                let best = &mut out[x * channels..][..channels];
                best.fill(f32::NEG_INFINITY);
                let at = x * channels;
                for (ky, iy) in self.inside(y, height) {
                    for (kx, ix) in self.inside(x, width) {
                        let pixel = &image[(iy * width + ix) * channels..][..channels];
                        let offset = (ky * self.size + kx) as u8;
                        if chosen.is_empty() {
                            best.iter_mut().zip(pixel).for_each(|(b, &v)| *b = larger(v, *b).0);
                            continue;
                        }
                        let chosen = &mut chosen[at..][..channels];
                        for ((b, c), &v) in best.iter_mut().zip(chosen).zip(pixel) {
                            let (larger, new) = larger(v, *b);
                            *b = larger;
                            *c = if new { offset } else { *c };
                        }
                    }
                }
            }
        };
        if training {
            out.values_mut()
                .par_chunks_mut(row)
                .zip(chosen.par_chunks_mut(row))
                .enumerate()
                .for_each(|(r, (out, chosen))| one(r, out, chosen));
        } else {
            let rows = out.values_mut().par_chunks_mut(row).enumerate();
            rows.for_each(|(r, out)| one(r, out, &mut []));
        }
        pass.save(|| Saved::Bytes(chosen, input.shape));
        let shape = Shape::Image { height: out_height, width: out_width, channels };
        Batch { values: out, shape, lengths: None }
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Bytes(chosen, shape) = pass.saved() else { unreachable!("saves its choice") };
        let Shape::Image { width, channels, .. } = shape else { unreachable!("pools images") };
        let Some((_, out_width)) = self.sizes(shape) else { unreachable!("shapes were checked") };
        let mut values = Matrix::zeros(gradient.items() * shape.places(), channels);
        let per_item = gradient.shape.len();
        values
            .values_mut()
            .par_chunks_mut(shape.len())
            .zip(gradient.values.values().par_chunks(per_item))
            .zip(chosen.par_chunks(per_item))
            .for_each(|((image, gradient), chosen)| {
                let places = gradient.chunks_exact(channels).zip(chosen.chunks_exact(channels));
                for (place, (gradient, chosen)) in places.enumerate() {
                    let top = place / out_width * self.stride;
                    let left = place % out_width * self.stride;
                    for (c, (g, &k)) in gradient.iter().zip(chosen).enumerate() {
                        let k = usize::from(k);
                        let y = top + k / self.size - self.padding;
                        let x = left + k % self.size - self.padding;
                        image[(y * width + x) * channels + c] += g;
                    }
                }
            });
        Batch { values, shape, lengths: None }
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, _: &mut gpu::Pass<'_>) -> gpu::Flow {
        let gpu::Flow::Image(x) = input else { unreachable!("shapes were checked") };
        let (size, stride, padding) = (self.size, self.stride, self.padding);
        let options =
            MaxPoolOptions::new([size; 2]).with_stride([stride; 2]).with_padding([padding; 2]);
        gpu::Flow::Image(burn_tensor::module::max_pool2d(x, options))
    }
}

/// The larger number, and whether it is the new one; what is not a number wins.
#[inline(always)]
fn larger(new: f32, old: f32) -> (f32, bool) {
    let better = new > old || new.is_nan();
    (if better { new } else { old }, better)
}

/// The mean of every channel over the columns, and of these the largest and the mean over the rows, added: what an
/// image of frames and bands has somewhere, and all along (as PANNs, Kong et al. 2020).
#[derive(Clone, Copy, Debug)]
pub struct FramePool;

impl Layer for FramePool {
    fn describe(&self) -> String {
        "mean of the columns, largest and mean of the rows".into()
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        match input {
            // The row is kept in a byte.
            Shape::Image { height: 1..=256, channels, .. } => Ok(Shape::Vector(channels)),
            _ => Err(NetError::layer(self.describe(), "an image of up to 256 rows", input)),
        }
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let Shape::Image { height, width, channels } = input.shape else {
            unreachable!("shapes were checked")
        };
        let mut out = Vec::with_capacity(input.items() * channels);
        let mut chosen = vec![0; input.items() * channels];
        let images = input.values.values().chunks_exact(input.shape.len());
        for (image, chosen) in images.zip(chosen.chunks_exact_mut(channels)) {
            let mut largest = vec![f32::NEG_INFINITY; channels];
            let mut sums = vec![0.0; channels];
            for (y, row) in image.chunks_exact(width * channels).enumerate() {
                let row = crate::kernels::column_sums(row, channels);
                for (c, sum) in row.iter().enumerate() {
                    let (best, is_new) = larger((sum / width as f64) as f32, largest[c]);
                    largest[c] = best;
                    chosen[c] = if is_new { y as u8 } else { chosen[c] };
                    sums[c] += sum;
                }
            }
            let mean = |sum: f64| (sum / (height * width) as f64) as f32;
            out.extend(largest.iter().zip(sums).map(|(largest, sum)| largest + mean(sum)));
        }
        pass.save(|| Saved::Bytes(chosen, input.shape));
        Batch::new(out, Shape::Vector(channels))
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Bytes(chosen, shape) = pass.saved() else { unreachable!("saves its choice") };
        let Shape::Image { height, width, channels } = shape else { unreachable!("pools images") };
        let mut values = Vec::with_capacity(gradient.items() * shape.len());
        let rows = gradient.values.values().chunks_exact(channels);
        for (gradient, chosen) in rows.zip(chosen.chunks_exact(channels)) {
            for y in 0..height {
                let share = |(g, &k): (&f32, &u8)| {
                    let mean = g / (height * width) as f32;
                    if usize::from(k) == y { mean + g / width as f32 } else { mean }
                };
                let one: Vec<f32> = gradient.iter().zip(chosen).map(share).collect();
                (0..width).for_each(|_| values.extend_from_slice(&one));
            }
        }
        Batch::new(values, shape)
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, _: &mut gpu::Pass<'_>) -> gpu::Flow {
        let gpu::Flow::Image(x) = input else { unreachable!("shapes were checked") };
        let rows: burn_tensor::Tensor<3> = x.mean_dim(3).squeeze_dim(3);
        let both = rows.clone().max_dim(2) + rows.mean_dim(2);
        gpu::Flow::Vector(both.squeeze_dim(2))
    }
}

/// The mean of every channel over the whole image.
#[derive(Clone, Copy, Debug)]
pub struct AveragePool;

impl Layer for AveragePool {
    fn describe(&self) -> String {
        "mean of the image".into()
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        match input {
            Shape::Image { channels, .. } => Ok(Shape::Vector(channels)),
            _ => Err(NetError::layer(self.describe(), "an image", input)),
        }
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let (places, n) = (input.shape.places(), input.shape.numbers());
        let mut means = Vec::with_capacity(input.items() * n);
        for image in input.values.values().chunks_exact(places * n) {
            let sums = crate::kernels::column_sums(image, n);
            means.extend(sums.iter().map(|s| (s / places as f64) as f32));
        }
        pass.save(|| Saved::Shape(input.shape, None));
        Batch::new(means, Shape::Vector(n))
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Shape(shape, _) = pass.saved() else { unreachable!("saves its shape") };
        let (places, n) = (shape.places(), shape.numbers());
        let mut values = Vec::with_capacity(gradient.items() * places * n);
        for row in gradient.values.values().chunks_exact(n) {
            let one: Vec<f32> = row.iter().map(|g| g / places as f32).collect();
            (0..places).for_each(|_| values.extend_from_slice(&one));
        }
        Batch::new(values, shape)
    }

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, _: &mut gpu::Pass<'_>) -> gpu::Flow {
        let gpu::Flow::Image(x) = input else { unreachable!("shapes were checked") };
        let [items, channels, ..] = x.dims();
        gpu::Flow::Vector(
            x.reshape([items as i64, channels as i64, -1]).mean_dim(2).squeeze_dim::<2>(2),
        )
    }
}
