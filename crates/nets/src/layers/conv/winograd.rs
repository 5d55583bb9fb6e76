//! 3 x 3 convolutions by F(2 x 2, 3 x 3) of Lavin and Gray (2016, arXiv:1509.09308): tiles of 4 x 4 pixels give 2 x 2
//! outputs by 16 products for each pair of channels, where sums over what every output sees take 36.
//!
//! Its constants are 1 and 1/2, so it rounds hardly more than the plain sums.

use pulp::{Arch, Simd, WithSimd};
use rayon::prelude::*;

use super::geometry::Geometry;
use crate::matrix::Matrix;
use crate::packed::{Packed, Runs};

/// Products of a tile.
const PRODUCTS: usize = 16;
/// Fewest pixels of an image: below, reading sixteen weights for nine takes longer than it saves.
const PIXELS: usize = 64;
/// Fewest channels on both sides: below, transforming tiles takes longer than it saves.
const CHANNELS: usize = 8;
/// Numbers of transformed tiles and their products that a thread holds, about: they stay in the second cache.
const HELD: usize = 1 << 17;

/// Memory of a thread.
#[derive(Default)]
struct Work {
    /// transformed tiles `[16][tiles][channels]`
    tiles: Vec<f32>,
    /// their products `[16][tiles][outputs]`
    products: Vec<f32>,
    starts: Vec<usize>,
}

/// Whether a convolution can be computed so, and gains by it. The number of images plays no part: an image has the
/// same outputs in every batch.
pub(super) fn suits(g: Geometry, outputs: usize) -> bool {
    (g.kernel, g.stride, g.padding) == ((3, 3), 1, 1)
        && g.height.is_multiple_of(2)
        && g.width.is_multiple_of(2)
        && g.height * g.width >= PIXELS
        && g.channels.min(outputs) >= CHANNELS
}

/// The sixteen matrices `[outputs, inputs]` of a weight `[outputs, inputs * 9]`.
pub(super) fn pack(weight: &Matrix) -> Vec<Packed> {
    let (outputs, inputs) = (weight.rows(), weight.cols() / 9);
    let mut transformed = vec![vec![0.0; outputs * inputs]; PRODUCTS];
    for (pair, kernel) in weight.values().as_chunks::<9>().0.iter().enumerate() {
        let row = |y: usize| -> [f64; 3] { std::array::from_fn(|x| f64::from(kernel[3 * y + x])) };
        let rows = transformed_weights([row(0), row(1), row(2)].map(transformed_row));
        for (to, number) in transformed.iter_mut().zip(rows.as_flattened()) {
            to[pair] = *number as f32;
        }
    }
    transformed
        .into_iter()
        .map(|values| Packed::new(&Matrix::new(outputs, inputs, values)))
        .collect()
}

fn transformed_row([a, b, c]: [f64; 3]) -> [f64; 4] {
    [a, (a + b + c) / 2.0, (a - b + c) / 2.0, c]
}

fn transformed_weights(rows: [[f64; 4]; 3]) -> [[f64; 4]; 4] {
    let columns: [[f64; 4]; 4] =
        std::array::from_fn(|x| transformed_row([rows[0][x], rows[1][x], rows[2][x]]));
    std::array::from_fn(|y| std::array::from_fn(|x| columns[x][y]))
}

/// The outputs of all images, pixel by pixel; `weights` are [`pack`]'s.
pub(super) fn convolution(
    g: Geometry,
    images: &[f32],
    weights: &[Packed],
    bias: Option<&[f32]>,
    outputs: usize,
) -> Matrix {
    let lines = images.len() / (g.width * g.channels);
    let mut out = Matrix::zeros(lines * g.width, outputs);
    let across = g.width / 2;
    let rows = (HELD / (PRODUCTS * (g.channels + outputs))).div_ceil(across).max(1);
    let pieces = out.values_mut().par_chunks_mut(rows * 2 * g.width * outputs).enumerate();
    pieces.for_each_init(Work::default, |work, (piece, out)| {
        let first = piece * rows;
        let tiles = out.len() / (4 * outputs);
        work.tiles.resize(PRODUCTS * tiles * g.channels, 0.0);
        work.products.resize(PRODUCTS * tiles * outputs, 0.0);
        work.starts.clear();
        work.starts.extend((0..tiles).map(|tile| tile * g.channels));
        Arch::new().dispatch(InputTransform { g, images, first, to: &mut work.tiles });
        let transformed = work.tiles.chunks_exact(tiles * g.channels);
        let products = work.products.chunks_exact_mut(tiles * outputs);
        for ((values, to), weight) in transformed.zip(products).zip(weights) {
            let starts = &work.starts;
            let runs = Runs { values, starts, count: 1, jump: 0, length: g.channels };
            weight.multiply(runs, None, to);
        }
        Arch::new().dispatch(OutputTransform { g, products: &work.products, bias, outputs, out });
    });
    out
}

/// Transforms the tiles of some rows of tiles.
struct InputTransform<'a> {
    g: Geometry,
    images: &'a [f32],
    /// row of tiles, counted over all images
    first: usize,
    to: &'a mut [f32],
}

impl WithSimd for InputTransform<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { g, images, first, to } = self;
        let (channels, across, down) = (g.channels, g.width / 2, g.height / 2);
        let zeros = vec![0.0; channels];
        let each = to.len() / PRODUCTS;
        let mut to = to.chunks_exact_mut(each);
        let mut to: [&mut [f32]; PRODUCTS] = std::array::from_fn(|_| to.next().unwrap_or_default());
        for tile in 0..each / channels {
            let (row, x) = (first + tile / across, 2 * (tile % across));
            let (image, y) = (row / down, 2 * (row % down));
            // A border of one zero pixel surrounds the image.
            let pixel = |k: usize| {
                let (y, x) = (y + k / 4, x + k % 4);
                let inside = (1..=g.height).contains(&y) && (1..=g.width).contains(&x);
                match inside {
                    true => {
                        let place = (image * g.height + y - 1) * g.width + x - 1;
                        &images[place * channels..][..channels]
                    }
                    false => &zeros,
                }
            };
            let pixels: [&[f32]; PRODUCTS] = std::array::from_fn(pixel);
            let to = to.each_mut().map(|to| &mut to[tile * channels..][..channels]);
            each_vector(
                simd,
                pixels,
                to,
                #[inline(always)]
                |d| input_tile(simd, d),
            );
        }
    }
}

/// A tile, transformed along its columns, then along its rows.
#[inline(always)]
fn input_tile<S: Simd>(simd: S, d: [S::f32s; PRODUCTS]) -> [S::f32s; PRODUCTS] {
    let mut columns = [[simd.splat_f32s(0.0); 4]; 4];
    for (x, column) in columns.iter_mut().enumerate() {
        *column = input_line(simd, [d[x], d[4 + x], d[8 + x], d[12 + x]]);
    }
    let mut all = d;
    let [a, b, c, d] = columns;
    for (y, row) in all.as_chunks_mut::<4>().0.iter_mut().enumerate() {
        *row = input_line(simd, [a[y], b[y], c[y], d[y]]);
    }
    all
}

#[inline(always)]
fn input_line<S: Simd>(simd: S, [a, b, c, d]: [S::f32s; 4]) -> [S::f32s; 4] {
    [simd.sub_f32s(a, c), simd.add_f32s(b, c), simd.sub_f32s(c, b), simd.sub_f32s(b, d)]
}

/// The outputs of some rows of tiles from their products.
struct OutputTransform<'a> {
    g: Geometry,
    products: &'a [f32],
    bias: Option<&'a [f32]>,
    outputs: usize,
    out: &'a mut [f32],
}

impl WithSimd for OutputTransform<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { g, products, bias, outputs, out } = self;
        let line = g.width * outputs;
        let each = products.len() / PRODUCTS;
        let zeros = vec![0.0; outputs];
        let bias = bias.unwrap_or(&zeros);
        let mut tile = 0;
        for lines in out.chunks_exact_mut(2 * line) {
            let (upper, lower) = lines.split_at_mut(line);
            let pairs =
                upper.chunks_exact_mut(2 * outputs).zip(lower.chunks_exact_mut(2 * outputs));
            for (upper, lower) in pairs {
                let of_product = |k: usize| match k {
                    PRODUCTS => bias,
                    _ => &products[k * each + tile * outputs..][..outputs],
                };
                let from: [&[f32]; PRODUCTS + 1] = std::array::from_fn(of_product);
                let ((a, b), (c, d)) = (upper.split_at_mut(outputs), lower.split_at_mut(outputs));
                each_vector(
                    simd,
                    from,
                    [a, b, c, d],
                    #[inline(always)]
                    |m| output_tile(simd, m),
                );
                tile += 1;
            }
        }
    }
}

/// The outputs of a tile from its products, which the bias follows.
#[inline(always)]
fn output_tile<S: Simd>(simd: S, m: [S::f32s; PRODUCTS + 1]) -> [S::f32s; 4] {
    let mut columns = [[simd.splat_f32s(0.0); 2]; 4];
    for (x, column) in columns.iter_mut().enumerate() {
        *column = output_line(simd, [m[x], m[4 + x], m[8 + x], m[12 + x]]);
    }
    let [a, b, c, d] = columns;
    let upper = output_line(simd, [a[0], b[0], c[0], d[0]]);
    let lower = output_line(simd, [a[1], b[1], c[1], d[1]]);
    let bias = m[PRODUCTS];
    [
        simd.add_f32s(upper[0], bias),
        simd.add_f32s(upper[1], bias),
        simd.add_f32s(lower[0], bias),
        simd.add_f32s(lower[1], bias),
    ]
}

#[inline(always)]
fn output_line<S: Simd>(simd: S, [a, b, c, d]: [S::f32s; 4]) -> [S::f32s; 2] {
    [simd.add_f32s(simd.add_f32s(a, b), c), simd.sub_f32s(simd.sub_f32s(b, c), d)]
}

/// `transform` of numbers side by side in slices of one length, vector by vector.
#[inline(always)]
fn each_vector<S: Simd, const N: usize, const M: usize>(
    simd: S,
    from: [&[f32]; N],
    to: [&mut [f32]; M],
    transform: impl Fn([S::f32s; N]) -> [S::f32s; M],
) {
    let from = from.map(S::as_simd_f32s);
    let mut to = to.map(S::as_mut_simd_f32s);
    let whole = from[0].0.len();
    let heads: [&[S::f32s]; N] = std::array::from_fn(|k| &from[k].0[..whole]);
    let mut into: [&mut [S::f32s]; M] = to.each_mut().map(|to| &mut to.0[..whole]);
    for v in 0..whole {
        let transformed = transform(std::array::from_fn(|k| heads[k][v]));
        into.iter_mut().zip(transformed).for_each(|(to, number)| to[v] = number);
    }
    if !from[0].1.is_empty() {
        let transformed = transform(std::array::from_fn(|k| simd.partial_load_f32s(from[k].1)));
        to.iter_mut().zip(transformed).for_each(|(to, v)| simd.partial_store_f32s(to.1, v));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    fn numbers(name: &str, n: usize) -> Vec<f32> {
        let stream = Stream::new(5, name);
        (0..n).map(|i| 2.0 * stream.uniform(i as u64) - 1.0).collect()
    }

    fn geometry(height: usize, width: usize, channels: usize) -> Geometry {
        Geometry {
            height,
            width,
            channels,
            out_height: height,
            out_width: width,
            kernel: (3, 3),
            stride: 1,
            padding: 1,
        }
    }

    /// Plain sums in double precision.
    fn plain(g: Geometry, images: &[f32], weight: &Matrix, bias: Option<&[f32]>) -> Vec<f64> {
        let mut out = Vec::new();
        for image in images.chunks_exact(g.height * g.width * g.channels) {
            for (y, x) in (0..g.height).flat_map(|y| (0..g.width).map(move |x| (y, x))) {
                for (o, weight) in weight.values().chunks_exact(weight.cols()).enumerate() {
                    let mut sum = bias.map_or(0.0, |bias| f64::from(bias[o]));
                    for (k, w) in weight.iter().enumerate() {
                        let (channel, row, column) = (k / 9, y + k % 9 / 3, x + k % 3);
                        if (1..=g.height).contains(&row) && (1..=g.width).contains(&column) {
                            let place = (row - 1) * g.width + column - 1;
                            let value = image[place * g.channels + channel];
                            sum += f64::from(*w) * f64::from(value);
                        }
                    }
                    out.push(sum);
                }
            }
        }
        out
    }

    #[test]
    fn outputs_are_the_plain_sums() {
        let sizes = [(8, 8, 8, 8), (2, 34, 13, 20), (12, 6, 40, 9), (10, 8, 64, 70)];
        for (height, width, channels, outputs) in sizes {
            let g = geometry(height, width, channels);
            let images = numbers("images", 3 * height * width * channels);
            let weight =
                Matrix::new(outputs, 9 * channels, numbers("weight", outputs * 9 * channels));
            let bias = numbers("bias", outputs);
            for bias in [Some(bias.as_slice()), None] {
                let found = convolution(g, &images, &pack(&weight), bias, outputs);
                let wanted = plain(g, &images, &weight, bias);
                assert_eq!(found.values().len(), wanted.len());
                for (i, (found, wanted)) in found.values().iter().zip(&wanted).enumerate() {
                    let off = (f64::from(*found) - wanted).abs();
                    assert!(off < 2e-5, "{height} x {width} x {channels} at {i}: off by {off}");
                }
            }
        }
    }

    #[test]
    fn an_image_has_the_same_bits_in_any_batch_and_on_any_threads() {
        let (g, outputs) = (geometry(16, 12, 24), 40);
        let images = numbers("images", 7 * 16 * 12 * 24);
        let weights = pack(&Matrix::new(outputs, 9 * 24, numbers("weight", outputs * 9 * 24)));
        let all = convolution(g, &images, &weights, None, outputs);
        let own = images.chunks_exact(16 * 12 * 24);
        for (image, wanted) in own.zip(all.values().chunks_exact(16 * 12 * outputs)) {
            assert_eq!(convolution(g, image, &weights, None, outputs).values(), wanted);
        }
        let pool = rayon::ThreadPoolBuilder::new().num_threads(3).build().unwrap();
        let again = pool.install(|| convolution(g, &images, &weights, None, outputs));
        assert_eq!(again.values(), all.values());
    }
}
