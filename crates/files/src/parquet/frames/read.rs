//! Frames of single rows.

use std::collections::BTreeMap;

use ndarray::ArrayD;
use parquet::basic::Type as Physical;
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::DataType;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, RowGroupReader};
use parquet::schema::types::{ColumnDescriptor, ColumnPath};

use super::{AXES, Frames, MAX_FRAMES, path_of};
use crate::layout::TIMES;
use crate::parquet::error::{ParquetTableError, layer, layout};
use crate::parquet::levels::Levels;
use crate::parquet::limits::shielded;
use crate::parquet::reader::ParquetFile;

/// Where reading of each column has come to, so that rows in order are read once.
#[derive(Default)]
pub(in crate::parquet) struct Cursors {
    checked: bool,
    open: BTreeMap<usize, Cursor>,
}

struct Cursor {
    group: usize,
    /// The row of the group that comes next.
    next: usize,
    reader: ColumnReader,
}

impl ParquetFile {
    /// Features of which the file has frames.
    pub fn frame_features(&self) -> Vec<String> {
        let schema = self.reader.metadata().file_metadata().schema_descr();
        let frames = schema.columns().iter().filter_map(|column| frames_name(column));
        frames.map(str::to_owned).collect()
    }

    /// The frames of a row and their times. Rows in order are read fastest.
    ///
    /// # Errors
    /// [`ParquetTableError`]; there is no such row or feature, or it has more than [`MAX_FRAMES`]
    /// values.
    pub fn frames(&mut self, row: usize, feature: &str) -> Result<Frames, ParquetTableError> {
        let values = self.frame_values(row, feature)?;
        Ok(Frames { values, times: self.frame_times(row, feature)? })
    }

    /// The frames of a row, without their times.
    ///
    /// # Errors
    /// As [`ParquetFile::frames`].
    pub fn frame_values(
        &mut self,
        row: usize,
        feature: &str,
    ) -> Result<ArrayD<f32>, ParquetTableError> {
        let place = path_of(feature, AXES);
        let (values, levels) = self.row(row, &place, |reader, skip| match reader {
            ColumnReader::FloatColumnReader(reader) => record(reader, skip),
            _ => Err(ParquetError::General("frames that are not float32".into())),
        })?;
        let path = self.path();
        let ragged = || layout(path, "frames that are an array", format!("lists in row {row}"));
        let shape = levels.shape(AXES).ok_or_else(ragged)?;
        ArrayD::from_shape_vec(shape, values).map_err(|_| ragged())
    }

    /// The times of the frames of a row, in seconds.
    ///
    /// # Errors
    /// As [`ParquetFile::frames`].
    pub fn frame_times(
        &mut self,
        row: usize,
        feature: &str,
    ) -> Result<Vec<f64>, ParquetTableError> {
        let place = path_of(&format!("{TIMES}{feature}"), 1);
        let (times, _) = self.row(row, &place, |reader, skip| match reader {
            ColumnReader::DoubleColumnReader(reader) => record(reader, skip),
            _ => Err(ParquetError::General("times that are not float64".into())),
        })?;
        Ok(times)
    }

    /// Values and levels of one row of the column at `place`.
    fn row<V>(
        &mut self,
        row: usize,
        place: &ColumnPath,
        take: impl Fn(&mut ColumnReader, usize) -> Result<(Vec<V>, Levels), ParquetError>,
    ) -> Result<(Vec<V>, Levels), ParquetTableError> {
        let path = self.path().to_path_buf();
        shielded(&path, || self.row_of(row, place, take))
    }

    fn row_of<V>(
        &mut self,
        row: usize,
        place: &ColumnPath,
        take: impl Fn(&mut ColumnReader, usize) -> Result<(Vec<V>, Levels), ParquetError>,
    ) -> Result<(Vec<V>, Levels), ParquetTableError> {
        if !self.cursors.checked {
            self.check_pages()?;
            self.cursors.checked = true;
        }
        let path = self.path().to_path_buf();
        let metadata = self.reader.metadata();
        let columns = metadata.file_metadata().schema_descr().columns();
        let Some(index) = columns.iter().position(|column| column.path() == place) else {
            return Err(layout(&path, format!("a column {:?}", place.string()), "none"));
        };
        let (mut group, mut at) = (0, row);
        for rows in metadata.row_groups().iter().map(|g| g.num_rows().max(0) as usize) {
            if at < rows {
                break;
            }
            (group, at) = (group + 1, at - rows);
        }
        if group == metadata.num_row_groups() {
            return Err(layout(&path, format!("a row {row}"), "fewer rows"));
        }
        let mut cursor = match self.cursors.open.remove(&index) {
            Some(cursor) if cursor.group == group && cursor.next <= at => cursor,
            _ => {
                let rows = self.reader.get_row_group(group).map_err(|e| layer(&path, e))?;
                let reader = open(&*rows, index).map_err(|e| layer(&path, e))?;
                Cursor { group, next: 0, reader }
            }
        };
        let found = take(&mut cursor.reader, at - cursor.next).map_err(|e| layer(&path, e))?;
        cursor.next = at + 1;
        self.cursors.open.insert(index, cursor);
        Ok(found)
    }
}

/// A reader of a column whose pages hold no more than a group of ours may.
fn open(group: &dyn RowGroupReader, index: usize) -> Result<ColumnReader, ParquetError> {
    let mut pages = group.get_column_page_reader(index)?;
    let mut levels = 0u64;
    while let Some(page) = pages.peek_next_page()? {
        levels = levels.saturating_add(page.num_levels.unwrap_or(0) as u64);
        if levels > MAX_FRAMES {
            let why = format!("a row group of more than {MAX_FRAMES} values of one feature");
            return Err(ParquetError::General(why));
        }
        pages.skip_next_page()?;
    }
    group.get_column_reader(index)
}

/// The row after the next `skip` ones.
fn record<T: DataType>(
    reader: &mut ColumnReaderImpl<T>,
    skip: usize,
) -> Result<(Vec<T::T>, Levels), ParquetError> {
    let (mut values, mut levels) = (Vec::new(), Levels::default());
    let Levels { definition, repetition } = &mut levels;
    let read = reader.skip_records(skip)? == skip
        && reader.read_records(1, Some(definition), Some(repetition), &mut values)?.0 == 1;
    if read { Ok((values, levels)) } else { Err(ParquetError::General("rows are missing".into())) }
}

/// The feature whose frames a column holds.
fn frames_name(column: &ColumnDescriptor) -> Option<&str> {
    let frames = column.physical_type() == Physical::FLOAT
        && (column.max_rep_level(), column.max_def_level()) == (AXES as i16, AXES as i16);
    column.path().parts().first().filter(|_| frames).map(String::as_str)
}
