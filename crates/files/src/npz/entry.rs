//! One entry of an archive.

use serde::{Deserialize, Serialize};

/// How the entries of an archive are stored.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Compression {
    /// As they are.
    #[default]
    Stored,
    /// Deflated.
    Deflated,
}

/// A completed entry: all that is needed to continue the archive after it and to list it in the
/// central directory.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct EntryRecord {
    /// Name in the archive, `.npy` included.
    pub name: String,
    /// Byte of its local header.
    pub offset: u64,
    /// Byte after its data.
    pub end: u64,
    /// CRC-32 of the member.
    pub crc32: u32,
    /// CRC-32 of the member as stored in the archive.
    pub stored_crc32: u32,
    /// Bytes of the member.
    pub size: u64,
    /// Bytes of the member as stored in the archive.
    pub compressed: u64,
    /// How it is stored.
    pub compression: Compression,
}
