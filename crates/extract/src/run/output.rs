//! The output of a run: recordings go in in the order of the inputs.

use std::sync::Arc;

use super::error::RunError;
use super::frames;
use super::partitions::PartitionBy;
use crate::engine::{FeatureArray, Plan};
use crate::inputs::Input;
use crate::ledger::{Ledger, Record};
use corsmal_files::draft::Draft;
use corsmal_files::format::OutputFormat;
use corsmal_files::layout;
use corsmal_files::npy::{DType, Header};
use corsmal_files::npz::{Compression, EntryRecord, NpzWriter, Packed};
use corsmal_files::outcome::{Outcome, Status};
use corsmal_files::parquet;
use corsmal_files::provenance::Provenance;
use corsmal_files::table::{Table, TableError};

/// What a worker hands over for one input.
pub struct Finished {
    /// What became of it.
    pub outcome: Outcome,
    /// Its features, already in the form in which they are written.
    pub arrays: Vec<Member>,
    /// Its summary row and the names of the columns.
    pub row: Option<(Vec<f32>, Arc<[String]>)>,
}

/// One array of a recording.
pub struct Member {
    name: String,
    header: Header,
    data: Data,
}

enum Data {
    Stored(crate::engine::Store),
    Packed(Packed),
    Times(Vec<f64>),
}

impl Member {
    /// The members of a recording's frame-level features: arrays and the times of their frames.
    ///
    /// # Errors
    /// A temporary file fails.
    pub fn of(
        id: &str,
        plan: &Plan,
        arrays: Vec<FeatureArray>,
        compression: Compression,
    ) -> std::io::Result<Vec<Self>> {
        let several = arrays.len() > 1;
        let mut members = Vec::with_capacity(2 * arrays.len());
        for array in arrays {
            let feature = several.then_some(array.name.as_str());
            let dtype = if array.complex { DType::C64 } else { DType::F32 };
            let shape = [plan.channels, array.coefficients, array.frames];
            let header = Header::new(dtype, &shape).fortran();
            let hop = plan.hop(&array.name);
            let times: Vec<f64> =
                (0..array.frames).map(|t| t as f64 * hop / plan.sample_rate).collect();
            let data = match compression {
                Compression::Stored => Data::Stored(array.values),
                Compression::Deflated => {
                    let values = array.values.into_vec()?;
                    Data::Packed(Packed::deflate(&header, bytemuck::cast_slice(&values)))
                }
            };
            members.push(Self { name: layout::frames_name(id, feature), header, data });
            members.push(Self {
                name: layout::times_name(id, feature),
                header: Header::new(DType::F64, &[times.len()]),
                data: Data::Times(times),
            });
        }
        Ok(members)
    }

    /// Why it does not fit into a row of Parquet.
    fn too_long(&self) -> Option<String> {
        let shape: Vec<usize> = self.header.shape.iter().map(|n| *n as usize).collect();
        let values = parquet::entries(&shape);
        (values > parquet::MAX_FRAMES).then(|| {
            format!(
                "frames of {values} values; a row of Parquet takes at most {}: cut the recording \
                 in a manifest, or write .npz",
                parquet::MAX_FRAMES
            )
        })
    }

    fn write(self, writer: &mut NpzWriter) -> Result<EntryRecord, RunError> {
        Ok(match self.data {
            Data::Packed(packed) => writer.packed(&self.name, &packed)?,
            Data::Times(times) => {
                writer.array(&self.name, &self.header, bytemuck::cast_slice(&times))?
            }
            Data::Stored(mut store) => match store.single() {
                Some(values) => {
                    writer.array(&self.name, &self.header, bytemuck::cast_slice(values))?
                }
                None => writer.array_with(&self.name, &self.header, |out| {
                    store.chunks(|chunk| out.write_all(bytemuck::cast_slice(chunk)))
                })?,
            },
        })
    }
}

/// The open output.
pub struct Output {
    /// Where results go besides the table; nowhere, where the table is all that is wanted.
    partial: Option<Partial>,
    table: Table,
    /// Inputs written so far.
    pub next: usize,
}

/// A partial output and its ledger.
struct Partial {
    ledger: Ledger,
    /// Of frames and of an `.npz`; a Parquet table is written at the end.
    writer: Option<NpzWriter>,
    format: OutputFormat,
}

impl Output {
    /// Opens the output after the records of an interrupted run, which are of the first of `inputs`, its shard of
    /// `all`; it is to hold frames or a summary.
    pub fn new(
        ledger: Ledger,
        records: Vec<Record>,
        (inputs, all): (&[Input], &[Input]),
        (format, frames): (OutputFormat, bool),
    ) -> Result<Self, RunError> {
        let mut table = empty_table(all)?;
        let mut entries = Vec::new();
        let next = records.len();
        for (record, input) in records.into_iter().zip(inputs) {
            entries.extend(record.entries);
            if let Some(names) = record.names {
                table.name_features(&names)?;
            }
            table.push(record.outcome, &input.labels, record.row.as_deref().unwrap_or(&[]))?;
        }
        let writer = match format {
            OutputFormat::Npz(compression) => {
                let (part, path) = ledger.part()?;
                Some(NpzWriter::resume(part, &path, compression, entries)?)
            }
            // The frames wait in an archive, which can go on after a kill where Parquet cannot.
            OutputFormat::Parquet if frames => {
                let (part, path) = ledger.part()?;
                Some(NpzWriter::resume(part, &path, Compression::Stored, entries)?)
            }
            OutputFormat::Parquet => None,
        };
        Ok(Self { partial: Some(Partial { ledger, writer, format }), table, next })
    }

    /// Only a table.
    pub fn in_memory(inputs: &[Input]) -> Result<Self, RunError> {
        Ok(Self { partial: None, table: empty_table(inputs)?, next: 0 })
    }

    /// What became of the recordings written so far.
    pub fn outcomes(&self) -> &[Outcome] {
        self.table.outcomes()
    }

    /// Writes the next recording.
    pub fn write(&mut self, input: &Input, mut finished: Finished) -> Result<Outcome, RunError> {
        let mut row = None;
        let mut names = None;
        if let Some((values, columns)) = finished.row.take() {
            let first = self.table.feature_names().is_empty();
            match self.table.name_features(&columns) {
                Ok(()) => {
                    row = Some(values);
                    names = first.then(|| columns.to_vec());
                }
                Err(TableError::Renamed { expected, actual, .. }) => {
                    finished.outcome.status = Status::Mismatch;
                    finished.outcome.reason = other_width(actual, expected);
                }
                Err(other) => return Err(other.into()),
            }
        }
        if let Some(partial) = &self.partial
            && partial.format == OutputFormat::Parquet
            && let Some(reason) = finished.arrays.iter().find_map(Member::too_long)
        {
            finished.outcome.status = Status::Unsupported;
            finished.outcome.reason = reason;
            finished.arrays.clear();
        }
        let outcome = finished.outcome;
        self.table.push(outcome.clone(), &input.labels, row.as_deref().unwrap_or(&[]))?;
        if let Some(Partial { ledger, writer, .. }) = &mut self.partial {
            let mut entries = Vec::new();
            if let Some(writer) = writer {
                for member in finished.arrays {
                    entries.push(member.write(writer)?);
                }
            }
            ledger.append(&Record { outcome: outcome.clone(), entries, row, names })?;
        }
        self.next += 1;
        Ok(outcome)
    }

    /// The table.
    pub fn into_table(self) -> Table {
        self.table
    }

    /// Completes the output and gives it its name; returns the table. In several files where it is
    /// partitioned.
    pub fn publish(
        self,
        provenance: &Provenance,
        by: Option<&PartitionBy<'_>>,
    ) -> Result<Table, RunError> {
        let Self { partial, table, .. } = self;
        if let Some(Partial { ledger, writer, format }) = partial {
            if let Some(by) = by {
                let archive = match writer {
                    Some(writer) => {
                        writer.finish()?;
                        Some(frames::archive(&ledger)?)
                    }
                    None => None,
                };
                by.write(ledger, archive, &table, provenance)?;
                return Ok(table);
            }
            match writer {
                Some(writer) if format == OutputFormat::Parquet => {
                    writer.finish()?;
                    let out = ledger.out().to_path_buf();
                    let made = Draft::create(&out).map_err(RunError::Folder)?;
                    let file = made.handle().map_err(RunError::Folder)?;
                    let mut archive = frames::archive(&ledger)?;
                    frames::write(&mut archive, (file, &out), &table, provenance)?;
                    ledger.publish_made(|| made.publish())?;
                    return Ok(table);
                }
                Some(mut writer) => {
                    layout::write_table(&mut writer, &table, provenance)?;
                    writer.finish()?;
                }
                None => {
                    let (part, path) = ledger.part()?;
                    parquet::write_over(part, &path, &table, provenance)?;
                }
            }
            ledger.publish()?;
        }
        Ok(table)
    }
}

/// Why a row does not fit.
pub(super) fn other_width(actual: usize, expected: usize) -> String {
    if actual == expected {
        return "gives other numbers than earlier recordings: it has another sample rate".into();
    }
    format!(
        "gives {actual} numbers, earlier recordings gave {expected}: it has another number of channels"
    )
}

/// A table with the label columns of the inputs; of all shards', since a shard may have none.
fn empty_table(inputs: &[Input]) -> Result<Table, TableError> {
    let columns = inputs.first().map(|i| i.labels.iter().map(|(c, _)| c.clone()).collect());
    Table::new(columns.unwrap_or_default())
}
