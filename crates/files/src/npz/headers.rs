//! The records of the zip format (PKWARE APPNOTE 6.3.10) that an archive of arrays needs.

use std::io::{self, Write};

use super::entry::{Compression, EntryRecord};

const LOCAL: u32 = 0x0403_4b50;
const CENTRAL: u32 = 0x0201_4b50;
const END: u32 = 0x0605_4b50;
const END_64: u32 = 0x0606_4b50;
const LOCATOR_64: u32 = 0x0706_4b50;

const EXTRA_ZIP64: u16 = 0x0001;
/// Alignment extra field, as Android's zipalign writes it.
const EXTRA_ALIGNMENT: u16 = 0xd935;
const ALIGNMENT: u16 = 64;

const VERSION: u16 = 20;
const VERSION_64: u16 = 45;
const MADE_BY_UNIX: u16 = 3 << 8;
const UTF_8: u16 = 1 << 11;
/// 1980-01-01 00:00, the first moment that the format can name.
const TIME: u16 = 0;
const DATE: u16 = 0x0021;
const MODE_644: u32 = 0o100_644 << 16;

/// From which values on zip64 records are used.
#[derive(Debug, Clone, Copy)]
pub(super) struct Zip64 {
    /// Sizes and offsets.
    pub size: u64,
    /// Number of entries.
    pub entries: u64,
}

impl Default for Zip64 {
    fn default() -> Self {
        Self { size: u64::from(u32::MAX), entries: u64::from(u16::MAX) }
    }
}

impl Zip64 {
    /// The 32-bit field for `value`: all ones where the zip64 field speaks instead.
    fn field(self, value: u64) -> u32 {
        u32::try_from(value).ok().filter(|_| value < self.size).unwrap_or(u32::MAX)
    }

    /// Whether the local header of an entry carries 64-bit sizes. It must not depend on the
    /// compressed size, which is not known when the header is laid out.
    fn local(self, size: u64) -> bool {
        size.saturating_add(deflate_margin(size)) >= self.size
    }
}

/// By how much deflate can lengthen incompressible data (zlib's bound is far below).
fn deflate_margin(size: u64) -> u64 {
    size / 512 + 1024
}

/// The local header of an entry, as long for given name, size, offset and compression whatever the
/// CRC and compressed size are, so that it can be written first and completed afterwards.
pub(super) fn local_header(entry: &EntryRecord, zip64: Zip64) -> Vec<u8> {
    let wide = zip64.local(entry.size);
    let mut extra = Vec::new();
    if wide {
        put16(&mut extra, EXTRA_ZIP64);
        put16(&mut extra, 16);
        put64(&mut extra, entry.size);
        put64(&mut extra, entry.compressed);
    }
    if entry.compression == Compression::Stored {
        align(&mut extra, entry.offset + 30 + entry.name.len() as u64);
    }
    let mut out = Vec::with_capacity(30 + entry.name.len() + extra.len());
    put32(&mut out, LOCAL);
    put16(&mut out, if wide { VERSION_64 } else { VERSION });
    common(&mut out, entry);
    // With a zip64 field in the local header both 32-bit sizes must be all ones.
    put32(&mut out, if wide { u32::MAX } else { entry.compressed as u32 });
    put32(&mut out, if wide { u32::MAX } else { entry.size as u32 });
    put16(&mut out, entry.name.len() as u16);
    put16(&mut out, extra.len() as u16);
    out.extend_from_slice(entry.name.as_bytes());
    out.extend_from_slice(&extra);
    out
}

/// Writes everything after the last entry, which ends at byte `start`.
pub(super) fn write_directory(
    to: &mut impl Write,
    entries: &[EntryRecord],
    start: u64,
    zip64: Zip64,
) -> io::Result<()> {
    let (mut out, mut size) = (Vec::new(), 0);
    for entry in entries {
        central_header(&mut out, entry, zip64);
        to.write_all(&out)?;
        size += out.len() as u64;
        out.clear();
    }
    let count = entries.len() as u64;
    let many = count >= zip64.entries;
    if many || size >= zip64.size || start >= zip64.size {
        put32(&mut out, END_64);
        put64(&mut out, 44);
        put16(&mut out, MADE_BY_UNIX | VERSION_64);
        put16(&mut out, VERSION_64);
        put64(&mut out, 0);
        put64(&mut out, count);
        put64(&mut out, count);
        put64(&mut out, size);
        put64(&mut out, start);
        put32(&mut out, LOCATOR_64);
        put32(&mut out, 0);
        put64(&mut out, start + size);
        put32(&mut out, 1);
    }
    let short_count = if many { u16::MAX } else { count as u16 };
    put32(&mut out, END);
    put32(&mut out, 0);
    put16(&mut out, short_count);
    put16(&mut out, short_count);
    put32(&mut out, zip64.field(size));
    put32(&mut out, zip64.field(start));
    put16(&mut out, 0);
    to.write_all(&out)
}

fn central_header(out: &mut Vec<u8>, entry: &EntryRecord, zip64: Zip64) {
    let mut wide = Vec::new();
    for value in [entry.size, entry.compressed, entry.offset] {
        if value >= zip64.size {
            put64(&mut wide, value);
        }
    }
    let version = if wide.is_empty() && !zip64.local(entry.size) { VERSION } else { VERSION_64 };
    put32(out, CENTRAL);
    put16(out, MADE_BY_UNIX | version);
    put16(out, version);
    common(out, entry);
    put32(out, zip64.field(entry.compressed));
    put32(out, zip64.field(entry.size));
    put16(out, entry.name.len() as u16);
    put16(out, if wide.is_empty() { 0 } else { 4 + wide.len() as u16 });
    put16(out, 0);
    put16(out, 0);
    put16(out, 0);
    put32(out, MODE_644);
    put32(out, zip64.field(entry.offset));
    out.extend_from_slice(entry.name.as_bytes());
    if !wide.is_empty() {
        put16(out, EXTRA_ZIP64);
        put16(out, wide.len() as u16);
        out.extend_from_slice(&wide);
    }
}

/// Flags, method, time, date and CRC, which both kinds of header hold in this order.
fn common(out: &mut Vec<u8>, entry: &EntryRecord) {
    put16(out, if entry.name.is_ascii() { 0 } else { UTF_8 });
    put16(out, if entry.compression == Compression::Stored { 0 } else { 8 });
    put16(out, TIME);
    put16(out, DATE);
    put32(out, entry.crc32);
}

/// Lengthens `extra`, which starts at byte `offset`, so that it ends at a multiple of 64.
fn align(extra: &mut Vec<u8>, offset: u64) {
    let alignment = u64::from(ALIGNMENT);
    let mut padding = (alignment - (offset + extra.len() as u64) % alignment) % alignment;
    if padding == 0 {
        return;
    }
    // The field itself takes six bytes.
    if padding < 6 {
        padding += alignment;
    }
    put16(extra, EXTRA_ALIGNMENT);
    put16(extra, padding as u16 - 4);
    put16(extra, ALIGNMENT);
    extra.resize(extra.len() + padding as usize - 6, 0);
}

fn put16(out: &mut Vec<u8>, value: u16) {
    out.extend_from_slice(&value.to_le_bytes());
}

fn put32(out: &mut Vec<u8>, value: u32) {
    out.extend_from_slice(&value.to_le_bytes());
}

fn put64(out: &mut Vec<u8>, value: u64) {
    out.extend_from_slice(&value.to_le_bytes());
}
