//! What every container says before its samples.

use super::extent::Extent;
use super::format::{Endian, Format};
use crate::report::Repair;

/// All that is known before the first sample.
#[derive(Debug)]
pub(crate) struct Header {
    /// The name of the container, as ffmpeg or its own mark calls it.
    pub(crate) container: &'static str,
    pub(crate) format: Format,
    pub(crate) endian: Endian,
    pub(crate) extent: Extent,
    pub(crate) repairs: Vec<Repair>,
}
