//! What each output of a convolution sees of its image.

use std::ops::Range;

use crate::kernels;
use crate::matrix::{Matrix, Stretches};
use crate::packed::Runs;

/// Places that a piece of work for a thread should have: images are taken together until there are as many.
const PLACES: usize = 1024;
/// Numbers that are gathered at a time: about what stays in a processor's second cache.
const GATHERED: usize = 1 << 17;
/// Places that are gathered at least: a product of fewer rows spends its time on the other matrix.
const LEAST: usize = 256;

/// Places that are computed at a time: what they see and their outputs stay in the second cache.
const TOGETHER: usize = 384;

/// Sizes of a convolution over one image.
#[derive(Clone, Copy, Debug)]
pub(super) struct Geometry {
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) channels: usize,
    pub(super) out_height: usize,
    pub(super) out_width: usize,
    pub(super) kernel: (usize, usize),
    pub(super) stride: usize,
    pub(super) padding: usize,
}

/// Rows of outputs, counted over all images of a batch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tile {
    /// image that its group begins with
    group: usize,
    first: usize,
    end: usize,
}

impl Tile {
    fn lines(self) -> Range<usize> {
        self.first..self.end
    }
}

/// What the outputs of a tile see, a row for each.
pub(super) enum Seen<'a> {
    /// gathered
    Gathered(Matrix),
    /// where it lies in the images already
    There(&'a Matrix, Stretches),
}

impl Seen<'_> {
    pub(super) fn rows(&self) -> usize {
        match self {
            Self::Gathered(matrix) => matrix.rows(),
            Self::There(_, stretches) => stretches.rows,
        }
    }

    /// Times `weight^T`.
    pub(super) fn dot_t(&self, weight: &Matrix) -> Matrix {
        match self {
            Self::Gathered(matrix) => matrix.dot_t(weight),
            Self::There(images, stretches) => images.stretches_dot_t(*stretches, weight),
        }
    }

    /// `gradient^T` times this.
    pub(super) fn t_dot(&self, gradient: &Matrix) -> Matrix {
        match self {
            Self::Gathered(matrix) => gradient.t_dot(matrix),
            Self::There(images, stretches) => gradient.t_dot_stretches(images, *stretches),
        }
    }

    /// Leaves its memory to the next.
    pub(super) fn give_back(self, buffer: &mut Vec<f32>) {
        if let Self::Gathered(matrix) = self {
            *buffer = matrix.into_values();
        }
    }
}

/// Memory for [`Geometry::runs_of`].
#[derive(Default)]
pub(super) struct Work {
    padded: Vec<f32>,
    starts: Vec<usize>,
}

impl Geometry {
    /// Rows of outputs that are computed at a time.
    pub(super) fn lines_together(&self) -> usize {
        TOGETHER.div_ceil(self.out_width.max(1))
    }

    /// What these rows of outputs see, counted over all images: runs of pixels in the images, or in a copy with
    /// their padding.
    pub(super) fn runs_of<'a>(
        &self,
        images: &'a [f32],
        lines: Range<usize>,
        work: &'a mut Work,
    ) -> Runs<'a> {
        let (padding, channels) = (self.padding, self.channels);
        let width = (self.width + 2 * padding) * channels;
        let Work { padded, starts } = work;
        padded.clear();
        starts.clear();
        let mut line = lines.start;
        while line < lines.end {
            let (image, first) = (line / self.out_height, line % self.out_height);
            let count = (lines.end - line).min(self.out_height - first);
            let image = image * self.input_len();
            let origin = match padding {
                0 => image + first * self.stride * width,
                _ => padded.len(),
            };
            for y in 0..count {
                let of_line = origin + y * self.stride * width;
                starts.extend((0..self.out_width).map(|x| of_line + x * self.stride * channels));
            }
            if padding > 0 {
                let rows = first * self.stride..(first + count - 1) * self.stride + self.kernel.0;
                for row in rows {
                    let end = padded.len() + width;
                    if (padding..padding + self.height).contains(&row) {
                        let row = image + (row - padding) * self.width * channels;
                        padded.resize(padded.len() + padding * channels, 0.0);
                        padded.extend_from_slice(&images[row..row + self.width * channels]);
                    }
                    padded.resize(end, 0.0);
                }
            }
            line += count;
        }
        let values = if padding > 0 { padded } else { images };
        let (count, length) = match self.is_whole() {
            true => (1, self.field()),
            false => (self.kernel.0, self.kernel.1 * channels),
        };
        Runs { values, starts, count, jump: width, length }
    }

    pub(super) fn input_len(&self) -> usize {
        self.height * self.width * self.channels
    }

    pub(super) fn out_places(&self) -> usize {
        self.out_height * self.out_width
    }

    /// Numbers that an output sees.
    fn field(&self) -> usize {
        self.kernel.0 * self.kernel.1 * self.channels
    }

    /// Images that are a piece of work for a thread.
    pub(super) fn group(&self) -> usize {
        PLACES.div_ceil(self.out_places().max(1))
    }

    /// Whether a kernel sees whole rows of pixels, which lie side by side.
    fn is_whole(&self) -> bool {
        self.kernel.1 == self.width && self.padding == 0
    }

    /// The tiles of `images` images from `first` on.
    pub(super) fn tiles(&self, first: usize, images: usize) -> impl Iterator<Item = Tile> + use<> {
        let places = LEAST.max(GATHERED / self.field().max(1));
        let lines = match self.is_whole() {
            true => self.out_height,
            false => places.div_ceil(self.out_width.max(1)),
        };
        let (begin, end) = (first * self.out_height, (first + images) * self.out_height);
        (begin..end).step_by(lines.max(1)).map(move |at| Tile {
            group: first,
            first: at,
            end: end.min(at + lines),
        })
    }

    /// What the outputs of a tile see.
    pub(super) fn seen<'a>(
        &self,
        images: &'a Matrix,
        tile: Tile,
        buffer: &mut Vec<f32>,
    ) -> Seen<'a> {
        if self.is_whole() {
            let (image, row) = (tile.first / self.out_height, tile.first % self.out_height);
            let step = self.stride * self.width * self.channels;
            let (first, cols) = (image * self.input_len() + row * step, self.field());
            return Seen::There(images, Stretches { first, step, rows: tile.lines().len(), cols });
        }
        let images = images.values();
        let (field, rows) = (self.field(), tile.lines().len() * self.out_width);
        let mut out = std::mem::take(buffer);
        // Every number is written below, padding included.
        out.resize(rows * field, 0.0);
        let lines = out.chunks_exact_mut((self.out_width * field).max(1));
        for (line, out) in tile.lines().zip(lines) {
            let (image, y) = (line / self.out_height, line % self.out_height);
            let image = &images[image * self.input_len()..][..self.input_len()];
            self.runs(y, |x, kernel_row, run| {
                let at = x * field + kernel_row * self.kernel.1 * self.channels;
                let to = &mut out[at..at + self.kernel.1 * self.channels];
                let Some((from, before, len)) = run else { return to.fill(0.0) };
                to[..before].fill(0.0);
                to[before..before + len].copy_from_slice(&image[from..from + len]);
                to[before + len..].fill(0.0);
            });
        }
        Seen::Gathered(Matrix::new(rows, field, out))
    }

    /// Adds gradients by what the outputs of a tile see to the gradient by the images of its group.
    pub(super) fn add_back(&self, seen: &[f32], tile: Tile, images: &mut [f32]) {
        let field = self.field();
        let lines = seen.chunks_exact((self.out_width * field).max(1));
        for (line, seen) in tile.lines().zip(lines) {
            let (image, y) = (line / self.out_height - tile.group, line % self.out_height);
            let image = &mut images[image * self.input_len()..][..self.input_len()];
            kernels::vectorized(
                #[inline(always)]
                || {
                    self.runs(
                        y,
                        #[inline(always)]
                        |x, kernel_row, run| {
                            let Some((from, before, len)) = run else { return };
                            let at =
                                x * field + kernel_row * self.kernel.1 * self.channels + before;
                            let to = &mut image[from..from + len];
                            to.iter_mut().zip(&seen[at..at + len]).for_each(|(t, s)| *t += s);
                        },
                    );
                },
            );
        }
    }

    /// For each output of row `y` and row of the kernel: where the run of pixels begins in the image, how many
    /// numbers of padding precede it, and its numbers. None: all padding.
    #[inline(always)]
    fn runs(&self, y: usize, mut each: impl FnMut(usize, usize, Option<(usize, usize, usize)>)) {
        let (kernel_height, kernel_width) = self.kernel;
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
                each(x, k, run);
            }
        }
    }
}
