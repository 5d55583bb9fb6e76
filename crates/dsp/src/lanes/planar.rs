//! Windowed frames of one channel into rows.

use super::{LANES, Row};
use crate::simd::vectorized;

/// Sixteen consecutive frames of a signal as rows: `rows[n][f] = window[n] * signal[f * hop + n]`.
///
/// Overlapping frames share samples, so the signal is transposed first, each sample once: column
/// `t` of the table holds the samples from `t * hop` on, and sample `n = q * hop + r` of sixteen
/// frames are sixteen neighbours in row `r` from column `q` on.
pub struct Planar {
    hop: usize,
    window: Vec<f32>,
    /// Columns in use, and their number rounded up to whole rows.
    width: usize,
    stride: usize,
    table: Vec<f32>,
}

impl Planar {
    /// Frames of `window.len()` samples, `hop` (at least 1) apart.
    pub fn new(window: Vec<f32>, hop: usize) -> Self {
        let width = LANES + window.len().saturating_sub(1) / hop;
        let stride = width.next_multiple_of(LANES);
        let table = vec![0.0; hop.min(window.len()) * stride];
        Self { hop, window, width, stride, table }
    }

    /// Samples that sixteen frames reach.
    pub fn span(&self) -> usize {
        (LANES - 1) * self.hop + self.window.len()
    }

    /// Fills `rows`, one per sample of the window, from [`span`](Self::span) samples.
    pub fn gather(&mut self, samples: &[f32], rows: &mut [Row]) {
        assert_eq!((samples.len(), rows.len()), (self.span(), self.window.len()));
        let Self { hop, window, width, stride, table } = self;
        let (hop, width, stride) = (*hop, *width, *stride);
        vectorized(
            #[inline(always)]
            || {
                for (r, block) in table.chunks_mut(LANES * stride).enumerate() {
                    fill(samples, r * LANES, hop, width, stride, block);
                }
                for (q, (rows, window)) in rows.chunks_mut(hop).zip(window.chunks(hop)).enumerate()
                {
                    let columns = table.chunks_exact(stride).map(|row| &row[q..q + LANES]);
                    for ((row, w), x) in rows.iter_mut().zip(window).zip(columns) {
                        for (slot, x) in row.0.iter_mut().zip(x) {
                            *slot = x * w;
                        }
                    }
                }
            },
        );
    }
}

/// Rows `first..` of the table, sixteen or what is left, each `stride` long.
#[inline(always)]
fn fill(samples: &[f32], first: usize, hop: usize, width: usize, stride: usize, block: &mut [f32]) {
    for t in (0..width).step_by(LANES) {
        let mut tile = [[0.0; LANES]; LANES];
        for (column, source) in tile.iter_mut().enumerate() {
            let start = (t + column) * hop + first;
            if let Some(whole) = samples.get(start..start + LANES) {
                source.copy_from_slice(whole);
            } else if let Some(rest) = samples.get(start..) {
                source[..rest.len()].copy_from_slice(rest);
            }
        }
        let tile = transposed(tile);
        for (row, values) in block.chunks_exact_mut(stride).zip(&tile) {
            row[t..t + LANES].copy_from_slice(values);
        }
    }
}

/// The transpose: four perfect shuffles of all 256 values, each of which a vector unit does by
/// interleaving rows.
#[inline(always)]
fn transposed(mut tile: [[f32; LANES]; LANES]) -> [[f32; LANES]; LANES] {
    const HALF: usize = LANES / 2;
    for _ in 0..LANES.ilog2() {
        let mut next = [[0.0; LANES]; LANES];
        for i in 0..HALF {
            for j in 0..HALF {
                next[2 * i][2 * j] = tile[i][j];
                next[2 * i][2 * j + 1] = tile[i + HALF][j];
                next[2 * i + 1][2 * j] = tile[i][j + HALF];
                next[2 * i + 1][2 * j + 1] = tile[i + HALF][j + HALF];
            }
        }
        tile = next;
    }
    tile
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_framing_puts_the_same_samples_into_its_slots() {
        for (n, hop) in [(64, 16), (64, 64), (64, 100), (33, 7), (2048, 512), (5, 1), (1, 3)] {
            let window: Vec<f32> = (0..n).map(|i| 1.0 + i as f32).collect();
            let mut planar = Planar::new(window.clone(), hop);
            let samples: Vec<f32> = (0..planar.span()).map(|i| i as f32).collect();
            let mut rows = vec![Row([f32::NAN; LANES]); n];
            for _ in 0..2 {
                planar.gather(&samples, &mut rows);
                for (i, row) in rows.iter().enumerate() {
                    let want = std::array::from_fn(|f| samples[f * hop + i] * window[i]);
                    assert_eq!(row.0, want, "n {n} hop {hop} sample {i}");
                }
            }
        }
    }
}
