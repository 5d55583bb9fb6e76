//! The summary table as a Parquet file: column `id`, the label columns (text), one 32-bit float
//! column per feature. Configuration, provenance and outcomes are in the file's key-value metadata.

use std::fs::File;
use std::io::BufWriter;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, FloatType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, Type, TypePtr};
use thiserror::Error;

use crate::layout::{json_lines, parse_outcomes};
use crate::provenance::{LAYOUT_VERSION, Provenance};
use crate::table::{ID, Table, TableError};

mod columns;

pub use columns::{Columns, columns};

const META: &str = "corsmal.meta";
const CONFIG: &str = "corsmal.config";
const OUTCOMES: &str = "corsmal.outcomes";

/// Rows written together, and read at a time.
const ROWS: usize = 1 << 16;

/// What can go wrong with a Parquet file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ParquetTableError {
    /// The operating system refused.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: std::io::Error,
    },
    /// The Parquet layer refused.
    #[error("{path}: {source}")]
    Parquet {
        /// The file.
        path: PathBuf,
        /// Its reason.
        source: ParquetError,
    },
    /// Not a table of this tool.
    #[error("{path}: expected {expected}, found {actual}")]
    Layout {
        /// The file.
        path: PathBuf,
        /// What was expected.
        expected: String,
        /// What is there.
        actual: String,
    },
    /// Columns and metadata contradict each other.
    #[error("{path}: {source}")]
    Table {
        /// The file.
        path: PathBuf,
        /// How.
        source: TableError,
    },
}

/// Writes a table and waits until it is on the disk. Equal tables give equal bytes.
///
/// # Errors
/// [`ParquetTableError::Io`] or [`ParquetTableError::Parquet`].
pub fn write(path: &Path, table: &Table, provenance: &Provenance) -> Result<(), ParquetTableError> {
    let file = File::create(path).map_err(|e| io(path, e))?;
    let disk = file.try_clone().map_err(|e| io(path, e))?;
    write_to(file, table, provenance).map_err(|e| layer(path, e))?;
    disk.sync_all().map_err(|e| io(path, e))
}

fn write_to(file: File, table: &Table, provenance: &Provenance) -> Result<(), ParquetError> {
    let metadata = [
        (META, json_lines(std::slice::from_ref(provenance))),
        (CONFIG, provenance.config.clone()),
        (OUTCOMES, json_lines(table.outcomes())),
    ];
    let metadata = metadata.into_iter().map(|(key, value)| KeyValue::new(key.into(), value));
    let mut properties = WriterProperties::builder()
        .set_created_by(format!("corsmal-feat {}", env!("CARGO_PKG_VERSION")))
        .set_compression(Compression::SNAPPY)
        // Floats hardly ever repeat; ids and labels do.
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_key_value_metadata(Some(metadata.collect()));
    for (name, _) in text_columns(table) {
        let column = ColumnPath::new(vec![name.to_string()]);
        properties = properties.set_column_dictionary_enabled(column, true);
    }
    let out = BufWriter::with_capacity(1 << 20, file);
    let mut writer = SerializedFileWriter::new(out, schema(table)?, Arc::new(properties.build()))?;
    let rows = table.ids().len();
    for start in (0..rows).step_by(ROWS) {
        let range = start..rows.min(start + ROWS);
        let mut group = writer.next_row_group()?;
        for (_, texts) in text_columns(table) {
            let values: Vec<ByteArray> =
                texts[range.clone()].iter().map(|text| text.as_str().into()).collect();
            write_column::<ByteArrayType>(&mut group, &values)?;
        }
        for column in table.values().columns() {
            let values: Vec<f32> = range.clone().map(|row| column[row]).collect();
            write_column::<FloatType>(&mut group, &values)?;
        }
        group.close()?;
    }
    writer.close().map(drop)
}

fn write_column<T: DataType>(
    group: &mut SerializedRowGroupWriter<'_, BufWriter<File>>,
    values: &[T::T],
) -> Result<(), ParquetError> {
    let mut column =
        group.next_column()?.ok_or_else(|| ParquetError::General("too many columns".into()))?;
    column.typed::<T>().write_batch(values, None, None)?;
    column.close()
}

fn text_columns(table: &Table) -> impl Iterator<Item = (&str, &[String])> {
    std::iter::once((ID, table.ids())).chain(table.labels())
}

fn schema(table: &Table) -> Result<TypePtr, ParquetError> {
    let mut fields = Vec::new();
    for (name, _) in text_columns(table) {
        let field = Type::primitive_type_builder(name, Physical::BYTE_ARRAY)
            .with_repetition(Repetition::REQUIRED)
            .with_logical_type(Some(LogicalType::String))
            .with_converted_type(ConvertedType::UTF8);
        fields.push(Arc::new(field.build()?));
    }
    for name in table.feature_names() {
        let field = Type::primitive_type_builder(name, Physical::FLOAT)
            .with_repetition(Repetition::REQUIRED);
        fields.push(Arc::new(field.build()?));
    }
    Ok(Arc::new(Type::group_type_builder("features").with_fields(fields).build()?))
}

/// Reads back what [`write()`] wrote.
///
/// # Errors
/// [`ParquetTableError`]; Parquet files of other tools are refused.
pub fn read(path: &Path) -> Result<(Table, Provenance), ParquetTableError> {
    shielded(path, || read_table(path))
}

fn read_table(path: &Path) -> Result<(Table, Provenance), ParquetTableError> {
    let (reader, provenance) = open(path)?;
    let outcomes = parse_outcomes(metadata(&reader, path, OUTCOMES)?)
        .map_err(|e| layout(path, "outcomes as JSON lines", e))?;
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let (mut ids, mut labels, mut names, mut columns) = (None, Vec::new(), Vec::new(), Vec::new());
    for (index, column) in schema.columns().iter().enumerate() {
        let name = column.name().to_string();
        let parts = (0..reader.num_row_groups())
            .map(|group| reader.get_row_group(group)?.get_column_reader(index));
        match column.physical_type() {
            _ if column.max_def_level() > 0 || column.max_rep_level() > 0 => {
                return Err(layout(path, "required columns", format!("{name:?} is optional")));
            }
            Physical::BYTE_ARRAY => {
                let values = texts(parts).map_err(|e| layer(path, e))?;
                if name == ID { ids = Some(values) } else { labels.push((name, values)) }
            }
            Physical::FLOAT => {
                names.push(name);
                columns.push(floats(parts).map_err(|e| layer(path, e))?);
            }
            other => {
                return Err(layout(path, "text and float columns", format!("{name:?}: {other}")));
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

/// Reads how an output was made, without its columns.
///
/// # Errors
/// As [`read`].
pub fn read_provenance(path: &Path) -> Result<Provenance, ParquetTableError> {
    shielded(path, || open(path).map(|(_, provenance)| provenance))
}

/// The decoders of the parquet crate (60.1) assert what damaged pages do not keep, so their panics
/// end here as errors.
fn shielded<T>(
    path: &Path,
    read: impl FnOnce() -> Result<T, ParquetTableError>,
) -> Result<T, ParquetTableError> {
    catch_unwind(AssertUnwindSafe(read))
        .unwrap_or_else(|_| Err(layout(path, "sound Parquet pages", "damaged ones")))
}

fn open(path: &Path) -> Result<(SerializedFileReader<File>, Provenance), ParquetTableError> {
    let file = File::open(path).map_err(|e| io(path, e))?;
    let reader = SerializedFileReader::new(file).map_err(|e| layer(path, e))?;
    let mut provenance: Provenance = serde_json::from_str(metadata(&reader, path, META)?)
        .map_err(|e| layout(path, "provenance as JSON", e))?;
    if provenance.layout_version > LAYOUT_VERSION {
        let expected = format!("layout version {LAYOUT_VERSION} or lower");
        return Err(layout(path, expected, provenance.layout_version));
    }
    provenance.config = metadata(&reader, path, CONFIG)?.to_string();
    Ok((reader, provenance))
}

fn metadata<'a>(
    reader: &'a SerializedFileReader<File>,
    path: &Path,
    key: &str,
) -> Result<&'a str, ParquetTableError> {
    let pairs = reader.metadata().file_metadata().key_value_metadata();
    pairs
        .and_then(|pairs| pairs.iter().find(|pair| pair.key == key)?.value.as_deref())
        .ok_or_else(|| layout(path, format!("metadata {key}"), "none: not written by this tool"))
}

fn texts(
    parts: impl Iterator<Item = Result<ColumnReader, ParquetError>>,
) -> Result<Vec<String>, ParquetError> {
    let mut texts = Vec::new();
    for part in parts {
        let ColumnReader::ByteArrayColumnReader(reader) = part? else {
            return Err(ParquetError::General("a text column holds another type".into()));
        };
        for value in values(reader)? {
            texts.push(value.as_utf8()?.to_string());
        }
    }
    Ok(texts)
}

fn floats(
    parts: impl Iterator<Item = Result<ColumnReader, ParquetError>>,
) -> Result<Vec<f32>, ParquetError> {
    let mut floats = Vec::new();
    for part in parts {
        let ColumnReader::FloatColumnReader(reader) = part? else {
            return Err(ParquetError::General("a float column holds another type".into()));
        };
        floats.extend(values(reader)?);
    }
    Ok(floats)
}

fn values<T: DataType>(mut reader: ColumnReaderImpl<T>) -> Result<Vec<T::T>, ParquetError> {
    let mut values = Vec::new();
    while reader.read_records(ROWS, None, None, &mut values)?.0 > 0 {}
    Ok(values)
}

fn io(path: &Path, source: std::io::Error) -> ParquetTableError {
    ParquetTableError::Io { path: path.into(), source }
}

fn layer(path: &Path, source: ParquetError) -> ParquetTableError {
    ParquetTableError::Parquet { path: path.into(), source }
}

fn layout(
    path: &Path,
    expected: impl std::fmt::Display,
    actual: impl std::fmt::Display,
) -> ParquetTableError {
    ParquetTableError::Layout {
        path: path.into(),
        expected: expected.to_string(),
        actual: actual.to_string(),
    }
}
