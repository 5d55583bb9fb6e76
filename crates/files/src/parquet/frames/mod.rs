//! Frames as a Parquet file: a row for each recording, for each feature a column of nested lists
//! `[channels][coefficients][frames]` and one with the times of its frames.

mod read;

use std::fs::File;
use std::io::Seek;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use ndarray::ArrayD;
use parquet::basic::{
    Compression, ConvertedType, Encoding, LogicalType, Repetition, Type as Physical, ZstdLevel,
};
use parquet::data_type::{DoubleType, FloatType};
use parquet::errors::ParquetError;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{ColumnPath, Type};

use super::error::{ParquetTableError, io, layer, layout};
use super::levels::Levels;
use super::seal::{self, SealingWriter};
use super::writer::{properties, schema, write_column, write_texts};
use crate::layout::TIMES;
use crate::provenance::Provenance;
use crate::table::Table;

pub(super) use read::Cursors;

/// Most values of one feature of one recording: a row lies in memory whole (128 MiB).
pub const MAX_FRAMES: u64 = 1 << 25;

/// Bytes of values after which a row group is complete (32 MiB).
const GROUP: u64 = 32 << 20;

/// Axes of the frames of a recording.
const AXES: usize = 3;

/// One feature of one recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    /// `[channels, coefficients, frames]`.
    pub values: ArrayD<f32>,
    /// Time of each frame in seconds.
    pub times: Vec<f64>,
}

impl Default for Frames {
    /// Of a recording that is too short for any frame.
    fn default() -> Self {
        Self { values: ArrayD::zeros(vec![0; AXES]), times: Vec::new() }
    }
}

/// Writes the frames of the rows of a table, in their order. Equal frames give equal bytes.
pub struct FramesWriter<'a> {
    writer: SerializedFileWriter<SealingWriter>,
    disk: File,
    path: PathBuf,
    table: &'a Table,
    /// One list per column.
    waiting: Vec<Vec<Frames>>,
    /// Rows that are written.
    written: usize,
    bytes: u64,
}

impl<'a> FramesWriter<'a> {
    /// Begins in place of what an open file holds; errors call it `path`. Features are those of the
    /// configuration in `provenance`.
    ///
    /// # Errors
    /// [`ParquetTableError`].
    pub fn over(
        mut file: File,
        path: &Path,
        table: &'a Table,
        provenance: &Provenance,
    ) -> Result<Self, ParquetTableError> {
        let disk = file.try_clone().map_err(|e| io(path, e))?;
        file.set_len(0).and_then(|()| file.rewind()).map_err(|e| io(path, e))?;
        let features = provenance.features();
        let begun = begin(file, table, provenance, &features).map_err(|e| layer(path, e))?;
        Ok(Self {
            writer: begun,
            disk,
            path: path.into(),
            table,
            waiting: vec![Vec::new(); features.len()],
            written: 0,
            bytes: 0,
        })
    }

    /// Appends the next row: its features in the order of the configuration.
    ///
    /// # Errors
    /// [`ParquetTableError`]; more rows or other features than were announced, frames of another
    /// number of axes or of more than [`MAX_FRAMES`] values.
    pub fn push(&mut self, row: Vec<Frames>) -> Result<(), ParquetTableError> {
        let rows = self.written + self.waiting.first().map_or(0, Vec::len);
        if row.len() != self.waiting.len() || rows == self.table.ids().len() {
            let (features, ids) = (self.waiting.len(), self.table.ids().len());
            let expected = format!("{features} features in each of {ids} rows");
            return Err(layout(&self.path, expected, format!("{} in row {rows}", row.len())));
        }
        let fits = |f: &Frames| f.values.ndim() == AXES && entries(f.values.shape()) <= MAX_FRAMES;
        if let Some(frames) = row.iter().find(|frames| !fits(frames)) {
            let expected =
                format!("frames [channels, coefficients, frames] of at most {MAX_FRAMES} values");
            return Err(layout(&self.path, expected, format!("{:?}", frames.values.shape())));
        }
        let of = |f: &Frames| 4 * entries(f.values.shape()) + 8 * f.times.len() as u64;
        let bytes: u64 = row.iter().map(of).sum();
        // One that is larger than a group has a group of its own.
        if self.bytes > 0 && self.bytes + bytes > GROUP {
            self.flush()?;
        }
        self.bytes += bytes;
        for (column, frames) in self.waiting.iter_mut().zip(row) {
            column.push(frames);
        }
        Ok(())
    }

    /// Completes the file and waits until it is on the disk.
    ///
    /// # Errors
    /// [`ParquetTableError`]; rows are missing.
    pub fn finish(mut self) -> Result<(), ParquetTableError> {
        self.flush()?;
        let rows = self.table.ids().len();
        if self.written != rows {
            return Err(layout(&self.path, format!("{rows} rows"), self.written));
        }
        seal::finish(self.writer).map_err(|e| layer(&self.path, e))?;
        self.disk.sync_all().map_err(|e| io(&self.path, e))
    }

    fn flush(&mut self) -> Result<(), ParquetTableError> {
        let rows = self.waiting.first().map_or(0, Vec::len);
        if rows > 0 {
            self.write_group(rows).map_err(|e| layer(&self.path, e))?;
            self.written += rows;
            self.bytes = 0;
        }
        Ok(())
    }

    fn write_group(&mut self, rows: usize) -> Result<(), ParquetError> {
        let mut group = self.writer.next_row_group()?;
        write_texts(&mut group, self.table, self.written..self.written + rows)?;
        for column in &mut self.waiting {
            let (mut levels, mut values) = (Levels::default(), Vec::new());
            let (mut time_levels, mut times) = (Levels::default(), Vec::new());
            for frames in column.drain(..) {
                levels.push(frames.values.shape());
                values.extend(frames.values.iter());
                time_levels.push(&[frames.times.len()]);
                times.extend(frames.times);
            }
            write_column::<FloatType>(&mut group, &values, Some(&levels))?;
            write_column::<DoubleType>(&mut group, &times, Some(&time_levels))?;
        }
        group.close().map(drop)
    }
}

fn begin(
    file: File,
    table: &Table,
    provenance: &Provenance,
    features: &[String],
) -> Result<SerializedFileWriter<SealingWriter>, ParquetError> {
    let mut properties = properties(table, provenance, Compression::ZSTD(ZstdLevel::try_new(1)?));
    let mut fields = Vec::with_capacity(2 * features.len());
    for feature in features {
        let times = format!("{TIMES}{feature}");
        for (name, physical, depth) in
            [(feature, Physical::FLOAT, AXES), (&times, Physical::DOUBLE, 1)]
        {
            fields.push(nested(name, physical, depth));
            // Bytes of equal weight lie side by side, which compresses well.
            properties =
                properties.set_column_encoding(path_of(name, depth), Encoding::BYTE_STREAM_SPLIT);
        }
    }
    let schema = schema(table, fields.into_iter())?;
    SerializedFileWriter::new(SealingWriter::new(file), schema, Arc::new(properties.build()))
}

/// Lists in lists, `depth` of them, without nulls.
fn nested(name: &str, physical: Physical, depth: usize) -> Result<Type, ParquetError> {
    let inside = |level: usize| if level == 0 { name } else { "element" };
    let mut field = Type::primitive_type_builder(inside(depth), physical)
        .with_repetition(Repetition::REQUIRED)
        .build()?;
    for level in (0..depth).rev() {
        let list = Type::group_type_builder("list")
            .with_repetition(Repetition::REPEATED)
            .with_fields(vec![Arc::new(field)])
            .build()?;
        field = Type::group_type_builder(inside(level))
            .with_repetition(Repetition::REQUIRED)
            .with_logical_type(Some(LogicalType::List))
            .with_converted_type(ConvertedType::LIST)
            .with_fields(vec![Arc::new(list)])
            .build()?;
    }
    Ok(field)
}

/// Where the values of [`nested`] lists are.
fn path_of(name: &str, depth: usize) -> ColumnPath {
    let inner = ["list", "element"].into_iter().cycle().take(2 * depth).map(str::to_owned);
    ColumnPath::new(std::iter::once(name.to_owned()).chain(inner).collect())
}

/// Values that an array of this shape stands for; an empty list counts as one.
pub fn entries(shape: &[usize]) -> u64 {
    shape.iter().fold(1, |product: u64, n| product.saturating_mul((*n).max(1) as u64))
}

#[cfg(test)]
mod tests {
    use parquet::file::reader::FileReader;

    use super::*;
    use crate::outcome::{Outcome, Status};
    use crate::parquet::ParquetFile;
    use crate::parquet::keys::{BLOCKS, HASH};
    use crate::shard::Shard;

    fn frames(shape: [usize; 3], seed: usize) -> Frames {
        let values = ArrayD::from_shape_fn(shape.to_vec(), |at| {
            (seed * 1000 + at[0] * 100 + at[1] * 10 + at[2]) as f32
        });
        Frames { values, times: (0..shape[2]).map(|t| t as f64 * 0.1).collect() }
    }

    /// Recordings of which every third is too short for frames.
    fn recordings(count: usize) -> (Table, Vec<Vec<Frames>>) {
        let mut table = Table::new(vec!["level".into()]).unwrap();
        let mut rows = Vec::new();
        for i in 0..count {
            let label = [("level".to_string(), format!("l{i}"))];
            table
                .push(Outcome::new(format!("r/{i}"), "x.wav", Status::Ok, ""), &label, &[])
                .unwrap();
            rows.push(match i % 3 {
                2 => vec![Frames::default(), frames([2, 1, 0], i)],
                _ => vec![frames([2, 4, 3 + i], i), frames([2, 1, 1], i)],
            });
        }
        (table, rows)
    }

    fn provenance() -> Provenance {
        let config = r#"{"features": {"mfcc": {}, "rms": {}}}"#;
        Provenance::new(config.into(), "c0ffee".into(), "beef".into(), Shard::default())
    }

    fn write(path: &Path, table: &Table, rows: &[Vec<Frames>]) -> Result<(), ParquetTableError> {
        let file = File::options().create(true).read(true).write(true).truncate(false).open(path);
        let mut writer = FramesWriter::over(file.unwrap(), path, table, &provenance())?;
        rows.iter().try_for_each(|row| writer.push(row.clone()))?;
        writer.finish()
    }

    #[test]
    fn frames_come_back_in_any_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let (table, rows) = recordings(10);
        write(&path, &table, &rows).unwrap();
        let first = std::fs::read(&path).unwrap();
        write(&path, &table, &rows).unwrap();
        assert!(std::fs::read(&path).unwrap() == first, "equal frames give equal bytes");
        let mut file = ParquetFile::open(&path).unwrap();
        assert!(file.is_ours());
        assert_eq!(file.table().unwrap(), (table, provenance()));
        assert_eq!(file.frame_features(), ["mfcc", "rms"]);
        for row in (0..10).chain((0..10).rev()).chain([3, 3, 9, 0]) {
            for (feature, expected) in ["mfcc", "rms"].iter().zip(&rows[row]) {
                assert_eq!(file.frames(row, feature).unwrap(), *expected, "{row} {feature}");
            }
        }
        assert!(file.frames(10, "mfcc").unwrap_err().to_string().contains("expected a row 10"));
        assert!(file.frames(0, "mel").unwrap_err().to_string().contains("mel"));
    }

    #[test]
    fn groups_are_of_bounded_size() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let (table, _) = recordings(3);
        let long = Frames { values: ArrayD::zeros(vec![8, 100, 7000]), times: vec![0.0; 7000] };
        let rows: Vec<_> = (0..3).map(|_| vec![long.clone(), Frames::default()]).collect();
        write(&path, &table, &rows).unwrap();
        let mut file = ParquetFile::open(&path).unwrap();
        // 22 MB each: two do not share a group.
        assert_eq!(file.reader.metadata().num_row_groups(), 3);
        assert!(std::fs::metadata(&path).unwrap().len() < 1 << 20, "zeros take no room");
        for row in [2, 0, 1] {
            assert!(file.frames(row, "mfcc").unwrap() == long);
        }
    }

    #[test]
    fn what_was_not_announced_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let (table, rows) = recordings(3);
        let refused = |rows: &[Vec<Frames>]| write(&path, &table, rows).unwrap_err().to_string();
        assert!(refused(&rows[..2]).contains("expected 3 rows, found 2"));
        assert!(refused(&[vec![Frames::default()]]).contains("expected 2 features"));
        let more: Vec<_> = rows.iter().chain(&rows).cloned().collect();
        assert!(refused(&more).contains("in each of 3 rows"));
        let wide =
            Frames { values: ArrayD::zeros(vec![1, 0, MAX_FRAMES as usize + 1]), times: vec![] };
        assert!(refused(&[vec![wide, Frames::default()]]).contains("at most 33554432"));
    }

    #[test]
    fn damage_gives_an_answer() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.parquet");
        let (table, rows) = recordings(4);
        write(&path, &table, &rows).unwrap();
        let mut bytes = std::fs::read(&path).unwrap();
        // What the hashes would notice before the readers see it.
        seal::without(&[BLOCKS, HASH], &mut bytes);
        for at in (0..bytes.len()).step_by(11) {
            let mut damaged = bytes.clone();
            damaged[at] = [0, 1, 0x7f, 0xff][at % 4];
            std::fs::write(&path, &damaged).unwrap();
            let Ok(mut file) = ParquetFile::open(&path) else { continue };
            for (row, feature) in [(0, "mfcc"), (2, "rms"), (3, "mfcc")] {
                let _ = file.frames(row, feature);
            }
        }
    }
}
