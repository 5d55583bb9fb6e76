//! What a Parquet file may ask for, checked before the parquet crate (60.1) believes it.
//!
//! A few bytes of run lengths or of a dictionary can stand for any number of values, and a page says
//! itself how large it will be.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

use parquet::basic::Compression;
use parquet::errors::ParquetError;
use parquet::file::metadata::ParquetMetaData;

use super::error::{ParquetTableError, io as failed, layout};
use super::fields::{FOOTER, PAGE_HEADER};
use super::thrift::{self, Fault};
use crate::shield;

/// Values that a file of any size may hold.
pub const MAX_VALUES: u64 = 1 << 23;
/// Values that a file may hold for each of its bytes, beyond that.
pub const MAX_VALUES_A_BYTE: u64 = 64;
/// Bytes of text that a file of any size may hold (64 MiB), and for each of its bytes beyond that.
pub const MAX_TEXT: u64 = 64 << 20;
/// Bytes of a page (256 MiB).
pub const MAX_PAGE: u64 = 256 << 20;
/// Bytes that Snappy makes of one at most, generously.
const EXPANSION: u64 = 32;
/// Bytes that Zstandard makes of one: a block of 128 KiB may take 4.
const ZSTD_EXPANSION: u64 = 1 << 15;

/// Bytes read at once to find the end of a page's header.
const HEADER: u64 = 1 << 12;

/// Checks the metadata at the end of a file: that they end where they say. Returns where they begin, and
/// their bytes.
pub(super) fn check_footer(path: &Path, file: &File) -> Result<(u64, Vec<u8>), ParquetTableError> {
    let io = |e| failed(path, e);
    let length = file.metadata().map_err(io)?.len();
    let mut tail = [0; 8];
    if length < 12 {
        return Err(layout(path, "a Parquet file", format!("{length} bytes")));
    }
    read_at(file, length - 8, &mut tail).map_err(io)?;
    let size = u64::from(u32::from_le_bytes([tail[0], tail[1], tail[2], tail[3]]));
    if &tail[4..] != b"PAR1" || size > length - 12 {
        return Err(layout(path, "metadata of a Parquet file at its end", "other bytes"));
    }
    let mut metadata = vec![0; size as usize];
    let start = length - 8 - size;
    read_at(file, start, &mut metadata).map_err(io)?;
    match thrift::structure(&metadata, FOOTER) {
        Ok(_) => Ok((start, metadata)),
        Err(_) => {
            Err(layout(path, "metadata of a Parquet file", "bytes that contradict themselves"))
        }
    }
}

/// Values that the file of `length` bytes may hold.
pub(super) fn most_values(length: u64) -> u64 {
    MAX_VALUES.max(length.saturating_mul(MAX_VALUES_A_BYTE))
}

/// Bytes of text that it may hold.
pub(super) fn most_text(length: u64) -> u64 {
    MAX_TEXT.max(length.saturating_mul(MAX_VALUES_A_BYTE))
}

/// Checks the number of values, and every page's word about its size. Returns the number of rows.
pub(super) fn check_pages(
    path: &Path,
    file: &File,
    metadata: &ParquetMetaData,
) -> Result<usize, ParquetTableError> {
    let length = file.metadata().map_err(|e| failed(path, e))?.len();
    let columns = metadata.file_metadata().schema_descr().num_columns() as u64;
    let mut rows = 0u64;
    for group in metadata.row_groups() {
        let count = u64::try_from(group.num_rows())
            .map_err(|_| layout(path, "a number of rows", group.num_rows()))?;
        rows = rows.saturating_add(count);
        for chunk in group.columns() {
            let bytes = [chunk.dictionary_page_offset(), Some(chunk.data_page_offset())];
            let start = bytes.into_iter().flatten().filter(|at| *at > 0).min().unwrap_or(-1);
            let (Ok(start), Ok(size)) =
                (u64::try_from(start), u64::try_from(chunk.compressed_size()))
            else {
                return Err(layout(path, "columns inside of the file", "a negative place"));
            };
            match start.checked_add(size) {
                Some(end) if end <= length => {
                    let expansion = match chunk.compression() {
                        Compression::ZSTD(_) => ZSTD_EXPANSION,
                        Compression::UNCOMPRESSED | Compression::SNAPPY => EXPANSION,
                        other => {
                            let read = "columns without compression or with snappy or zstd (write \
                                        the file again with one of these)";
                            let found = format!("a column with {}", codec(other));
                            return Err(layout(path, read, found));
                        }
                    };
                    walk_pages(path, file, (start, end), expansion)?;
                }
                _ => return Err(layout(path, "columns inside of the file", "one beyond its end")),
            }
        }
    }
    let (values, most) = (rows.saturating_mul(columns.max(1)), most_values(length));
    if values > most {
        return Err(layout(path, format!("at most {most} values in {length} bytes"), values));
    }
    usize::try_from(rows).map_err(|_| layout(path, "fewer rows", rows))
}

/// What pyarrow and polars call a codec.
fn codec(compression: Compression) -> String {
    if matches!(compression, Compression::LZ4_RAW) {
        return "lz4".into();
    }
    let name = compression.to_string().to_lowercase();
    name.split('(').next().unwrap_or_default().to_owned()
}

/// Goes from page header to page header of one column.
fn walk_pages(
    path: &Path,
    file: &File,
    (start, end): (u64, u64),
    expansion: u64,
) -> Result<(), ParquetTableError> {
    let damaged = || layout(path, "sound Parquet pages", "a header that contradicts itself");
    let mut at = start;
    let mut buffer = Vec::new();
    while at < end {
        let mut size = HEADER.min(end - at);
        let walked = loop {
            buffer.resize(size as usize, 0);
            read_at(file, at, &mut buffer).map_err(|e| failed(path, e))?;
            match thrift::structure(&buffer, PAGE_HEADER) {
                Ok(walked) => break walked,
                Err(Fault::Short) if size < end - at => size = (8 * size).min(end - at),
                Err(_) => return Err(damaged()),
            }
        };
        let number = |field| walked.numbers.iter().find(|(f, _)| *f == field).map(|(_, n)| *n);
        let (Some(Ok(full)), Some(Ok(stored))) =
            (number(2).map(u64::try_from), number(3).map(u64::try_from))
        else {
            return Err(damaged());
        };
        let most = MAX_PAGE.min(stored.saturating_mul(expansion) + HEADER);
        if full > most {
            let found = format!("{full} from {stored}");
            return Err(layout(path, format!("a page of at most {most} bytes"), found));
        }
        at = at.saturating_add(walked.length as u64).saturating_add(stored);
    }
    if at > end { Err(damaged()) } else { Ok(()) }
}

fn read_at(mut file: &File, at: u64, out: &mut [u8]) -> io::Result<()> {
    file.seek(SeekFrom::Start(at))?;
    file.read_exact(out)
}

/// Takes the memory of a string from what is left.
pub(super) fn spend<'a>(left: &mut u64, text: &'a str) -> Result<&'a str, ParquetError> {
    let bytes = (size_of::<String>() + text.len()) as u64;
    *left = left.checked_sub(bytes).ok_or_else(|| {
        ParquetError::General("more text than a file of this size may hold".into())
    })?;
    Ok(text)
}

/// Pages may hold more than the metadata say.
pub(super) fn require_rows(found: usize, rows: usize) -> Result<(), ParquetError> {
    match found > rows {
        true => Err(ParquetError::General(format!("a column has more than the {rows} rows"))),
        false => Ok(()),
    }
}

/// The decoders of the parquet crate (60.1) assert what damaged pages do not keep, so their panics
/// end here as errors, and are not printed.
pub(super) fn shielded<T>(
    path: &Path,
    read: impl FnOnce() -> Result<T, ParquetTableError>,
) -> Result<T, ParquetTableError> {
    let read = shield::shielded(read);
    read.unwrap_or_else(|_| Err(layout(path, "sound Parquet pages", "damaged ones")))
}
