//! Where an output of ours keeps everything but its columns.

pub(super) const META: &str = "corsmal.meta";
pub(super) const CONFIG: &str = "corsmal.config";
pub(super) const OUTCOMES: &str = "corsmal.outcomes";
pub(super) const BLOCKS: &str = "corsmal.blocks";
pub(super) const HASH: &str = "corsmal.hash";

/// What a file of ours names as its writer.
pub(super) const WRITER: &str = "corsmal-feat";

/// Rows written together, and read at a time.
pub(super) const ROWS: usize = 1 << 16;
