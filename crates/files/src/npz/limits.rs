//! What an archive may ask for.

/// What is made of a deflated member may always take this many bytes (128 MiB), and so may all text
/// of an archive together.
pub const MAX_INFLATED: u64 = 128 << 20;
/// Beyond that it may take this many times the compressed size.
pub const MAX_RATIO: u64 = 200;
/// Most strings of a member.
pub const MAX_STRINGS: u64 = 1 << 26;
