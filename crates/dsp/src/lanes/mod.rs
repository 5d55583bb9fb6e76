//! Sixteen transforms at once: every array element is a row of [`LANES`] values, one per
//! (frame, channel) slot, and every operation is a vertical vector operation on rows.
//!
//! Interleaved multi-channel audio already has this shape, so no deinterleaving is needed; a single
//! channel uses its lanes for consecutive frames. Slots never mix, hence a frame has the same bits
//! whatever shares its block. The instruction set (AVX-512, AVX2 + FMA, NEON, or plain code) is
//! chosen at run time by the `pulp` crate; this module has no unsafe code.

mod complex;
mod decibel;
mod fft;
mod gather;
mod spectrum;
mod twiddles;
mod weighted;

pub(crate) use decibel::decibel_double;
pub use decibel::power_to_decibel;
pub use fft::LaneFft;
pub use gather::{Aligned, Frames, Slots, gather};
pub use spectrum::{Spectrum, square_roots};
pub use weighted::weighted_sums;

use pulp::Simd;

/// Slots of a row.
pub const LANES: usize = 16;

/// One value of each slot, aligned to a cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Row(pub [f32; LANES]);

impl Row {
    /// All slots zero.
    pub const ZERO: Self = Self([0.0; LANES]);

    /// Register `v` of the row.
    #[inline(always)]
    fn load<S: Simd>(&self, v: usize) -> S::f32s {
        S::as_simd_f32s(&self.0).0[v]
    }

    /// Replaces register `v` of the row.
    #[inline(always)]
    fn store<S: Simd>(&mut self, v: usize, value: S::f32s) {
        S::as_mut_simd_f32s(&mut self.0).0[v] = value;
    }
}

/// Registers in a row.
#[inline(always)]
const fn registers<S: Simd>() -> usize {
    LANES / S::F32_LANES
}
