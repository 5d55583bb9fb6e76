//! Spectrogram frames one at a time: `[channels, bins, frames]` arrays keep a frame strided in
//! memory, so blocks of frames are transposed before the per-spectrum kernels see them.

use ndarray::{Array3, ArrayView3, s};
use num_traits::Zero;

use crate::lanes::LANES;
use crate::tiles::read_columns;

/// Frames transposed at a time.
const BLOCK: usize = LANES;

/// Calls `each(channel, frame, spectrum)` for every frame, frames in order within a channel.
pub fn for_each_column<T: Copy + Default>(
    spectrogram: ArrayView3<T>,
    mut each: impl FnMut(usize, usize, &[T]),
) {
    let (channels, bins, frames) = spectrogram.dim();
    let mut block = vec![T::default(); bins * BLOCK.min(frames)];
    for c in 0..channels {
        for start in (0..frames).step_by(BLOCK) {
            let end = frames.min(start + BLOCK);
            read_columns(spectrogram.slice(s![c, .., start..end]), &mut block);
            for t in start..end {
                let from = (t - start) * bins;
                each(c, t, &block[from..from + bins]);
            }
        }
    }
}

/// `[channels, rows, frames]` made by `each(channel, frame, spectrum, out)`, where `out` holds the
/// `rows` values of that frame.
pub fn map_columns<T: Copy + Default, R: Copy + Zero>(
    spectrogram: ArrayView3<T>,
    rows: usize,
    mut each: impl FnMut(usize, usize, &[T], &mut [R]),
) -> Array3<R> {
    let (channels, _, frames) = spectrogram.dim();
    let mut result = Array3::zeros((channels, rows, frames));
    let mut out = vec![R::zero(); rows];
    for_each_column(spectrogram, |c, t, spectrum| {
        each(c, t, spectrum, &mut out);
        for (slot, x) in result.slice_mut(s![c, .., t]).iter_mut().zip(&out) {
            *slot = *x;
        }
    });
    result
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_frame_is_seen_whole() {
        let a = Array3::from_shape_fn((2, 3, 37), |(c, k, t)| (1000 * c + 100 * k + t) as f64);
        let b = map_columns(a.view(), 3, |c, t, spectrum, out: &mut [f64]| {
            assert_eq!(spectrum[0], (1000 * c + t) as f64);
            out.copy_from_slice(spectrum);
        });
        assert_eq!(a, b);
        let strided = a.slice(s![.., .., ..;-1]);
        assert_eq!(map_columns(strided, 3, |_, _, x, out| out.copy_from_slice(x)), strided);
    }
}
