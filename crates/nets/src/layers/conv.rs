//! Convolution over images, as matrix products over the pixels that each output sees.

use rayon::prelude::*;

use super::uniform_by;
use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
use crate::kernels;
use crate::layer::{Backward, Layer, Pass, Saved};
use crate::layers::linear::column;
use crate::matrix::Matrix;
use crate::parameters::Declared;

/// Rows that a product should have at least: images are taken together until there are as many.
const ROWS: usize = 1024;

/// 2-D convolution.
#[derive(Clone, Debug)]
pub struct Conv2d {
    name: String,
    inputs: usize,
    outputs: usize,
    kernel: (usize, usize),
    stride: usize,
    padding: usize,
    bias: bool,
}

impl Conv2d {
    /// `name.weight` `[outputs, inputs, kernel.0, kernel.1]` and `name.bias`; stride 1, no padding.
    pub fn new(
        name: impl Into<String>,
        inputs: usize,
        outputs: usize,
        kernel: (usize, usize),
    ) -> Self {
        let name = name.into();
        Self { name, inputs, outputs, kernel, stride: 1, padding: 0, bias: true }
    }

    /// 3 x 3 with a border of one zero pixel: the image keeps its size.
    pub fn same3(name: impl Into<String>, inputs: usize, outputs: usize) -> Self {
        Self::new(name, inputs, outputs, (3, 3)).padding(1)
    }

    /// Steps between outputs, in both directions.
    pub fn stride(mut self, stride: usize) -> Self {
        self.stride = stride;
        self
    }

    /// Zero pixels on each side.
    pub fn padding(mut self, padding: usize) -> Self {
        self.padding = padding;
        self
    }

    /// Without a bias.
    pub fn unbiased(mut self) -> Self {
        self.bias = false;
        self
    }

    fn key(&self, what: &str) -> String {
        format!("{}.{what}", self.name)
    }

    fn geometry(&self, input: Shape) -> Option<Geometry> {
        let Shape::Image { height, width, channels } = input else { return None };
        let out = |size: usize, kernel: usize| {
            Some((size + 2 * self.padding).checked_sub(kernel)? / self.stride + 1)
        };
        let (out_height, out_width) = (out(height, self.kernel.0)?, out(width, self.kernel.1)?);
        let (kernel, stride, padding) = (self.kernel, self.stride, self.padding);
        (channels == self.inputs).then_some(Geometry {
            height,
            width,
            channels,
            out_height,
            out_width,
            kernel,
            stride,
            padding,
        })
    }

    /// The weight as `[outputs, kernel rows, kernel columns, inputs]`, or back.
    fn rearranged(&self, weight: &[f32], channels_last: bool) -> Vec<f32> {
        let (places, channels) = (self.kernel.0 * self.kernel.1, self.inputs);
        let mut out = vec![0.0; weight.len()];
        let each = places * channels;
        for (from, to) in weight.chunks_exact(each).zip(out.chunks_exact_mut(each)) {
            let (rows, cols) = if channels_last { (channels, places) } else { (places, channels) };
            crate::batch::transpose(from, to, rows, cols);
        }
        out
    }

    /// The weight as a matrix over what an output sees, channels last.
    fn matrix(&self, weight: &Matrix) -> Matrix {
        if self.inputs == 1 || self.kernel == (1, 1) {
            return weight.clone();
        }
        Matrix::new(weight.rows(), weight.cols(), self.rearranged(weight.values(), true))
    }
}

impl Layer for Conv2d {
    fn describe(&self) -> String {
        let (height, width) = self.kernel;
        let Self { name, inputs, outputs, stride, padding, .. } = self;
        let mut text = format!("{name}: convolution {height} x {width}, {inputs} to {outputs}");
        if *stride > 1 {
            text += &format!(", stride {stride}");
        }
        if *padding > 0 {
            text += &format!(", padding {padding}");
        }
        text
    }

    fn parameters(&self) -> Vec<Declared> {
        let initial = uniform_by(self.inputs * self.kernel.0 * self.kernel.1);
        let shape = [self.outputs, self.inputs, self.kernel.0, self.kernel.1];
        let mut all = vec![Declared::trained(self.key("weight"), &shape, initial)];
        if self.bias {
            all.push(Declared::trained(self.key("bias"), &[self.outputs], initial));
        }
        all
    }

    fn output(&self, input: Shape) -> Result<Shape> {
        let refusal = || {
            NetError::layer(
                self.describe(),
                format!("an image of {} channels that its kernel fits", self.inputs),
                input,
            )
        };
        let g = self.geometry(input).ok_or_else(refusal)?;
        Ok(Shape::Image { height: g.out_height, width: g.out_width, channels: self.outputs })
    }

    fn kept(&self, input: Shape) -> usize {
        let sees = self.inputs * self.kernel.0 * self.kernel.1;
        self.output(input).map_or(0, |output| 2 * output.len() + output.places() * sees)
    }

    fn forward(&self, input: Batch, pass: &mut Pass<'_>) -> Batch {
        let Some(g) = self.geometry(input.shape) else { unreachable!("shapes were checked") };
        let weight = self.matrix(pass.parameters.get(&self.key("weight")));
        let bias = self.bias.then(|| pass.parameters.get(&self.key("bias")));
        let (places, n) = (g.out_places(), self.outputs);
        let mut out = Matrix::zeros(input.items() * places, n);
        let group = g.group();
        let values = input.values.values();
        out.values_mut()
            .par_chunks_mut(group * places * n)
            .zip(values.par_chunks(group * g.input_len()))
            .for_each_init(Vec::new, |buffer, (out, images)| {
                let seen = g.seen(images, std::mem::take(buffer));
                let product = seen.dot_t(&weight);
                out.copy_from_slice(product.values());
                if let Some(bias) = bias {
                    kernels::add_to_rows(out, bias.values());
                }
                *buffer = seen.into_values();
            });
        let shape =
            Shape::Image { height: g.out_height, width: g.out_width, channels: self.outputs };
        pass.save(|| Saved::Batch(input));
        Batch { values: out, shape, lengths: None }
    }

    fn backward(&self, gradient: Batch, pass: &mut Backward<'_>) -> Batch {
        let Saved::Batch(input) = pass.saved() else { unreachable!("convolution saves its input") };
        let Some(g) = self.geometry(input.shape) else { unreachable!("shapes were checked") };
        let weight = self.matrix(pass.parameters.get(&self.key("weight")));
        let (places, n, group) = (g.out_places(), self.outputs, g.group());
        let wanted = pass.wanted;
        let mut by_input = wanted.then(|| Matrix::zeros(input.values.rows(), self.inputs));
        // One slice for each group, empty where the gradient by the input is not wanted.
        let mut slices: Vec<&mut [f32]> = match &mut by_input {
            Some(all) => all.values_mut().chunks_mut(group * g.input_len()).collect(),
            None => Vec::new(),
        };
        slices.resize_with(input.items().div_ceil(group), Default::default);
        let parts: Vec<Matrix> = slices
            .into_par_iter()
            .zip(input.values.values().par_chunks(group * g.input_len()))
            .zip(gradient.values.values().par_chunks(group * places * n))
            .map_init(Vec::new, |buffer, ((by_input, images), gradient)| {
                let gradient = Matrix::new(gradient.len() / n, n, gradient.to_vec());
                let seen = g.seen(images, std::mem::take(buffer));
                let by_weight = gradient.t_dot(&seen);
                *buffer = seen.into_values();
                if wanted {
                    g.add_back(gradient.dot(&weight).values(), by_input);
                }
                by_weight
            })
            .collect();
        let mut parts = parts.into_iter();
        let Some(mut by_weight) = parts.next() else { unreachable!("batches are not empty") };
        parts.for_each(|part| kernels::add(by_weight.values_mut(), part.values()));
        if self.inputs > 1 && self.kernel != (1, 1) {
            let (rows, cols) = (by_weight.rows(), by_weight.cols());
            by_weight = Matrix::new(rows, cols, self.rearranged(by_weight.values(), false));
        }
        pass.add(self.key("weight"), by_weight);
        if self.bias {
            let sums = kernels::column_sums(gradient.values.values(), n);
            pass.add(self.key("bias"), column(sums));
        }
        match by_input {
            Some(values) => Batch { values, shape: input.shape, lengths: None },
            None => gradient,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Geometry {
    height: usize,
    width: usize,
    channels: usize,
    out_height: usize,
    out_width: usize,
    kernel: (usize, usize),
    stride: usize,
    padding: usize,
}

impl Geometry {
    fn input_len(&self) -> usize {
        self.height * self.width * self.channels
    }

    fn out_places(&self) -> usize {
        self.out_height * self.out_width
    }

    /// Numbers that an output sees.
    fn field(&self) -> usize {
        self.kernel.0 * self.kernel.1 * self.channels
    }

    /// Images taken together.
    fn group(&self) -> usize {
        ROWS.div_ceil(self.out_places().max(1))
    }

    /// What each output sees: `[images * outputs, field]`.
    fn seen(&self, images: &[f32], mut out: Vec<f32>) -> Matrix {
        let rows = images.len() / self.input_len() * self.out_places();
        // Every number is written below, padding included.
        out.resize(rows * self.field(), 0.0);
        let fields = self.out_places() * self.field();
        for (image, out) in images.chunks_exact(self.input_len()).zip(out.chunks_exact_mut(fields))
        {
            self.runs(|place, kernel_row, run| {
                let at = place * self.field() + kernel_row * self.kernel.1 * self.channels;
                let to = &mut out[at..at + self.kernel.1 * self.channels];
                let Some((from, before, len)) = run else { return to.fill(0.0) };
                to[..before].fill(0.0);
                to[before..before + len].copy_from_slice(&image[from..from + len]);
                to[before + len..].fill(0.0);
            });
        }
        Matrix::new(rows, self.field(), out)
    }

    /// Adds gradients by what outputs see to the gradient by the image.
    fn add_back(&self, seen: &[f32], images: &mut [f32]) {
        let fields = self.out_places() * self.field();
        for (image, seen) in
            images.chunks_exact_mut(self.input_len()).zip(seen.chunks_exact(fields))
        {
            kernels::vectorized(
                #[inline(always)]
                || {
                    self.runs(
                        #[inline(always)]
                        |place, kernel_row, run| {
                            let Some((from, before, len)) = run else { return };
                            let at = place * self.field()
                                + kernel_row * self.kernel.1 * self.channels
                                + before;
                            let to = &mut image[from..from + len];
                            to.iter_mut().zip(&seen[at..at + len]).for_each(|(t, s)| *t += s);
                        },
                    );
                },
            );
        }
    }

    /// For each output and row of the kernel: where the run of pixels begins in the image, how many
    /// numbers of padding precede it, and its numbers. None: all padding.
    #[inline(always)]
    fn runs(&self, mut each: impl FnMut(usize, usize, Option<(usize, usize, usize)>)) {
        let (kernel_height, kernel_width) = self.kernel;
        let mut place = 0;
        for y in 0..self.out_height {
            for x in 0..self.out_width {
                let left = x * self.stride;
                // columns of the kernel inside the image
                let first = self.padding.saturating_sub(left).min(kernel_width);
                let end = (self.width + self.padding).saturating_sub(left).min(kernel_width);
                for k in 0..kernel_height {
                    let row = y * self.stride + k;
                    let inside = row >= self.padding && row - self.padding < self.height;
                    let run = (inside && end > first).then(|| {
                        let column = left + first - self.padding;
                        let from = ((row - self.padding) * self.width + column) * self.channels;
                        (from, first * self.channels, (end - first) * self.channels)
                    });
                    each(place, k, run);
                }
                place += 1;
            }
        }
    }
}
