//! Writes `.npz` archives entry by entry.
//!
//! Bytes depend only on the entries: time stamps are fixed at 1980-01-01, data of stored entries
//! starts at multiples of 64 bytes (by an alignment extra field in the local header, so that each
//! member is byte for byte what `numpy.save` writes), zip64 records appear exactly where sizes,
//! offsets or counts need them.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::disk::DiskSync;
use super::encoder::{Checked, Encoder};
use super::entry::{Compression, EntryRecord};
use super::error::NpzError;
use super::headers::{self, Zip64};
use super::packed::Packed;
use crate::growth::make_room;
use crate::npy::{DType, Header};

/// Bytes copied at a time.
const CHUNK: usize = 1 << 20;

/// Appends entries to an archive; [`NpzWriter::finish`] makes it complete.
#[derive(Debug)]
pub struct NpzWriter {
    file: File,
    path: PathBuf,
    compression: Compression,
    entries: Vec<EntryRecord>,
    end: u64,
    zip64: Zip64,
    disk: DiskSync,
}

impl NpzWriter {
    /// Starts an archive, replacing any file at `path`.
    ///
    /// # Errors
    /// [`NpzError::Io`] when the file cannot be created.
    pub fn create(path: &Path, compression: Compression) -> Result<Self, NpzError> {
        let file = File::create(path).map_err(|e| NpzError::io(path, e))?;
        Ok(Self::over(file, path, compression, Vec::new()))
    }

    /// Continues a partial archive, open as `file`, after `entries`, cutting off whatever follows
    /// them; errors call it `path`.
    ///
    /// Give entries that [`super::intact_entries`] found intact.
    ///
    /// # Errors
    /// [`NpzError::Io`]; [`NpzError::Member`] when the entries do not follow each other without a
    /// gap from byte 0 or the file ends before the last of them.
    pub fn resume(
        file: File,
        path: &Path,
        compression: Compression,
        entries: Vec<EntryRecord>,
    ) -> Result<Self, NpzError> {
        let length = file.metadata().map_err(|e| NpzError::io(path, e))?.len();
        let mut end = 0;
        for entry in &entries {
            if entry.offset != end || entry.end > length || entry.end <= entry.offset {
                let expected = format!("an entry from byte {end} to at most byte {length}");
                let actual = format!("bytes {} to {}", entry.offset, entry.end);
                return Err(NpzError::member(path, &entry.name, expected, actual));
            }
            end = entry.end;
        }
        let mut writer = Self::over(file, path, compression, entries);
        writer.cut().map_err(|e| NpzError::io(path, e))?;
        Ok(writer)
    }

    /// Continues an archive after `entries` in an open file; errors call it `path`.
    pub fn over(
        file: File,
        path: &Path,
        compression: Compression,
        entries: Vec<EntryRecord>,
    ) -> Self {
        let end = entries.last().map_or(0, |entry| entry.end);
        Self {
            file,
            path: path.into(),
            compression,
            entries,
            end,
            zip64: Zip64::default(),
            disk: DiskSync::default(),
        }
    }

    /// Lowers the sizes from which zip64 is used, so that small archives exercise it.
    #[cfg(test)]
    pub(super) fn with_zip64(mut self, zip64: Zip64) -> Self {
        self.zip64 = zip64;
        self
    }

    /// Appends an array whose elements are at hand. `name` is given without `.npy`.
    ///
    /// # Errors
    /// [`NpzError::Member`] when `data` is not as long as the header says or the name is too long;
    /// [`NpzError::Io`].
    pub fn array(
        &mut self,
        name: &str,
        header: &Header,
        data: &[u8],
    ) -> Result<EntryRecord, NpzError> {
        if self.compression == Compression::Deflated {
            return self.array_with(name, header, |out| out.write_all(data));
        }
        let mut entry = self.begin(name, header)?;
        self.check_length(name, header, data.len() as u64)?;
        let front = header.encode();
        let mut crc = crc32fast::Hasher::new();
        crc.update(&front);
        crc.update(data);
        entry.crc32 = crc.finalize();
        entry.stored_crc32 = entry.crc32;
        let mut block = headers::local_header(&entry, self.zip64);
        block.extend_from_slice(&front);
        entry.end = entry.offset + block.len() as u64 + data.len() as u64;
        self.write_at_end(&[&block, data])?;
        Ok(self.push(entry))
    }

    /// Appends an array that was deflated elsewhere, whatever the compression of the writer.
    ///
    /// # Errors
    /// As [`NpzWriter::array`].
    pub fn packed(&mut self, name: &str, packed: &Packed) -> Result<EntryRecord, NpzError> {
        let totals = packed.totals;
        let front = packed.header.encode().len() as u64;
        self.check_length(name, &packed.header, totals.size - front)?;
        let mut entry = self.begin(name, &packed.header)?;
        entry.compression = Compression::Deflated;
        entry.crc32 = totals.crc32;
        entry.stored_crc32 = totals.stored_crc32;
        entry.compressed = totals.compressed;
        let local = headers::local_header(&entry, self.zip64);
        entry.end = entry.offset + local.len() as u64 + totals.compressed;
        self.write_at_end(&[&local, &packed.bytes])?;
        Ok(self.push(entry))
    }

    /// Appends an array whose elements `produce` writes, in pieces of any size.
    ///
    /// # Errors
    /// As [`NpzWriter::array`]; what `produce` returns comes back as [`NpzError::Io`].
    pub fn array_with(
        &mut self,
        name: &str,
        header: &Header,
        produce: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<EntryRecord, NpzError> {
        let written = self.stream(name, header, produce);
        if written.is_err() {
            // What is there of this entry must not stand between it and its next try.
            self.cut().map_err(|e| NpzError::io(&self.path, e))?;
        }
        Ok(self.push(written?))
    }

    fn stream(
        &mut self,
        name: &str,
        header: &Header,
        produce: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<EntryRecord, NpzError> {
        let mut entry = self.begin(name, header)?;
        let placeholder = headers::local_header(&entry, self.zip64);
        let front = header.encode();
        let mut sink = Encoder::new(&self.file, self.compression);
        let totals = (&self.file)
            .write_all(&placeholder)
            .and_then(|()| sink.write_all(&front))
            .and_then(|()| produce(&mut sink))
            .and_then(|()| sink.finish())
            .map_err(|e| NpzError::io(&self.path, e))?;
        self.check_length(name, header, totals.size - front.len() as u64)?;
        entry.crc32 = totals.crc32;
        entry.stored_crc32 = totals.stored_crc32;
        entry.compressed = totals.compressed;
        entry.end = entry.offset + placeholder.len() as u64 + totals.compressed;
        let local = headers::local_header(&entry, self.zip64);
        self.patch(&entry, &local).map_err(|e| NpzError::io(&self.path, e))?;
        Ok(entry)
    }

    /// Appends 32-bit floats.
    ///
    /// # Errors
    /// As [`NpzWriter::array`].
    pub fn floats(
        &mut self,
        name: &str,
        shape: &[usize],
        data: &[f32],
    ) -> Result<EntryRecord, NpzError> {
        self.array(name, &Header::new(DType::F32, shape), bytemuck::cast_slice(data))
    }

    /// Appends text as bytes (`uint8`, UTF-8), which numpy reads without pickle.
    ///
    /// # Errors
    /// As [`NpzWriter::array`].
    pub fn text(&mut self, name: &str, text: &str) -> Result<EntryRecord, NpzError> {
        self.array(name, &Header::new(DType::U8, &[text.len()]), text.as_bytes())
    }

    /// Appends a list of strings as numpy's fixed-width text.
    ///
    /// # Errors
    /// As [`NpzWriter::array`].
    pub fn strings<S: AsRef<str>>(
        &mut self,
        name: &str,
        strings: &[S],
    ) -> Result<EntryRecord, NpzError> {
        let width = strings.iter().map(|s| s.as_ref().chars().count()).max().unwrap_or(0).max(1);
        let header = Header::new(DType::text(width), &[strings.len()]);
        self.array_with(name, &header, |out| {
            let mut out = io::BufWriter::with_capacity(CHUNK, out);
            for text in strings {
                let padding = std::iter::repeat('\0');
                for character in text.as_ref().chars().chain(padding).take(width) {
                    out.write_all(&u32::from(character).to_le_bytes())?;
                }
            }
            out.flush()
        })
    }

    /// Entries so far, in order.
    pub fn entries(&self) -> &[EntryRecord] {
        &self.entries
    }

    /// Writes the central directory and waits until everything is on the disk.
    ///
    /// # Errors
    /// [`NpzError::Io`].
    pub fn finish(mut self) -> Result<(), NpzError> {
        let mut out = io::BufWriter::with_capacity(CHUNK, &self.file);
        let written = headers::write_directory(&mut out, &self.entries, self.end, self.zip64);
        if let Err(source) = written.and_then(|()| out.into_inner().map(drop).map_err(Into::into)) {
            // The first error is the one to report; the next entry overwrites what is there.
            let _ = self.cut();
            return Err(NpzError::io(&self.path, source));
        }
        let settled = self.disk.settle();
        settled.and(self.file.sync_all()).map_err(|e| NpzError::io(&self.path, e))
    }

    /// A record of the coming entry with the sizes that are known, the CRC still zero.
    fn begin(&self, name: &str, header: &Header) -> Result<EntryRecord, NpzError> {
        let full = format!("{name}.npy");
        if full.len() > usize::from(u16::MAX) {
            let expected = "a name of at most 65,531 bytes";
            return Err(NpzError::member(&self.path, name, expected, full.len()));
        }
        let data = header.data_len().map_err(|e| NpzError::npy(&self.path, name, e))?;
        let size = data + header.encode().len() as u64;
        let compressed = match self.compression {
            Compression::Stored => size,
            Compression::Deflated => 0,
        };
        Ok(EntryRecord {
            name: full,
            offset: self.end,
            end: self.end,
            crc32: 0,
            stored_crc32: 0,
            size,
            compressed,
            compression: self.compression,
        })
    }

    fn check_length(&self, name: &str, header: &Header, actual: u64) -> Result<(), NpzError> {
        let expected = header.data_len().map_err(|e| NpzError::npy(&self.path, name, e))?;
        if actual == expected {
            return Ok(());
        }
        let expected = format!("{expected} bytes of data for shape {:?}", header.shape);
        Err(NpzError::member(&self.path, name, expected, actual))
    }

    /// Appends a complete entry of another archive, `from`, without decoding it.
    ///
    /// # Errors
    /// [`NpzError::Member`] of `from` when `raw` is not what the entry says, [`NpzError::Io`] of the
    /// archive that fails.
    pub fn copy(
        &mut self,
        entry: &EntryRecord,
        mut raw: impl Read,
        from: &Path,
    ) -> Result<EntryRecord, NpzError> {
        let mut entry = EntryRecord { offset: self.end, ..entry.clone() };
        let local = headers::local_header(&entry, self.zip64);
        self.write_at_end(&[&local])?;
        let mut out = Checked::new(&self.file);
        let size = usize::try_from(entry.compressed).unwrap_or(CHUNK).clamp(1, CHUNK);
        let (mut piece, mut copied) = (vec![0; size], 0);
        loop {
            match raw.read(&mut piece) {
                Ok(0) => break,
                Ok(n) => {
                    out.write_all(&piece[..n]).map_err(|e| NpzError::io(&self.path, e))?;
                    copied += n as u64;
                }
                Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
                Err(e) => return Err(NpzError::io(from, e)),
            }
        }
        entry.stored_crc32 = out.crc32();
        let damaged = |expected, actual| NpzError::member(from, &entry.name, expected, actual);
        if copied != entry.compressed {
            return Err(damaged(format!("{} bytes", entry.compressed), copied.to_string()));
        }
        if entry.compression == Compression::Stored && entry.stored_crc32 != entry.crc32 {
            let hex = |crc| format!("CRC {crc:08x}");
            return Err(damaged(hex(entry.crc32), hex(entry.stored_crc32)));
        }
        entry.end = entry.offset + local.len() as u64 + copied;
        Ok(self.push(entry))
    }

    fn push(&mut self, entry: EntryRecord) -> EntryRecord {
        self.end = entry.end;
        self.disk.written(&self.file, entry.end - entry.offset);
        make_room(&mut self.entries, 1);
        self.entries.push(entry.clone());
        entry
    }

    fn write_at_end(&mut self, pieces: &[&[u8]]) -> Result<(), NpzError> {
        let written = pieces.iter().try_for_each(|piece| self.file.write_all(piece));
        written.map_err(|source| {
            // The first error is the one to report; the next entry overwrites what is there.
            let _ = self.cut();
            NpzError::io(&self.path, source)
        })
    }

    fn patch(&mut self, entry: &EntryRecord, local: &[u8]) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(entry.offset))?;
        self.file.write_all(local)?;
        self.file.seek(SeekFrom::Start(entry.end))?;
        Ok(())
    }

    /// Drops everything after the last complete entry.
    fn cut(&mut self) -> io::Result<()> {
        self.file.set_len(self.end)?;
        self.file.seek(SeekFrom::Start(self.end))?;
        Ok(())
    }
}
