//! The columns of numbers and text of any Parquet table, ours or another tool's.

use std::path::Path;

use half::f16;
use ndarray::Array2;
use parquet::basic::{ConvertedType, LogicalType, Type as Physical};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType, FixedLenByteArray};
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::error::{ParquetTableError, layer, layout};
use super::keys::ROWS;
use super::limits::{require_rows, spend};
use super::seal::SealedFile;
use crate::table::ID;

/// The numbers of a table, and its texts.
#[derive(Debug)]
pub struct NumericTable {
    /// The column `id` of texts or whole numbers, where there is one.
    pub ids: Option<Vec<String>>,
    /// Names of the numeric columns.
    pub names: Vec<String>,
    /// Their types: `float16`, `float32`, `float64`, `int32`, `int64`, `uint32`, `uint64` or `bool`.
    pub types: Vec<&'static str>,
    /// `[rows, columns]`; nulls are NaN.
    pub values: Array2<f64>,
    /// The other text columns, and whole numbers that `float64` would round; nulls are empty.
    pub texts: Vec<(String, Vec<String>)>,
    /// Columns that are neither numbers nor text.
    pub skipped: Vec<String>,
}

/// What a column holds.
enum Column {
    Numbers(&'static str, Vec<f64>),
    Texts(Vec<String>),
    /// Neither, or bytes that are no UTF-8.
    Other,
}

/// Reads the numeric columns of a table.
pub(super) fn read(
    path: &Path,
    reader: &SerializedFileReader<SealedFile>,
    rows: usize,
    mut text: u64,
) -> Result<NumericTable, ParquetTableError> {
    let schema = reader.metadata().file_metadata().schema_descr_ptr();
    let (mut ids, mut labels) = (None, Vec::new());
    let (mut names, mut types, mut skipped) = (Vec::new(), Vec::new(), Vec::new());
    let mut series: Vec<Vec<f64>> = Vec::new();
    for (index, column) in schema.columns().iter().enumerate() {
        let name = column.path().string();
        let parts = (0..reader.num_row_groups())
            .map(|group| reader.get_row_group(group)?.get_column_reader(index));
        let found = of_column(column, parts, rows, &mut text).map_err(|e| layer(path, e))?;
        match found {
            Column::Texts(values) if name == ID => ids = Some(values),
            Column::Texts(values) => labels.push((name, values)),
            Column::Numbers(kind, values) => {
                names.push(name);
                types.push(kind);
                series.push(values);
            }
            Column::Other => skipped.push(name),
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

/// Reads one column.
fn of_column(
    column: &ColumnDescriptor,
    parts: impl Iterator<Item = Result<ColumnReader, ParquetError>>,
    rows: usize,
    left: &mut u64,
) -> Result<Column, ParquetError> {
    let Some(kind) = kind_of(column) else { return Ok(Column::Other) };
    let levels = (column.max_def_level(), rows);
    let (mut numbers, mut integers, mut bytes) = (Vec::new(), Vec::new(), Vec::new());
    for part in parts {
        match part? {
            ColumnReader::FloatColumnReader(reader) => {
                append(reader, levels, &mut numbers, |v| Ok(f64::from(v)), f64::NAN)?;
            }
            ColumnReader::DoubleColumnReader(reader) => {
                append(reader, levels, &mut numbers, Ok, f64::NAN)?;
            }
            ColumnReader::FixedLenByteArrayColumnReader(reader) => {
                append(reader, levels, &mut numbers, half_precision, f64::NAN)?;
            }
            ColumnReader::BoolColumnReader(reader) => {
                let number = |v| Ok(f64::from(u8::from(v)));
                append(reader, levels, &mut numbers, number, f64::NAN)?;
            }
            ColumnReader::Int32ColumnReader(reader) => {
                let whole = |v: i32| match kind {
                    UNSIGNED32 => i128::from(v as u32),
                    _ => i128::from(v),
                };
                append(reader, levels, &mut integers, |v| Ok(Some(whole(v))), None)?;
            }
            ColumnReader::Int64ColumnReader(reader) => {
                let whole = |v: i64| match kind {
                    UNSIGNED64 => i128::from(v as u64),
                    _ => i128::from(v),
                };
                append(reader, levels, &mut integers, |v| Ok(Some(whole(v))), None)?;
            }
            ColumnReader::ByteArrayColumnReader(reader) => {
                let text = |v: ByteArray| match String::from_utf8(v.data().to_vec()) {
                    Ok(text) => spend(left, &text).map(drop).map(|()| Some(text)),
                    Err(_) => Ok(None),
                };
                append(reader, levels, &mut bytes, text, Some(String::new()))?;
            }
            _ => return Err(ParquetError::General("a column holds another type".into())),
        }
    }
    Ok(match kind {
        TEXT => bytes.into_iter().collect::<Option<_>>().map_or(Column::Other, Column::Texts),
        HALF | "float32" | "float64" | "bool" => Column::Numbers(kind, numbers),
        _ => whole(column, kind, integers, left)?,
    })
}

/// Whole numbers; as text where they are ids, or where a decimal number would not be the same.
fn whole(
    column: &ColumnDescriptor,
    kind: &'static str,
    values: Vec<Option<i128>>,
    left: &mut u64,
) -> Result<Column, ParquetError> {
    const EXACT: u128 = 1 << 53;
    let exact = values.iter().flatten().all(|value| value.unsigned_abs() <= EXACT);
    if exact && column.path().string() != ID {
        let number = |value: Option<i128>| value.map_or(f64::NAN, |value| value as f64);
        return Ok(Column::Numbers(kind, values.into_iter().map(number).collect()));
    }
    let mut texts = Vec::with_capacity(values.len());
    for value in values {
        let text = value.map_or(String::new(), |value| value.to_string());
        spend(left, &text)?;
        texts.push(text);
    }
    Ok(Column::Texts(texts))
}

/// A number of two bytes.
fn half_precision(value: FixedLenByteArray) -> Result<f64, ParquetError> {
    match value.data() {
        &[low, high] => Ok(f16::from_le_bytes([low, high]).to_f64()),
        other => {
            let reason = format!("a float16 has 2 bytes, not {}", other.len());
            Err(ParquetError::General(reason))
        }
    }
}

const TEXT: &str = "text";
const HALF: &str = "float16";
const UNSIGNED32: &str = "uint32";
const UNSIGNED64: &str = "uint64";

/// What the values of a column are, numbers in numpy's words; `None` for what is neither number nor
/// text, such as dates and decimal fractions of integers, and for lists.
fn kind_of(column: &ColumnDescriptor) -> Option<&'static str> {
    if column.max_rep_level() > 0 {
        return None;
    }
    let whole = |signed, unsigned| match (column.logical_type_ref(), column.converted_type()) {
        (Some(LogicalType::Integer(integer)), _) => {
            Some(if integer.is_signed { signed } else { unsigned })
        }
        (Some(_), _) => None,
        (None, ConvertedType::NONE) => Some(signed),
        (None, ConvertedType::INT_8 | ConvertedType::INT_16) => Some(signed),
        (None, ConvertedType::INT_32 | ConvertedType::INT_64) => Some(signed),
        (None, ConvertedType::UINT_8 | ConvertedType::UINT_16) => Some(unsigned),
        (None, ConvertedType::UINT_32 | ConvertedType::UINT_64) => Some(unsigned),
        (None, _) => None,
    };
    match column.physical_type() {
        Physical::FLOAT => Some("float32"),
        Physical::DOUBLE => Some("float64"),
        Physical::BOOLEAN => Some("bool"),
        Physical::INT32 => whole("int32", UNSIGNED32),
        Physical::INT64 => whole("int64", UNSIGNED64),
        Physical::BYTE_ARRAY if column.converted_type() == ConvertedType::DECIMAL => None,
        Physical::BYTE_ARRAY => Some(TEXT),
        Physical::FIXED_LEN_BYTE_ARRAY if is_half(column) => Some(HALF),
        _ => None,
    }
}

fn is_half(column: &ColumnDescriptor) -> bool {
    matches!(column.logical_type_ref(), Some(LogicalType::Float16))
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

    use parquet::data_type::{
        ByteArrayType, DoubleType, FixedLenByteArrayType, Int32Type, Int64Type,
    };
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

    #[test]
    fn whole_numbers_are_read_as_what_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("whole.parquet");
        let schema = parse_message_type(
            "message m { required int64 id; required int64 large; required int64 at (TIMESTAMP_MICROS);
             required int64 price (DECIMAL(9,2)); required int64 unsigned (UINT_64);
             required int32 small (UINT_32); required int64 whole; required binary bytes;
             required fixed_len_byte_array(2) half (FLOAT16); }",
        );
        let file = std::fs::File::create(&path).unwrap();
        let properties = Arc::new(WriterProperties::builder().build());
        let mut writer =
            SerializedFileWriter::new(file, Arc::new(schema.unwrap()), properties).unwrap();
        let mut group = writer.next_row_group().unwrap();
        let odd = (1_i64 << 53) + 1;
        for values in [[7, 8], [odd, odd - 1], [5, 6], [150, 250], [-1, 1]] {
            let mut column = group.next_column().unwrap().unwrap();
            column.typed::<Int64Type>().write_batch(&values, None, None).unwrap();
            column.close().unwrap();
        }
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int32Type>().write_batch(&[-1, 1], None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        column.typed::<Int64Type>().write_batch(&[odd - 1, -3], None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let bytes = [vec![0xff_u8], vec![0xfe]].map(ByteArray::from);
        column.typed::<ByteArrayType>().write_batch(&bytes, None, None).unwrap();
        column.close().unwrap();
        let mut column = group.next_column().unwrap().unwrap();
        let halves = [f16::from_f32(0.5), f16::from_f32(-3.0)];
        let halves = halves.map(|v| ByteArray::from(v.to_le_bytes().to_vec()).into());
        column.typed::<FixedLenByteArrayType>().write_batch(&halves, None, None).unwrap();
        column.close().unwrap();
        group.close().unwrap();
        writer.close().unwrap();

        let found = crate::parquet::ParquetFile::open(&path).unwrap().numbers().unwrap();
        assert_eq!(found.ids.unwrap(), ["7", "8"]);
        assert_eq!(found.skipped, ["at", "price", "bytes"]);
        assert_eq!(
            (found.names, found.types),
            (
                vec!["small".into(), "whole".into(), "half".into()],
                vec!["uint32", "int64", "float16"]
            )
        );
        assert_eq!(found.values.column(0).to_vec(), [4_294_967_295.0, 1.0]);
        assert_eq!(found.values.column(1).to_vec(), [9_007_199_254_740_992.0, -3.0]);
        assert_eq!(found.values.column(2).to_vec(), [0.5, -3.0]);
        let texts = [
            ("large", ["9007199254740993", "9007199254740992"]),
            ("unsigned", ["18446744073709551615", "1"]),
        ];
        let texts =
            texts.map(|(name, values)| (name.to_string(), values.map(String::from).to_vec()));
        assert_eq!(found.texts, texts);
    }
}
