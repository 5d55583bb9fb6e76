//! Parameters that several features share, with librosa's names and defaults; how a table of them is
//! checked, and how it is refused.

mod decibel;
mod error;
mod keys;
mod limits;
mod mel;
mod table;
mod transform;
mod word;

pub use decibel::{DbRef, DbSpec, Scale, TopDb};
pub use error::ConfigError;
pub use keys::{Keys, LIBROSA, elsewhere};
pub use limits::{MAX_FRAME, MAX_N_FFT, USUAL_RATE, at_most};
pub use mel::MelSpec;
pub use table::typed;
pub use transform::{FrameSpec, StftSpec};
pub use word::AutoOr;
