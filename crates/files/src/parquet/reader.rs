//! Reads tables, ours and those of other tools.

use std::fs::File;
use std::path::{Path, PathBuf};

use parquet::basic::Type as Physical;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::error::{ParquetTableError, io, layer, layout};
use super::frames::Cursors;
use super::keys::{CONFIG, META, OUTCOMES, ROWS, WRITER};
use super::limits::{self, require_rows, shielded, spend};
use super::numeric::{self, NumericTable};
use super::seal::SealedFile;
use crate::layout::parse_outcomes;
use crate::provenance::{LAYOUT_VERSION, Provenance};
use crate::table::{ID, Table};

/// An open Parquet file.
pub struct ParquetFile {
    path: PathBuf,
    file: File,
    length: u64,
    pub(super) reader: SerializedFileReader<SealedFile>,
    sealed: SealedFile,
    /// Where reading of frames has come to.
    pub(super) cursors: Cursors,
}

impl std::fmt::Debug for ParquetFile {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ParquetFile").field("path", &self.path).finish_non_exhaustive()
    }
}

impl ParquetFile {
    /// Opens a file and reads its metadata. Columns are read within [`super::MAX_VALUES`],
    /// [`super::MAX_TEXT`] and [`super::MAX_PAGE`].
    ///
    /// # Errors
    /// [`ParquetTableError`].
    pub fn open(path: &Path) -> Result<Self, ParquetTableError> {
        shielded(path, || {
            let file = File::open(path).map_err(|e| io(path, e))?;
            let length = file.metadata().map_err(|e| io(path, e))?.len();
            let (start, footer) = limits::check_footer(path, &file)?;
            let sealed = file.try_clone().and_then(SealedFile::new).map_err(|e| io(path, e))?;
            let reader = SerializedFileReader::new(sealed.clone()).map_err(|e| layer(path, e))?;
            let metadata = reader.metadata().file_metadata();
            sealed.check((start, &footer), metadata).map_err(|e| layer(path, e))?;
            let cursors = Cursors::default();
            Ok(Self { path: path.into(), file, length, reader, sealed, cursors })
        })
    }

    /// The file that was opened.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether this tool wrote it. One that another tool wrote over, keeping our metadata, is not.
    pub fn is_ours(&self) -> bool {
        let writer = self.reader.metadata().file_metadata().created_by();
        writer.is_some_and(|name| name.starts_with(WRITER)) && self.find(META).is_some()
    }

    /// Checks the whole file against the hashes in it, for those who read it by other means. Files of
    /// other tools have none.
    ///
    /// # Errors
    /// [`ParquetTableError::Damaged`].
    pub fn check(&self) -> Result<(), ParquetTableError> {
        shielded(&self.path, || self.sealed.check_all().map_err(|e| layer(&self.path, e)))
    }

    /// How an output of ours was made.
    ///
    /// # Errors
    /// [`ParquetTableError`]; files of other tools are refused.
    pub fn provenance(&self) -> Result<Provenance, ParquetTableError> {
        let path = self.path.as_path();
        let mut provenance: Provenance = serde_json::from_str(self.metadata(META)?)
            .map_err(|e| layout(path, "provenance as JSON", e))?;
        if provenance.layout_version > LAYOUT_VERSION {
            let expected = format!("layout version {LAYOUT_VERSION} or lower");
            return Err(layout(path, expected, provenance.layout_version));
        }
        provenance.config = self.metadata(CONFIG)?.to_string();
        Ok(provenance)
    }

    /// Reads back what [`super::write()`] wrote.
    ///
    /// # Errors
    /// [`ParquetTableError`]; files of other tools are refused.
    pub fn table(&self) -> Result<(Table, Provenance), ParquetTableError> {
        shielded(&self.path, || self.read_table())
    }

    /// The columns of any table that are not nested: floats, integers, booleans and texts.
    ///
    /// # Errors
    /// [`ParquetTableError`].
    pub fn numbers(&self) -> Result<NumericTable, ParquetTableError> {
        shielded(&self.path, || {
            let rows = limits::check_pages(&self.path, &self.file, self.reader.metadata())?;
            numeric::read(&self.path, &self.reader, rows, limits::most_text(self.length))
        })
    }

    fn read_table(&self) -> Result<(Table, Provenance), ParquetTableError> {
        let (path, reader) = (self.path.as_path(), &self.reader);
        let provenance = self.provenance()?;
        let rows = limits::check_pages(path, &self.file, reader.metadata())?;
        let mut text = limits::most_text(self.length);
        let outcomes = parse_outcomes(self.metadata(OUTCOMES)?)
            .map_err(|e| layout(path, "outcomes as JSON lines", e))?;
        let schema = reader.metadata().file_metadata().schema_descr_ptr();
        let (mut ids, mut labels, mut names, mut columns) =
            (None, Vec::new(), Vec::new(), Vec::new());
        for (index, column) in schema.columns().iter().enumerate() {
            let name = column.name().to_string();
            let parts = (0..reader.num_row_groups())
                .map(|group| reader.get_row_group(group)?.get_column_reader(index));
            match column.physical_type() {
                // Frames, which are read one recording at a time.
                _ if column.max_rep_level() > 0 => {}
                _ if column.max_def_level() > 0 => {
                    return Err(layout(path, "required columns", format!("{name:?} is optional")));
                }
                Physical::BYTE_ARRAY => {
                    let values = texts(parts, rows, &mut text).map_err(|e| layer(path, e))?;
                    if name == ID { ids = Some(values) } else { labels.push((name, values)) }
                }
                Physical::FLOAT => {
                    names.push(name);
                    columns.push(floats(parts, rows).map_err(|e| layer(path, e))?);
                }
                other => {
                    return Err(layout(
                        path,
                        "text and float columns",
                        format!("{name:?}: {other}"),
                    ));
                }
            }
        }
        let ids = ids.ok_or_else(|| layout(path, "a column id", "none"))?;
        if let Some(column) = columns.iter().find(|column| column.len() != ids.len()) {
            return Err(layout(path, format!("{} rows in each column", ids.len()), column.len()));
        }
        let rows = 0..ids.len();
        let values = rows.flat_map(|row| columns.iter().map(move |column| column[row])).collect();
        let table = Table::from_parts(ids, names, values, labels, outcomes)
            .map_err(|source| ParquetTableError::Table { path: path.into(), source })?;
        Ok((table, provenance))
    }

    /// Checks what the pages say about themselves, before frames are read.
    pub(super) fn check_pages(&self) -> Result<usize, ParquetTableError> {
        limits::check_pages(&self.path, &self.file, self.reader.metadata())
    }

    fn find(&self, key: &str) -> Option<&str> {
        let pairs = self.reader.metadata().file_metadata().key_value_metadata()?;
        pairs.iter().find(|pair| pair.key == key)?.value.as_deref()
    }

    fn metadata(&self, key: &str) -> Result<&str, ParquetTableError> {
        let missing =
            || layout(&self.path, format!("metadata {key}"), "none: not written by this tool");
        self.find(key).ok_or_else(missing)
    }
}

/// Texts of at most `rows` rows, and of `left` bytes of memory.
fn texts(
    parts: impl Iterator<Item = Result<ColumnReader, ParquetError>>,
    rows: usize,
    left: &mut u64,
) -> Result<Vec<String>, ParquetError> {
    let mut texts = Vec::new();
    for part in parts {
        let ColumnReader::ByteArrayColumnReader(reader) = part? else {
            return Err(ParquetError::General("a text column holds another type".into()));
        };
        batches(reader, rows, |values| {
            for value in values {
                texts.push(spend(left, value.as_utf8()?)?.to_string());
            }
            Ok(texts.len())
        })?;
    }
    Ok(texts)
}

fn floats(
    parts: impl Iterator<Item = Result<ColumnReader, ParquetError>>,
    rows: usize,
) -> Result<Vec<f32>, ParquetError> {
    let mut floats = Vec::new();
    for part in parts {
        let ColumnReader::FloatColumnReader(reader) = part? else {
            return Err(ParquetError::General("a float column holds another type".into()));
        };
        batches(reader, rows, |values| {
            floats.extend(values);
            Ok(floats.len())
        })?;
    }
    Ok(floats)
}

/// Hands a column on in batches; `take` says how many values there are by then.
fn batches<T: DataType>(
    mut reader: ColumnReaderImpl<T>,
    rows: usize,
    mut take: impl FnMut(Vec<T::T>) -> Result<usize, ParquetError>,
) -> Result<(), ParquetError> {
    loop {
        let mut values = Vec::new();
        if reader.read_records(ROWS, None, None, &mut values)?.0 == 0 {
            return Ok(());
        }
        require_rows(take(values)?, rows)?;
    }
}
