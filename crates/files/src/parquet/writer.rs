//! Writes a table.

use std::fs::File;
use std::io::{BufWriter, Seek};
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, FloatType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, Type, TypePtr};

use super::error::{ParquetTableError, io, layer};
use super::keys::{CONFIG, META, OUTCOMES, ROWS, WRITER};
use crate::layout::json_lines;
use crate::provenance::Provenance;
use crate::table::{ID, Table};

/// Writes a table and waits until it is on the disk. Equal tables give equal bytes.
///
/// # Errors
/// [`ParquetTableError::Io`] or [`ParquetTableError::Parquet`].
pub fn write(path: &Path, table: &Table, provenance: &Provenance) -> Result<(), ParquetTableError> {
    write_over(File::create(path).map_err(|e| io(path, e))?, path, table, provenance)
}

/// As [`write()`], in place of what an open file holds; errors call it `path`.
///
/// # Errors
/// As those of [`write()`].
pub fn write_over(
    mut file: File,
    path: &Path,
    table: &Table,
    provenance: &Provenance,
) -> Result<(), ParquetTableError> {
    let disk = file.try_clone().map_err(|e| io(path, e))?;
    file.set_len(0).and_then(|()| file.rewind()).map_err(|e| io(path, e))?;
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
        .set_created_by(format!("{WRITER} {}", env!("CARGO_PKG_VERSION")))
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
