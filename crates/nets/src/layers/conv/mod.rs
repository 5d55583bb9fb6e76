//! Convolution over images, as matrix products over the pixels that each output sees.

mod geometry;
mod winograd;

#[cfg(any(test, feature = "gpu"))]
use burn_tensor::ops::ConvOptions;
use rayon::prelude::*;

use super::uniform_by;
use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
#[cfg(any(test, feature = "gpu"))]
use crate::gpu;
use crate::kernels;
use crate::layer::{Backward, Layer, Pass, Saved};
use crate::layers::linear::column;
use crate::matrix::Matrix;
use crate::packed::Packed;
use crate::parameters::Declared;
use geometry::{Geometry, Work};

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

    /// By packed weights; nothing is gathered.
    fn packed_product(
        &self,
        g: Geometry,
        input: &Batch,
        bias: Option<&[f32]>,
        pass: &Pass<'_>,
    ) -> Matrix {
        if winograd::suits(g, self.outputs) {
            let weights = pass.parameters.packed_parts(&self.key("weight"), winograd::pack);
            return winograd::convolution(g, input.values.values(), weights, bias, self.outputs);
        }
        let pack = |weight: &Matrix| Packed::new(&self.matrix(weight));
        let weight = pass.parameters.packed(&self.key("weight"), pack);
        let (row, lines) = (g.out_width * self.outputs, g.lines_together());
        let mut out = Matrix::zeros(input.items() * g.out_places(), self.outputs);
        let pieces = out.values_mut().par_chunks_mut(lines * row).enumerate();
        pieces.for_each_init(Work::default, |work, (piece, out)| {
            let first = piece * lines;
            let lines = first..first + out.len() / row;
            weight.multiply(g.runs_of(input.values.values(), lines, work), bias, out);
        });
        out
    }

    /// By burn's product of gathered rows; see [`Pass::product`].
    fn gathered_product(
        &self,
        g: Geometry,
        input: &Batch,
        bias: Option<&[f32]>,
        pass: &Pass<'_>,
    ) -> Matrix {
        let weight = self.matrix(pass.parameters.get(&self.key("weight")));
        let (places, n) = (g.out_places(), self.outputs);
        let mut out = Matrix::zeros(input.items() * places, n);
        let group = g.group();
        out.values_mut().par_chunks_mut(group * places * n).enumerate().for_each_init(
            Vec::new,
            |buffer, (number, out)| {
                let mut left = out;
                for tile in g.tiles(number * group, left.len() / (places * n)) {
                    let seen = g.seen(&input.values, tile, buffer);
                    let (to, rest) = left.split_at_mut(seen.rows() * n);
                    to.copy_from_slice(seen.dot_t(&weight).values());
                    if let Some(bias) = bias {
                        kernels::add_to_rows(to, bias);
                    }
                    left = rest;
                    seen.give_back(buffer);
                }
            },
        );
        out
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
        let bias = self.bias.then(|| pass.parameters.get(&self.key("bias")).values());
        let out = match pass.training {
            None => self.packed_product(g, &input, bias, pass),
            Some(_) => self.gathered_product(g, &input, bias, pass),
        };
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
            .zip(gradient.values.values().par_chunks(group * places * n))
            .enumerate()
            .map_init(Vec::new, |buffer, (number, (by_input, gradient))| {
                let (mut left, mut sum) = (gradient, None::<Matrix>);
                for tile in g.tiles(number * group, gradient.len() / (places * n)) {
                    let seen = g.seen(&input.values, tile, buffer);
                    let (own, rest) = left.split_at(seen.rows() * n);
                    let own = Matrix::new(seen.rows(), n, own.to_vec());
                    let by_weight = seen.t_dot(&own);
                    match &mut sum {
                        None => sum = Some(by_weight),
                        Some(sum) => kernels::add(sum.values_mut(), by_weight.values()),
                    }
                    if wanted {
                        g.add_back(own.dot(&weight).values(), tile, by_input);
                    }
                    left = rest;
                    seen.give_back(buffer);
                }
                let Some(sum) = sum else { unreachable!("groups are not empty") };
                sum
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

    #[cfg(any(test, feature = "gpu"))]
    fn on_gpu(&self, input: gpu::Flow, pass: &mut gpu::Pass<'_>) -> gpu::Flow {
        let gpu::Flow::Image(x) = input else { unreachable!("shapes were checked") };
        let shape = [self.outputs, self.inputs, self.kernel.0, self.kernel.1];
        let weight = pass.parameter(&self.key("weight"), shape);
        let bias = self.bias.then(|| pass.parameter(&self.key("bias"), [self.outputs]));
        let options = ConvOptions::new([self.stride; 2], [self.padding; 2], [1; 2], 1);
        gpu::Flow::Image(burn_tensor::module::conv2d(x, weight, bias, options))
    }
}
