//! Passes of transforms over blocks of complex rows.

use pulp::Simd;

use super::Lanes;
use super::complex::{Dft, Pair, Points, load, mul, store};
use super::twiddles::twiddles;

/// Twiddles of a pass over blocks, for each column `w^0, w^j, w^2j, ...`.
pub(super) enum Stage<R: Lanes> {
    Four(Vec<[[R::Value; 2]; 4]>),
    Eight(Vec<[[R::Value; 2]; 8]>),
}

impl<R: Lanes> Stage<R> {
    /// The passes of these radices (4 or 8), the first over blocks of `size`, each next one over the parts of
    /// the blocks before.
    pub fn nested(radices: &[usize], mut size: usize) -> Vec<Self> {
        let stage = |radix: &usize| {
            let stage = match radix {
                8 => Self::Eight(twiddles(size, 1.0)),
                _ => Self::Four(twiddles(size, 1.0)),
            };
            size /= radix;
            stage
        };
        radices.iter().map(stage).collect()
    }

    /// Parts of a block.
    #[inline(always)]
    pub fn radix(&self) -> usize {
        match self {
            Self::Four(_) => 4,
            Self::Eight(_) => 8,
        }
    }

    /// Values of a block.
    #[inline(always)]
    pub fn size(&self) -> usize {
        match self {
            Self::Four(twiddles) => 4 * twiddles.len(),
            Self::Eight(twiddles) => 8 * twiddles.len(),
        }
    }

    /// From a block in natural order to its parts: transforms across them, then twiddles.
    #[inline(always)]
    pub fn forward<S: Simd>(&self, simd: S, block: &mut [Pair<R>]) {
        match self {
            Self::Four(twiddles) => forward(simd, block, twiddles),
            Self::Eight(twiddles) => forward(simd, block, twiddles),
        }
    }

    /// From transformed parts to the block in natural order: twiddles, then transforms across the parts.
    #[inline(always)]
    pub fn join<S: Simd>(&self, simd: S, block: &mut [Pair<R>]) {
        match self {
            Self::Four(twiddles) => join(simd, block, twiddles),
            Self::Eight(twiddles) => join(simd, block, twiddles),
        }
    }
}

/// The first `N` parts of `length` values.
#[inline(always)]
pub(super) fn parts<R: Lanes, const N: usize>(
    block: &mut [Pair<R>],
    length: usize,
) -> [&mut [Pair<R>]; N]
where
    Points: Dft<N>,
{
    let mut parts = block.chunks_exact_mut(length);
    Points::list(|_| parts.next().map_or(&mut [][..], |part| &mut part[..length]))
}

#[inline(always)]
fn forward<R: Lanes, S: Simd, const N: usize>(
    simd: S,
    block: &mut [Pair<R>],
    twiddles: &[[[R::Value; 2]; N]],
) where
    Points: Dft<N>,
{
    let length = twiddles.len();
    let mut parts = parts::<R, N>(block, length);
    for (j, w) in twiddles.iter().enumerate() {
        for v in 0..R::registers::<S>() {
            let x = Points::list(
                #[inline(always)]
                |q| load::<R, S>(&parts[q][j], v),
            );
            let y: [_; N] = Points::of::<R, S>(simd, x);
            let _: [(); N] = Points::list(
                #[inline(always)]
                |q| {
                    let turned = if q == 0 { y[0] } else { mul::<R, S>(simd, y[q], w[q]) };
                    store::<R, S>(&mut parts[q][j], v, turned);
                },
            );
        }
    }
}

#[inline(always)]
fn join<R: Lanes, S: Simd, const N: usize>(
    simd: S,
    block: &mut [Pair<R>],
    twiddles: &[[[R::Value; 2]; N]],
) where
    Points: Dft<N>,
{
    let length = twiddles.len();
    let mut parts = parts::<R, N>(block, length);
    for (j, w) in twiddles.iter().enumerate() {
        for v in 0..R::registers::<S>() {
            let x = Points::list(
                #[inline(always)]
                |q| {
                    let x = load::<R, S>(&parts[q][j], v);
                    if q == 0 { x } else { mul::<R, S>(simd, x, w[q]) }
                },
            );
            let y: [_; N] = Points::of::<R, S>(simd, x);
            let _: [(); N] = Points::list(
                #[inline(always)]
                |q| store::<R, S>(&mut parts[q][j], v, y[q]),
            );
        }
    }
}

/// The last pass forward: neighbouring points, into natural order.
#[inline(always)]
pub(super) fn leaves<R: Lanes, S: Simd, const N: usize>(simd: S, block: &mut [Pair<R>])
where
    Points: Dft<N>,
{
    for leaf in block.as_chunks_mut::<N>().0 {
        for v in 0..R::registers::<S>() {
            let x = Points::list(
                #[inline(always)]
                |q| load::<R, S>(&leaf[q], v),
            );
            let y: [_; N] = Points::of::<R, S>(simd, x);
            let _: [(); N] = Points::list(
                #[inline(always)]
                |q| store::<R, S>(&mut leaf[q], v, y[q]),
            );
        }
    }
}
