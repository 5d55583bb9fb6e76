//! Writes a table.

use std::fs::File;
use std::io::Seek;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use parquet::basic::{Compression, ConvertedType, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DataType, FloatType};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties, WriterPropertiesBuilder};
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::types::{ColumnPath, Type, TypePtr};

use super::error::{ParquetTableError, io, layer};
use super::keys::{CONFIG, META, OUTCOMES, ROWS, WRITER};
use super::levels::Levels;
use super::seal::{self, SealingWriter};
use crate::layout::json_lines;
use crate::provenance::Provenance;
use crate::table::{ID, Table};

/// A row group that is being written.
pub(super) type Group<'a> = SerializedRowGroupWriter<'a, SealingWriter>;

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
    let properties = properties(table, provenance, Compression::SNAPPY);
    let fields = table.feature_names().iter().map(|name| {
        Type::primitive_type_builder(name, Physical::FLOAT)
            .with_repetition(Repetition::REQUIRED)
            .build()
    });
    let schema = schema(table, fields)?;
    let mut writer =
        SerializedFileWriter::new(SealingWriter::new(file), schema, Arc::new(properties.build()))?;
    let rows = table.ids().len();
    for start in (0..rows).step_by(ROWS) {
        let range = start..rows.min(start + ROWS);
        let mut group = writer.next_row_group()?;
        write_texts(&mut group, table, range.clone())?;
        for column in table.values().columns() {
            let values: Vec<f32> = range.clone().map(|row| column[row]).collect();
            write_column::<FloatType>(&mut group, &values, None)?;
        }
        group.close()?;
    }
    seal::finish(writer)
}

/// What every output of ours says of itself, and how its texts are stored.
pub(super) fn properties(
    table: &Table,
    provenance: &Provenance,
    compression: Compression,
) -> WriterPropertiesBuilder {
    let metadata = [
        (META, json_lines(std::slice::from_ref(provenance))),
        (CONFIG, provenance.config.clone()),
        (OUTCOMES, json_lines(table.outcomes())),
    ];
    let metadata = metadata.into_iter().map(|(key, value)| KeyValue::new(key.into(), value));
    let mut properties = WriterProperties::builder()
        .set_created_by(format!("{WRITER} {}", env!("CARGO_PKG_VERSION")))
        .set_compression(compression)
        // Floats hardly ever repeat; ids and labels do.
        .set_dictionary_enabled(false)
        .set_statistics_enabled(EnabledStatistics::Chunk)
        .set_key_value_metadata(Some(metadata.collect()));
    for (name, _) in text_columns(table) {
        let column = ColumnPath::new(vec![name.to_string()]);
        properties = properties.set_column_dictionary_enabled(column, true);
    }
    properties
}

/// Ids and labels of some rows.
pub(super) fn write_texts(
    group: &mut Group<'_>,
    table: &Table,
    rows: Range<usize>,
) -> Result<(), ParquetError> {
    for (_, texts) in text_columns(table) {
        let values: Vec<ByteArray> =
            texts[rows.clone()].iter().map(|text| text.as_str().into()).collect();
        write_column::<ByteArrayType>(group, &values, None)?;
    }
    Ok(())
}

/// The next column of a row group; of nested lists with definition and repetition levels.
pub(super) fn write_column<T: DataType>(
    group: &mut Group<'_>,
    values: &[T::T],
    levels: Option<&Levels>,
) -> Result<(), ParquetError> {
    let mut column =
        group.next_column()?.ok_or_else(|| ParquetError::General("too many columns".into()))?;
    let (definition, repetition) =
        levels.map(|l| (l.definition.as_slice(), l.repetition.as_slice())).unzip();
    column.typed::<T>().write_batch(values, definition, repetition)?;
    column.close()
}

fn text_columns(table: &Table) -> impl Iterator<Item = (&str, &[String])> {
    std::iter::once((ID, table.ids())).chain(table.labels())
}

/// Id, labels, then what holds the features.
pub(super) fn schema(
    table: &Table,
    features: impl Iterator<Item = Result<Type, ParquetError>>,
) -> Result<TypePtr, ParquetError> {
    let mut fields = Vec::new();
    for (name, _) in text_columns(table) {
        let field = Type::primitive_type_builder(name, Physical::BYTE_ARRAY)
            .with_repetition(Repetition::REQUIRED)
            .with_logical_type(Some(LogicalType::String))
            .with_converted_type(ConvertedType::UTF8);
        fields.push(Arc::new(field.build()?));
    }
    for field in features {
        fields.push(Arc::new(field?));
    }
    Ok(Arc::new(Type::group_type_builder("features").with_fields(fields).build()?))
}
