//! The HTML reports of `cross-validate` and `score`, from what both computed.

mod held_out;
mod page;
mod recordings;
mod scored;

pub use held_out::{Explained, HeldOut};
pub use page::prepare;
pub use scored::{Scored, write_estimates, write_scored};
