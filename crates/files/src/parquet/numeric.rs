//! The columns of numbers and text of any Parquet table, ours or another tool's.

use std::fs::File;
use std::path::Path;

use ndarray::Array2;
use parquet::basic::Type as Physical;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::error::{ParquetTableError, layer, layout};
use super::keys::ROWS;
use super::limits::{require_rows, spend};
use crate::table::ID;

/// The numbers of a table, and its texts.
#[derive(Debug)]
pub struct NumericTable {
    /// The text column `id`, where there is one.
    pub ids: Option<Vec<String>>,
    /// Names of the numeric columns.
    pub names: Vec<String>,
    /// Their types: `float32`, `float64`, `int32`, `int64` or `bool`.
    pub types: Vec<&'static str>,
    /// `[rows, columns]`; nulls are NaN.
    pub values: Array2<f64>,
    /// The other text columns; nulls are empty.
    pub texts: Vec<(String, Vec<String>)>,
    /// Columns that are neither numbers nor text.
    pub skipped: Vec<String>,
}

/// Reads the numeric columns of a table.
pub(super) fn read(
    path: &Path,
    reader: &SerializedFileReader<File>,
    rows: usize,
    mut text: u64,
) -> Result<NumericTable, ParquetTableError> {
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let (mut ids, mut labels) = (None, Vec::new());
    let (mut names, mut types, mut skipped) = (Vec::new(), Vec::new(), Vec::new());
    let mut series: Vec<Vec<f64>> = Vec::new();
    for (index, column) in schema.columns().iter().enumerate() {
        let name = column.path().string();
        let levels = column.max_def_level();
        let mut parts = (0..reader.num_row_groups())
            .map(|group| reader.get_row_group(group)?.get_column_reader(index));
        let numeric = type_of(column.physical_type()).filter(|_| column.max_rep_level() == 0);
        if let Some(kind) = numeric {
            let values = parts
                .try_fold(Vec::new(), |values, part| numbers(part?, levels, rows, values))
                .map_err(|e| layer(path, e))?;
            names.push(name);
            types.push(kind);
            series.push(values);
        } else if column.physical_type() == Physical::BYTE_ARRAY && column.max_rep_level() == 0 {
            let values = parts
                .try_fold(Vec::new(), |values, part| {
                    texts(part?, levels, (rows, &mut text), values)
                })
                .map_err(|e| layer(path, e))?;
            if name == ID { ids = Some(values) } else { labels.push((name, values)) }
        } else {
            skipped.push(name);
        }
    }
    let found = ids.iter().map(Vec::len).chain(series.iter().map(Vec::len));
    let mut lengths = found.chain(labels.iter().map(|(_, column): &(_, Vec<String>)| column.len()));
    let rows = lengths.next().unwrap_or(0);
    if let Some(other) = lengths.find(|length| *length != rows) {
        return Err(layout(path, format!("{rows} rows in each column"), other));
    }
    let values = Array2::from_shape_fn((rows, series.len()), |(row, column)| series[column][row]);
    Ok(NumericTable { ids, names, types, values, texts: labels, skipped })
}

/// The type of a column of numbers, in numpy's words.
fn type_of(column: Physical) -> Option<&'static str> {
    Some(match column {
        Physical::FLOAT => "float32",
        Physical::DOUBLE => "float64",
        Physical::INT32 => "int32",
        Physical::INT64 => "int64",
        Physical::BOOLEAN => "bool",
        _ => return None,
    })
}

fn numbers(
    reader: ColumnReader,
    levels: i16,
    rows: usize,
    mut into: Vec<f64>,
) -> Result<Vec<f64>, ParquetError> {
    let missing = f64::NAN;
    match reader {
        ColumnReader::FloatColumnReader(r) => {
            append(r, (levels, rows), &mut into, |v| Ok(f64::from(v)), missing)
        }
        ColumnReader::DoubleColumnReader(r) => append(r, (levels, rows), &mut into, Ok, missing),
        ColumnReader::Int32ColumnReader(r) => {
            append(r, (levels, rows), &mut into, |v| Ok(f64::from(v)), missing)
        }
        ColumnReader::Int64ColumnReader(r) => {
            append(r, (levels, rows), &mut into, |v| Ok(v as f64), missing)
        }
        ColumnReader::BoolColumnReader(r) => {
            append(r, (levels, rows), &mut into, |v| Ok(f64::from(u8::from(v))), missing)
        }
        _ => Err(ParquetError::General("a numeric column holds another type".into())),
    }?;
    Ok(into)
}

fn texts(
    reader: ColumnReader,
    levels: i16,
    (rows, left): (usize, &mut u64),
    mut into: Vec<String>,
) -> Result<Vec<String>, ParquetError> {
    let ColumnReader::ByteArrayColumnReader(reader) = reader else {
        return Err(ParquetError::General("a text column holds another type".into()));
    };
    let text = |v: ByteArray| {
        let text = String::from_utf8_lossy(v.data()).into_owned();
        spend(left, &text)?;
        Ok(text)
    };
    append(reader, (levels, rows), &mut into, text, String::new())?;
    Ok(into)
}

/// Appends the rows of a column, `missing` where the definition level says that there is no value.
fn append<T: DataType, V: Clone>(
    mut reader: ColumnReaderImpl<T>,
    (levels, rows): (i16, usize),
    into: &mut Vec<V>,
    mut convert: impl FnMut(T::T) -> Result<V, ParquetError>,
    missing: V,
) -> Result<(), ParquetError> {
    loop {
        let (mut defined, mut values) = (Vec::new(), Vec::new());
        let wanted = (levels > 0).then_some(&mut defined);
        if reader.read_records(ROWS, wanted, None, &mut values)?.0 == 0 {
            return Ok(());
        }
        let mut values = values.into_iter().map(&mut convert);
        if levels == 0 {
            for value in values {
                into.push(value?);
            }
        } else {
            for level in defined {
                let value = if level == levels { values.next().transpose()? } else { None };
                into.push(value.unwrap_or_else(|| missing.clone()));
            }
        }
        require_rows(into.len(), rows)?;
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use parquet::data_type::{ByteArrayType, DoubleType, Int64Type};
    use parquet::file::properties::WriterProperties;
    use parquet::file::writer::SerializedFileWriter;
    use parquet::schema::parser::parse_message_type;

    use super::*;

    #[test]
    fn tables_of_other_tools_are_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("foreign.parquet");
        // As pandas writes them: everything optional.
        let schema = parse_message_type(
            "message m { optional binary id (UTF8); optional double x; required int64 n;
             optional binary note (UTF8); }",
        );
        let file = std::fs::File::create(&path).unwrap();
        let properties = Arc::new(WriterProperties::builder().build());
        let mut writer =
            SerializedFileWriter::new(file, Arc::new(schema.unwrap()), properties).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let text =
            |values: &[&str],
             group: &mut parquet::file::writer::SerializedRowGroupWriter<'_, _>| {
                let values: Vec<ByteArray> = values.iter().map(|&v| v.into()).collect();
                let mut column = group.next_column().unwrap().unwrap();
                let levels = vec![1; values.len()];
                column.typed::<ByteArrayType>().write_batch(&values, Some(&levels), None).unwrap();
                column.close().unwrap();
            };
        text(&["a", "b", "c"], &mut group);
        let mut column = group.next_column().unwrap().unwrap();
        let doubles = column.typed::<DoubleType>();
        doubles.write_batch(&[0.5, -2.0], Some(&[1, 0, 1]), None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(&[7, 8, 9], None, None).unwrap();
        column.close().unwrap();
        text(&["one", "two", "three"], &mut group);
        group.close().unwrap();
        writer.close().unwrap();

        let found = crate::parquet::ParquetFile::open(&path).unwrap().numbers().unwrap();
        assert_eq!(found.ids.unwrap(), ["a", "b", "c"]);
        assert_eq!(
            (found.names, found.types),
            (vec!["x".into(), "n".into()], vec!["float64", "int64"])
        );
        let note = ["one", "two", "three"].map(String::from).to_vec();
        assert_eq!(found.texts, [("note".to_string(), note)]);
        assert_eq!(found.values.column(1).to_vec(), [7.0, 8.0, 9.0]);
        let x = found.values.column(0);
        assert_eq!([x[0], x[2]], [0.5, -2.0]);
        assert!(x[1].is_nan() && found.skipped.is_empty());
    }
}
