//! Exact running medians of matrices, many lines at once in vector lanes.
//!
//! `scipy.ndimage.median_filter(mode="reflect")`: the axis continues as its mirror image with the
//! edge value repeated, and of an even number of values the upper middle one is taken.

use std::ops::Range;

use ndarray::{ArrayView2, ArrayViewMut2};
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Arch, Simd, WithSimd};

use crate::stft::PadMode;
use crate::vector::Lane;

/// Window length of the sorting network, librosa's default for both HPSS filters.
const NETWORK: usize = 31;
/// Successive medians that one pass of the network gives.
const BLOCK: usize = 16;
/// Values that [`BLOCK`] windows cover together.
const SPAN: usize = NETWORK + BLOCK - 1;

/// Medians over `size` rows, column by column, for the rows `wanted` of `x`, into `out`
/// `[wanted.len(), columns]`. Only rows within half a window of `wanted` are read.
///
/// # Panics
/// When `out` has another shape, or a matrix is not contiguous along its rows.
pub fn down<T: Lane>(x: ArrayView2<T>, size: usize, wanted: Range<usize>, out: ArrayViewMut2<T>) {
    assert_eq!(out.dim(), (wanted.len(), x.ncols()), "one output row per wanted row");
    if size > 1 && !out.is_empty() {
        Arch::new().dispatch(Down { x, size, wanted, out });
    } else {
        let mut out = out;
        out.assign(&x.slice(ndarray::s![wanted, ..]));
    }
}

/// Medians over `size` columns, row by row, into `out` of the shape of `x`.
///
/// # Panics
/// When `out` has another shape, or a matrix is not contiguous along its rows.
pub fn across<T: Lane>(x: ArrayView2<T>, size: usize, out: ArrayViewMut2<T>) {
    assert_eq!(out.dim(), x.dim(), "one output per input");
    if size > 1 && !out.is_empty() {
        Arch::new().dispatch(Across { x, size, out });
    } else {
        let mut out = out;
        out.assign(&x);
    }
}

/// Index of the value that position `i - size / 2` of a line of `n` takes.
fn reflected(i: usize, size: usize, n: usize) -> usize {
    let at = i as isize - (size / 2) as isize;
    PadMode::Symmetric.index(at, n).expect("lines are not empty")
}

struct Down<'x, 'out, T> {
    x: ArrayView2<'x, T>,
    size: usize,
    wanted: Range<usize>,
    out: ArrayViewMut2<'out, T>,
}

impl<T: Lane> WithSimd for Down<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let (n, columns) = self.x.dim();
        let lanes = T::lanes::<S>();
        let row = |i: usize| {
            let i = reflected(self.wanted.start + i, self.size, n);
            self.x.row(i).to_slice().expect("contiguous rows")
        };
        if self.size == NETWORK {
            for first in (0..self.wanted.len()).step_by(BLOCK) {
                let rows: [&[T]; SPAN] = std::array::from_fn(|k| row(first + k));
                let mut medians = [T::splat(simd, T::zero()); BLOCK];
                for c in (0..columns).step_by(lanes) {
                    let end = columns.min(c + lanes);
                    let mut x = [T::splat(simd, T::zero()); SPAN];
                    for (v, row) in x.iter_mut().zip(&rows) {
                        *v = T::load(simd, &row[c..end]);
                    }
                    medians31::<T, S>(simd, &x, &mut medians);
                    for (k, &v) in medians.iter().enumerate().take(self.wanted.len() - first) {
                        let mut line = self.out.row_mut(first + k);
                        let line = line.as_slice_mut().expect("contiguous rows");
                        T::store(simd, &mut line[c..end], v);
                    }
                }
            }
        } else {
            let rows: Vec<&[T]> = (0..self.wanted.len() + self.size - 1).map(row).collect();
            let zero = T::splat(simd, T::zero());
            let (mut x, mut medians) = (vec![zero; rows.len()], vec![zero; self.wanted.len()]);
            for c in (0..columns).step_by(lanes) {
                let end = columns.min(c + lanes);
                for (v, row) in x.iter_mut().zip(&rows) {
                    *v = T::load(simd, &row[c..end]);
                }
                slide::<T, S>(simd, self.size, &x, &mut medians);
                for (k, &v) in medians.iter().enumerate() {
                    let mut line = self.out.row_mut(k);
                    let line = line.as_slice_mut().expect("contiguous rows");
                    T::store(simd, &mut line[c..end], v);
                }
            }
        }
    }
}

struct Across<'x, 'out, T> {
    x: ArrayView2<'x, T>,
    size: usize,
    out: ArrayViewMut2<'out, T>,
}

impl<T: Lane> WithSimd for Across<'_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let (n_rows, n) = self.x.dim();
        let lanes = T::lanes::<S>();
        let padded = n.next_multiple_of(BLOCK) + self.size - 1;
        let sources: Vec<usize> = (0..padded).map(|i| reflected(i, self.size, n)).collect();
        // Rows become lanes: one register per column.
        let zero = T::splat(simd, T::zero());
        let mut strip = vec![zero; padded];
        let mut medians = vec![zero; n.next_multiple_of(BLOCK)];
        for first in (0..n_rows).step_by(lanes) {
            let used = lanes.min(n_rows - first);
            let values: &mut [T] = cast_slice_mut(&mut strip);
            for lane in 0..used {
                let row = self.x.row(first + lane);
                let row = row.to_slice().expect("contiguous rows");
                for (register, &source) in values.chunks_exact_mut(lanes).zip(&sources) {
                    register[lane] = row[source];
                }
            }
            if self.size == NETWORK {
                for (c, block) in medians.as_chunks_mut().0.iter_mut().enumerate() {
                    let x = strip[c * BLOCK..].first_chunk().expect("padded to whole blocks");
                    medians31::<T, S>(simd, x, block);
                }
            } else {
                slide::<T, S>(simd, self.size, &strip, &mut medians);
            }
            let values: &[T] = cast_slice(&medians);
            for lane in 0..used {
                let mut row = self.out.row_mut(first + lane);
                let row = row.as_slice_mut().expect("contiguous rows");
                for (value, register) in row.iter_mut().zip(values.chunks_exact(lanes)) {
                    *value = register[lane];
                }
            }
        }
    }
}

/// Medians of every window of `size` registers of `x`: a sorted window in which each step exchanges
/// one value, without branches.
#[inline(always)]
fn slide<T: Lane, S: Simd>(simd: S, size: usize, x: &[T::V<S>], medians: &mut [T::V<S>]) {
    let infinity = T::splat(simd, T::infinity());
    let mut window = vec![infinity; size];
    for (next, &new) in x.iter().enumerate() {
        // The first `size` steps replace the infinities.
        let old = if next < size { infinity } else { x[next - size] };
        let mut below = T::lower(simd, window[0], new);
        let mut carry = T::higher(simd, window[0], new);
        for i in 1..=size {
            let at = if i < size { window[i] } else { carry };
            let value = T::lower(simd, at, carry);
            carry = T::higher(simd, at, carry);
            window[i - 1] = T::select_lt(simd, below, old, below, value);
            below = value;
        }
        if next + 1 >= size {
            medians[next + 1 - size] = window[size / 2];
        }
    }
}

/// The medians of the [`BLOCK`] windows of 31 values that start at `x[0]` to `x[15]`.
///
/// A tree over the outputs (Adams 2021, "Fast median filters using separable sorting networks", in
/// one dimension): the values common to `m` windows are sorted once, cut down to the ranks that can
/// still become the median, and merged with the sorted values that each half of the windows adds.
/// Of the windows `o..o + m` the lower half adds the values from `o + m / 2 - 1` on, the upper half
/// those from `o + 31` on.
#[inline(always)]
fn medians31<T: Lane, S: Simd>(simd: S, x: &[T::V<S>; SPAN], out: &mut [T::V<S>; BLOCK]) {
    let net = Net::<T, S> { simd, x };
    let core = net.merge8(net.eight(15), net.eight(23));
    net.medians8(net.select16(core, net.eight(7)), 0, out);
    net.medians8(net.select16(core, net.eight(31)), 8, out);
}

/// Comparator networks over the registers `x`.
struct Net<'a, T: Lane, S: Simd> {
    simd: S,
    x: &'a [T::V<S>; SPAN],
}

macro_rules! comparators {
    ($net:ident, $v:ident: $($i:literal $j:literal),*) => {
        $(
            let (low, high) = $net.compare($v[$i], $v[$j]);
            $v[$i] = low;
            $v[$j] = high;
        )*
    };
}

/// Merges two sorted groups of `$n`: the second is taken backwards, which makes the whole bitonic.
macro_rules! merge {
    ($name:ident, $n:literal, $whole:literal, $clean:ident) => {
        #[inline(always)]
        fn $name(&self, a: [T::V<S>; $n], b: [T::V<S>; $n]) -> [T::V<S>; $whole] {
            let mut low = a;
            let mut high = b;
            for i in 0..$n {
                (low[i], high[i]) = self.compare(a[i], b[$n - 1 - i]);
            }
            self.$clean(&mut low);
            self.$clean(&mut high);
            let mut whole = [a[0]; $whole];
            whole[..$n].copy_from_slice(&low);
            whole[$n..].copy_from_slice(&high);
            whole
        }
    };
}

/// Of `$n` sorted values `a` and `$half` sorted values `b`, the middle `$half` in order.
macro_rules! select {
    ($name:ident, $n:literal, $half:literal, $clean:ident) => {
        #[inline(always)]
        fn $name(&self, a: [T::V<S>; $n], b: [T::V<S>; $half]) -> [T::V<S>; $half] {
            let mut v = b;
            for i in 0..$half {
                v[i] = T::higher(self.simd, a[i], b[$half - 1 - i]);
            }
            self.$clean(&mut v);
            for i in 0..$half {
                v[i] = T::lower(self.simd, v[i], a[$n - 1 - i]);
            }
            self.$clean(&mut v);
            v
        }
    };
}

impl<T: Lane, S: Simd> Net<'_, T, S> {
    #[inline(always)]
    fn compare(&self, a: T::V<S>, b: T::V<S>) -> (T::V<S>, T::V<S>) {
        (T::lower(self.simd, a, b), T::higher(self.simd, a, b))
    }

    /// Sorts a bitonic pair.
    #[inline(always)]
    fn clean2(&self, v: &mut [T::V<S>; 2]) {
        comparators!(self, v: 0 1);
    }

    /// Sorts four bitonic values.
    #[inline(always)]
    fn clean4(&self, v: &mut [T::V<S>; 4]) {
        comparators!(self, v: 0 2, 1 3, 0 1, 2 3);
    }

    /// Sorts eight bitonic values.
    #[inline(always)]
    fn clean8(&self, v: &mut [T::V<S>; 8]) {
        comparators!(self, v: 0 4, 1 5, 2 6, 3 7, 0 2, 1 3, 4 6, 5 7, 0 1, 2 3, 4 5, 6 7);
    }

    merge!(merge2, 2, 4, clean2);
    merge!(merge4, 4, 8, clean4);
    merge!(merge8, 8, 16, clean8);
    select!(select4, 4, 2, clean2);
    select!(select8, 8, 4, clean4);
    select!(select16, 16, 8, clean8);

    /// `x[k..k + 2]` in order.
    #[inline(always)]
    fn pair(&self, k: usize) -> [T::V<S>; 2] {
        let (low, high) = self.compare(self.x[k], self.x[k + 1]);
        [low, high]
    }

    /// `x[k..k + 4]` in order.
    #[inline(always)]
    fn four(&self, k: usize) -> [T::V<S>; 4] {
        self.merge2(self.pair(k), self.pair(k + 2))
    }

    /// `x[k..k + 8]` in order.
    #[inline(always)]
    fn eight(&self, k: usize) -> [T::V<S>; 8] {
        self.merge4(self.four(k), self.four(k + 4))
    }

    /// Medians of the windows `o..o + 8` from the candidates among their common values.
    #[inline(always)]
    fn medians8(&self, core: [T::V<S>; 8], o: usize, out: &mut [T::V<S>; BLOCK]) {
        self.medians4(self.select8(core, self.four(o + 3)), o, out);
        self.medians4(self.select8(core, self.four(o + 31)), o + 4, out);
    }

    #[inline(always)]
    fn medians4(&self, core: [T::V<S>; 4], o: usize, out: &mut [T::V<S>; BLOCK]) {
        self.medians2(self.select4(core, self.pair(o + 1)), o, out);
        self.medians2(self.select4(core, self.pair(o + 31)), o + 2, out);
    }

    /// Of two ordered candidates and one value the median is the one in the middle.
    #[inline(always)]
    fn medians2(&self, core: [T::V<S>; 2], o: usize, out: &mut [T::V<S>; BLOCK]) {
        let [low, high] = core;
        out[o] = T::lower(self.simd, T::higher(self.simd, low, self.x[o]), high);
        out[o + 1] = T::lower(self.simd, T::higher(self.simd, low, self.x[o + 31]), high);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::Array2;

    /// Sorts every window.
    fn by_sorting<T: Lane>(x: &Array2<T>, size: usize, axis: usize) -> Array2<T> {
        let n = x.shape()[axis];
        Array2::from_shape_fn(x.dim(), |(i, j)| {
            let centre = if axis == 0 { i } else { j };
            let mut window: Vec<T> = (0..size)
                .map(|k| reflected(centre + k, size, n))
                .map(|k| if axis == 0 { x[[k, j]] } else { x[[i, k]] })
                .collect();
            window.sort_by(|a, b| a.partial_cmp(b).unwrap());
            window[size / 2]
        })
    }

    fn noise<T: Lane>(rows: usize, columns: usize) -> Array2<T> {
        let mut state = 0x2545_f491_4f6c_dd1d_u64;
        Array2::from_shape_simple_fn((rows, columns), || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            // Few distinct values, so that ties occur.
            T::of((state % 50) as f64 / 7.0)
        })
    }

    fn equals_sorting<T: Lane + std::fmt::Debug>() {
        for (rows, columns) in [(1, 1), (2, 3), (5, 40), (16, 16), (17, 33), (70, 19), (47, 130)] {
            let x = noise::<T>(rows, columns);
            for size in [1, 2, 3, 8, 17, 31, 45] {
                let mut out = Array2::zeros(x.dim());
                down(x.view(), size, 0..rows, out.view_mut());
                assert_eq!(out, by_sorting(&x, size, 0), "down {rows}x{columns}, {size}");
                across(x.view(), size, out.view_mut());
                assert_eq!(out, by_sorting(&x, size, 1), "across {rows}x{columns}, {size}");
            }
        }
    }

    #[test]
    fn running_medians_equal_sorted_windows() {
        equals_sorting::<f32>();
        equals_sorting::<f64>();
    }

    #[test]
    fn a_range_of_rows_equals_its_part_of_the_whole() {
        let x = noise::<f32>(60, 21);
        let whole = by_sorting(&x, 31, 0);
        let mut out = Array2::zeros((13, 21));
        down(x.view(), 31, 40..53, out.view_mut());
        assert_eq!(out, whole.slice(ndarray::s![40..53, ..]));
    }
}
