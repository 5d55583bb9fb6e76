//! Reads `.npz` archives: ours, numpy's and any other.
//!
//! Archives are not trusted. Members must not share bytes. Nothing is allocated on the word of a
//! header alone: the shape must agree with the member's size, a stored member cannot be larger than
//! the file, and what is made of a deflated one takes at most [`MAX_INFLATED`] bytes or
//! [`MAX_RATIO`] times its compressed size. Members are decoded in pieces.

use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Path, PathBuf};

use ndarray::ArrayD;
use serde::de::DeserializeOwned;
use zip::read::ZipFile;
use zip::{CompressionMethod, ZipArchive};

use super::entry::{Compression, EntryRecord};
use super::error::NpzError;
use super::limits::{MAX_INFLATED, MAX_RATIO, MAX_STRINGS};
use crate::npy::{self, DType, Endian, Header, Kind, NpyError, Order};
use crate::quote::quoted;

const EXTENSION: &str = ".npy";

/// An open archive.
#[derive(Debug)]
pub struct NpzFile {
    path: PathBuf,
    archive: ZipArchive<BufReader<File>>,
    length: u64,
    names: Vec<String>,
    /// Bytes that strings have taken so far.
    text: u64,
}

impl NpzFile {
    /// Opens an archive and reads its directory.
    ///
    /// # Errors
    /// [`NpzError::Io`]; [`NpzError::Archive`] for anything but a zip archive of uniquely named
    /// members.
    pub fn open(path: &Path) -> Result<Self, NpzError> {
        let file = File::open(path).map_err(|e| NpzError::io(path, e))?;
        let length = file.metadata().map_err(|e| NpzError::io(path, e))?.len();
        let refused = |reason: String| NpzError::Archive { path: path.into(), reason };
        let archive = ZipArchive::new(BufReader::new(file)).map_err(|e| refused(e.to_string()))?;
        if archive.has_duplicate_names() {
            return Err(refused("two members have the same name".into()));
        }
        if let Some((a, b)) = overlap(&archive).map_err(|e| refused(e.to_string()))? {
            return Err(refused(format!(
                "the members {} and {} share bytes",
                quoted(&a),
                quoted(&b)
            )));
        }
        let names = archive
            .file_names()
            .map(|name| name.map(|name| name.into_owned()))
            .collect::<Result<Vec<_>, _>>()
            .map_err(|e| refused(e.to_string()))?;
        let names = names
            .into_iter()
            .filter_map(|name| name.strip_suffix(EXTENSION).map(str::to_owned))
            .collect();
        Ok(Self { path: path.into(), archive, length, names, text: 0 })
    }

    /// The file that was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Names of the `.npy` members in archive order, without that extension.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Whether there is a member of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.index(name).is_some()
    }

    /// Type, order and shape of a member, without reading its data.
    ///
    /// # Errors
    /// [`NpzError`] names the member and what is wrong with it.
    pub fn header(&mut self, name: &str) -> Result<Header, NpzError> {
        self.read(name, 0, |_, header, _| Ok(header.clone()))
    }

    /// A numeric member as 32-bit floats; wider numbers are rounded.
    ///
    /// # Errors
    /// [`NpzError`] names the member and what is wrong with it; complex numbers and text are
    /// refused.
    pub fn f32(&mut self, name: &str) -> Result<ArrayD<f32>, NpzError> {
        self.read(name, 4, |body, header, wrong| npy::array(body, header).map_err(|e| wrong.npy(e)))
    }

    /// A numeric member as 64-bit floats.
    ///
    /// # Errors
    /// As [`NpzFile::f32`].
    pub fn f64(&mut self, name: &str) -> Result<ArrayD<f64>, NpzError> {
        self.read(name, 8, |body, header, wrong| npy::array(body, header).map_err(|e| wrong.npy(e)))
    }

    /// A member of whole numbers or truth values, exactly.
    ///
    /// # Errors
    /// As [`NpzFile::f32`]; floats are refused, too.
    pub fn integers(&mut self, name: &str) -> Result<ArrayD<i128>, NpzError> {
        self.read(name, 16, |body, header, wrong| {
            npy::array(body, header).map_err(|e| wrong.npy(e))
        })
    }

    /// A numeric member as 64-bit floats, complex numbers as an additional first axis of real and
    /// imaginary parts.
    ///
    /// # Errors
    /// [`NpzError`] names the member and what is wrong with it; text is refused.
    pub fn components(&mut self, name: &str) -> Result<ArrayD<f64>, NpzError> {
        self.read(name, 16, |body, header, wrong| {
            npy::components(body, header).map_err(|e| wrong.npy(e))
        })
    }

    /// A one-dimensional text member (`U`, or `S` in UTF-8); padding is removed.
    ///
    /// # Errors
    /// [`NpzError`] names the member and what is wrong with it.
    pub fn strings(&mut self, name: &str) -> Result<Vec<String>, NpzError> {
        let header = self.header(name)?;
        if !matches!((header.dtype.kind, &header.shape[..]), (Kind::Text | Kind::Bytes, [_])) {
            return self.read(name, 0, |_, header, wrong| {
                Err(wrong.kind("a list of strings (U or S)", header))
            });
        }
        self.texts(name)
    }

    /// A text member of any shape, as [`strings`](Self::strings); the last axis runs fastest.
    ///
    /// # Errors
    /// [`NpzError`] names the member and what is wrong with it; arrays in Fortran's order are refused.
    pub fn texts(&mut self, name: &str) -> Result<Vec<String>, NpzError> {
        let most =
            MAX_INFLATED.max(self.length.saturating_mul(MAX_RATIO)).saturating_sub(self.text);
        let strings = self.read(name, size_of::<String>(), |body, header, wrong| {
            let in_order = header.order == Order::C || header.shape.len() < 2;
            let (Kind::Text | Kind::Bytes, true) = (header.dtype.kind, in_order) else {
                return Err(wrong.kind("strings (U or S) in C order", header));
            };
            let count = header.elements().map_err(|e| wrong.npy(e))?;
            let width = header.dtype.itemsize;
            // Only with bytes after them are width and count more than a header's word.
            match (count, width) {
                (0, _) => return Ok(Vec::new()),
                (_, 0) => return Err(wrong.kind("text of at least one character", header)),
                _ => {}
            }
            if count > MAX_STRINGS.min(most / size_of::<String>() as u64) {
                let limit = MAX_STRINGS.min(most / size_of::<String>() as u64);
                return Err(wrong.expected(format!("at most {limit} strings"), count));
            }
            let mut item = vec![0u8; width];
            let mut strings = Vec::new();
            for _ in 0..count {
                body.read_exact(&mut item).map_err(|e| wrong.npy(e.into()))?;
                let units = item.as_chunks::<4>().0.iter();
                let text: Option<String> = match header.dtype.kind {
                    Kind::Bytes => std::str::from_utf8(&item).ok().map(String::from),
                    _ => units
                        .map(|&unit| char::from_u32(u32::of(unit, header.dtype.big_endian)))
                        .collect(),
                };
                let text =
                    text.ok_or_else(|| wrong.expected("Unicode or UTF-8", "other code points"))?;
                strings.push(text.trim_end_matches('\0').to_string());
            }
            Ok(strings)
        })?;
        let taken: usize = strings.iter().map(|s| size_of::<String>() + s.len()).sum();
        self.text += taken as u64;
        if taken as u64 > most {
            let expected = format!("at most {most} more bytes of text");
            return Err(NpzError::member(&self.path, name, expected, taken));
        }
        Ok(strings)
    }

    /// A member of bytes (`u1`), as [`super::NpzWriter::text`] writes them, as text.
    ///
    /// # Errors
    /// [`NpzError`] names the member and what is wrong with it.
    pub fn text(&mut self, name: &str) -> Result<String, NpzError> {
        self.read(name, 1, |body, header, wrong| {
            if header.dtype != DType::U8 {
                return Err(wrong.kind("bytes (u1)", header));
            }
            let mut text = String::new();
            body.read_to_string(&mut text).map_err(|e| wrong.npy(e.into()))?;
            Ok(text)
        })
    }

    /// A member of bytes that hold JSON.
    ///
    /// # Errors
    /// [`NpzError`] names the member and what is wrong with it.
    pub fn json<T: DeserializeOwned>(&mut self, name: &str) -> Result<T, NpzError> {
        let text = self.text(name)?;
        serde_json::from_str(&text).map_err(|e| NpzError::member(&self.path, name, "JSON", e))
    }

    /// The undecoded bytes of a member and what a writer needs to know to append them elsewhere
    /// (where the record has no place yet, and no check sum of the stored bytes).
    ///
    /// # Errors
    /// [`NpzError`]: no such member, or one that is neither stored nor deflated.
    pub fn raw(&mut self, name: &str) -> Result<(EntryRecord, impl Read), NpzError> {
        let index = self.index(name).ok_or_else(|| missing(&self.path, name))?;
        let path = &self.path;
        let member = self.archive.by_index_raw(index).map_err(|e| archive_error(path, e))?;
        let compression = match member.compression() {
            CompressionMethod::Stored => Compression::Stored,
            CompressionMethod::Deflated => Compression::Deflated,
            other => return Err(NpzError::member(path, name, "stored or deflated", other)),
        };
        let record = EntryRecord {
            name: format!("{name}{EXTENSION}"),
            offset: 0,
            end: 0,
            crc32: member.crc32(),
            stored_crc32: 0,
            size: member.size(),
            compressed: member.compressed_size(),
            compression,
        };
        Ok((record, member))
    }

    fn index(&self, name: &str) -> Option<usize> {
        self.archive.index_for_name(&format!("{name}{EXTENSION}"))
    }

    /// Opens a member, checks its sizes against each other and hands its data to `take`, which makes
    /// `width` bytes of each element and must read none or all of it; in the latter case the CRC is
    /// checked.
    fn read<T>(
        &mut self,
        name: &str,
        width: usize,
        take: impl FnOnce(&mut dyn Read, &Header, &Wrong<'_>) -> Result<T, NpzError>,
    ) -> Result<T, NpzError> {
        let index = self.index(name).ok_or_else(|| missing(&self.path, name))?;
        let wrong = Wrong { path: &self.path, name };
        let mut member = self.archive.by_index(index).map_err(|e| archive_error(wrong.path, e))?;
        check_sizes(&member, self.length, &wrong)?;
        let (header, start) = Header::read(&mut member).map_err(|e| wrong.npy(e))?;
        let data = header.data_len().map_err(|e| wrong.npy(e))?;
        if start.checked_add(data) != Some(member.size()) {
            let expected = format!("{data} bytes of data for shape {:?}", header.shape);
            return Err(wrong.expected(expected, member.size().saturating_sub(start)));
        }
        let made = header.elements().map_err(|e| wrong.npy(e))?.saturating_mul(width as u64);
        if made > most_of(&member) {
            let expected = format!("at most {} bytes in memory", most_of(&member));
            return Err(wrong.expected(expected, made));
        }
        let mut body = (&mut member).take(data);
        let value = take(&mut body, &header, &wrong)?;
        if body.limit() == 0 {
            // Reading to the end makes the zip layer compare the CRC.
            io::copy(&mut member, &mut io::sink()).map_err(|e| wrong.npy(e.into()))?;
        }
        Ok(value)
    }
}

fn check_sizes<R: Read>(
    member: &ZipFile<'_, R>,
    file_length: u64,
    wrong: &Wrong<'_>,
) -> Result<(), NpzError> {
    let (size, compressed) = (member.size(), member.compressed_size());
    if compressed > file_length {
        return Err(wrong.expected(format!("at most {file_length} bytes"), compressed));
    }
    let most = match member.compression() {
        CompressionMethod::Stored => compressed,
        _ => most_of(member),
    };
    if size > most {
        return Err(wrong.expected(format!("at most {most} bytes uncompressed"), size));
    }
    Ok(())
}

/// Bytes that may be made of a member. Stored ones are there to be counted.
fn most_of<R: Read>(member: &ZipFile<'_, R>) -> u64 {
    match member.compression() {
        CompressionMethod::Stored => u64::MAX,
        _ => MAX_INFLATED.max(member.compressed_size().saturating_mul(MAX_RATIO)),
    }
}

/// Two members that share bytes, as far as the directory tells.
fn overlap(
    archive: &ZipArchive<BufReader<File>>,
) -> zip::result::ZipResult<Option<(String, String)>> {
    /// A local header without name and extra fields.
    const LOCAL: u64 = 30;
    let mut spans = Vec::with_capacity(archive.len());
    for index in 0..archive.len() {
        let entry = archive.by_index_data(index)?;
        let end =
            entry.header_start().saturating_add(LOCAL).saturating_add(entry.compressed_size());
        spans.push((entry.header_start(), end, index));
    }
    spans.sort_unstable();
    let Some(pair) = spans.windows(2).find(|pair| pair[0].1 > pair[1].0) else { return Ok(None) };
    let name = |index: usize| -> zip::result::ZipResult<String> {
        Ok(archive.name_for_index(index).transpose()?.unwrap_or_default().into_owned())
    };
    Ok(Some((name(pair[0].2)?, name(pair[1].2)?)))
}

fn missing(path: &Path, name: &str) -> NpzError {
    NpzError::Missing { path: path.into(), member: name.into() }
}

fn archive_error(path: &Path, error: zip::result::ZipError) -> NpzError {
    NpzError::Archive { path: path.into(), reason: error.to_string() }
}

/// Makes errors about one member.
struct Wrong<'a> {
    path: &'a Path,
    name: &'a str,
}

impl Wrong<'_> {
    fn npy(&self, error: NpyError) -> NpzError {
        NpzError::npy(self.path, self.name, error)
    }

    fn kind(&self, expected: &str, header: &Header) -> NpzError {
        self.expected(expected, format!("{} of shape {:?}", header.dtype, header.shape))
    }

    fn expected(
        &self,
        expected: impl std::fmt::Display,
        actual: impl std::fmt::Display,
    ) -> NpzError {
        NpzError::member(self.path, self.name, expected, actual)
    }
}
