//! The members of our `.npz` files: their names, and the tables at the end (`docs/file-formats.md`).
//!
//! Frame-level arrays come first, in the order of the inputs, named by id. The members that cover
//! the whole run follow; their names begin with [`RESERVED`], which no id does.

use std::io::{self, Write};
use std::path::Path;

use serde::Serialize;
use thiserror::Error;

use crate::npy::{DType, Header};
use crate::npz::{Compression, NpzError, NpzFile, NpzWriter};
use crate::outcome::Outcome;
use crate::provenance::{LAYOUT_VERSION, Provenance};
use crate::table::{RESERVED, Table, TableError};

const IDS: &str = "__ids__";
/// Member with the statistics, `[rows, features]`.
pub const SUMMARY: &str = "__summary__";
const SUMMARY_NAMES: &str = "__summary_names__";
const LABELS: &str = "__labels__/";
/// Prefix of the arrays of frame times.
pub const TIMES: &str = "__times__/";
const OUTCOMES: &str = "__outcomes__";
const CONFIG: &str = "__config__";
const META: &str = "__meta__";

/// What can be wrong with an output that is read back.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum LayoutError {
    /// The archive or a member cannot be read.
    #[error(transparent)]
    Npz(#[from] NpzError),
    /// The members contradict each other.
    #[error("{path}: {source}")]
    Table {
        /// The output.
        path: std::path::PathBuf,
        /// How.
        source: TableError,
    },
    /// Written by a newer version of the tool.
    #[error(
        "{path}: layout version {found} is too new: this version reads up to {LAYOUT_VERSION}; update corsmal-feat"
    )]
    Version {
        /// The output.
        path: std::path::PathBuf,
        /// Its version.
        found: u32,
    },
}

/// Name of a frame-level array: `<id>` when a run has one frame-level feature (`feature` is
/// `None`), else `<id>/<feature>`. The choice must be the same for a whole run; then no two names
/// collide.
pub fn frames_name(id: &str, feature: Option<&str>) -> String {
    match feature {
        None => id.to_string(),
        Some(feature) => format!("{id}/{feature}"),
    }
}

/// Name of the array of frame times that belongs to [`frames_name`].
pub fn times_name(id: &str, feature: Option<&str>) -> String {
    format!("{TIMES}{}", frames_name(id, feature))
}

/// Whether a member is frame-level: an array of one input or its times.
pub fn is_frame_level(name: &str) -> bool {
    name.starts_with(TIMES) || !name.starts_with(RESERVED)
}

/// Appends the members that cover the whole run.
///
/// # Errors
/// [`NpzError`].
pub fn write_table(
    writer: &mut NpzWriter,
    table: &Table,
    provenance: &Provenance,
) -> Result<(), NpzError> {
    writer.strings(IDS, table.ids())?;
    if !table.feature_names().is_empty() {
        let values = table.values();
        let shape = [values.nrows(), values.ncols()];
        writer.floats(SUMMARY, &shape, values.as_slice().expect("a table is in standard order"))?;
        writer.strings(SUMMARY_NAMES, table.feature_names())?;
    }
    for (column, values) in table.labels() {
        writer.strings(&format!("{LABELS}{column}"), values)?;
    }
    // There may be very many, so their text is made twice rather than held.
    let mut length = Count(0);
    let write = |out: &mut dyn Write| -> io::Result<()> {
        let mut out = io::BufWriter::with_capacity(1 << 16, out);
        for outcome in table.outcomes() {
            serde_json::to_writer(&mut out, outcome)?;
            out.write_all(b"\n")?;
        }
        out.flush()
    };
    write(&mut length).map_err(|e| NpzError::io(Path::new(OUTCOMES), e))?;
    writer.array_with(OUTCOMES, &Header::new(DType::U8, &[length.0]), write)?;
    writer.text(CONFIG, &provenance.config)?;
    writer.text(META, &json_lines(std::slice::from_ref(provenance)))?;
    Ok(())
}

/// Counts bytes.
struct Count(usize);

impl Write for Count {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0 += bytes.len();
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Reads back what [`write_table`] wrote.
///
/// # Errors
/// [`LayoutError`].
pub fn read_table(npz: &mut NpzFile) -> Result<(Table, Provenance), LayoutError> {
    let provenance = read_provenance(npz)?;
    let ids = npz.strings(IDS)?;
    let (names, values) = if npz.contains(SUMMARY) {
        (npz.strings(SUMMARY_NAMES)?, npz.f32(SUMMARY)?.iter().copied().collect())
    } else {
        (Vec::new(), Vec::new())
    };
    let columns: Vec<String> =
        npz.names().iter().filter_map(|n| n.strip_prefix(LABELS)).map(str::to_owned).collect();
    let mut labels = Vec::new();
    for column in columns {
        let values = npz.strings(&format!("{LABELS}{column}"))?;
        labels.push((column, values));
    }
    let outcomes = parse_outcomes(&npz.text(OUTCOMES)?)
        .map_err(|e| NpzError::member(npz.path(), OUTCOMES, "JSON lines", e))?;
    let table = Table::from_parts(ids, names, values, labels, outcomes)
        .map_err(|source| LayoutError::Table { path: npz.path().into(), source })?;
    Ok((table, provenance))
}

/// Reads how an output was made, without its tables.
///
/// # Errors
/// [`LayoutError`].
pub fn read_provenance(npz: &mut NpzFile) -> Result<Provenance, LayoutError> {
    let mut provenance: Provenance = npz.json(META)?;
    if provenance.layout_version > LAYOUT_VERSION {
        let found = provenance.layout_version;
        return Err(LayoutError::Version { path: npz.path().into(), found });
    }
    provenance.config = npz.text(CONFIG)?;
    Ok(provenance)
}

/// Whether a file is one of our outputs, as opposed to anyone's `.npz`.
pub fn is_ours(npz: &NpzFile) -> bool {
    npz.contains(META)
}

/// How the members of an output are compressed.
///
/// # Errors
/// [`NpzError`] where it is none of ours.
pub fn compression(npz: &mut NpzFile) -> Result<Compression, NpzError> {
    Ok(npz.raw(META)?.0.compression)
}

/// One JSON document per line.
pub(crate) fn json_lines<T: Serialize>(items: &[T]) -> String {
    let mut text = String::new();
    for item in items {
        text.push_str(&serde_json::to_string(item).expect("plain structures serialise"));
        text.push('\n');
    }
    text
}

pub(crate) fn parse_outcomes(lines: &str) -> Result<Vec<Outcome>, serde_json::Error> {
    lines.lines().map(serde_json::from_str).collect()
}
