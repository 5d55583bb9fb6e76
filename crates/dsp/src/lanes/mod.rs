//! Sixteen transforms at once (eight in double precision): every array element is a row of [`LANES`]
//! values, one per (frame, channel) slot, and every operation is a vertical vector operation on rows.
//!
//! Interleaved multi-channel audio already has this shape, so no deinterleaving is needed; a single
//! channel uses its lanes for consecutive frames. Slots never mix, hence a frame has the same bits
//! whatever shares its block. The instruction set (AVX-512, AVX2 + FMA, NEON, or plain code) is
//! chosen at run time by the `pulp` crate; this module has no unsafe code.

mod complex;
mod convolution;
mod decibel;
mod fft;
mod gather;
mod passes;
mod row;
mod spectrum;
mod twiddles;
mod weighted;

pub(crate) use convolution::{Change, Convolution};
pub use decibel::power_to_decibel;
pub(crate) use decibel::{decibel, decibel_double, logarithm};
pub use fft::LaneFft;
pub use gather::{Aligned, Frames, Slots, gather};
pub(crate) use gather::{gather_double, gather_part};
pub use row::{DoubleRow, LANES, Lanes, Row};
pub use spectrum::{Spectrum, square_roots};
pub use weighted::weighted_sums;
