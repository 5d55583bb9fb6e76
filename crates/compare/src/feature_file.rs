//! A file of features, whatever its format.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::{Path, PathBuf};

use ndarray::ArrayD;
use serde_json::Value;

use super::CompareError;
use super::comparison::Refused;
use corsmal_files::layout;
use corsmal_files::npy::{self, Header, Kind, NpyError};
use corsmal_files::npz::{NpzError, NpzFile};
use corsmal_files::parquet::{self, Columns};
use corsmal_files::provenance::Provenance;
use corsmal_files::table::{RESERVED, Table};

/// Name under which frame times are compared.
const TIMES: &str = "frame times";

/// An array that can be loaded.
#[derive(Debug)]
pub(super) struct ArrayEntry {
    /// Name in the file.
    pub name: String,
    /// The recording and the feature, where the file is ours.
    pub ours: Option<(String, String)>,
    /// Element type as numpy writes it.
    pub dtype: String,
}

#[derive(Debug)]
enum Source {
    Npz(NpzFile),
    Npy(Header),
    Parquet,
}

/// An open file.
#[derive(Debug)]
pub(super) struct FeatureFile {
    path: PathBuf,
    source: Source,
    arrays: Vec<ArrayEntry>,
    table: Option<Columns>,
    provenance: Option<Provenance>,
    refused: Vec<Refused>,
}

impl FeatureFile {
    /// Opens a file by its content and lists what it holds.
    pub(super) fn open(path: &Path) -> Result<Self, CompareError> {
        let io = |source| CompareError::Io { path: path.into(), source };
        let mut start = Vec::new();
        File::open(path).and_then(|f| f.take(6).read_to_end(&mut start)).map_err(io)?;
        match start.as_slice() {
            [b'P', b'K', 3 | 5, 4 | 6, ..] => Self::npz(path),
            [b'P', b'A', b'R', b'1', ..] => Self::parquet(path),
            b"\x93NUMPY" => Self::npy(path),
            _ => Err(CompareError::Format { path: path.into() }),
        }
    }

    fn npz(path: &Path) -> Result<Self, CompareError> {
        let mut npz = NpzFile::open(path)?;
        let (mut table, mut provenance, mut features) = (None, None, Vec::new());
        if layout::is_ours(&npz) {
            let (found, made) = layout::read_table(&mut npz)?;
            features = feature_names(&made);
            table = (!found.feature_names().is_empty()).then(|| columns(&found));
            provenance = Some(made);
        }
        let (mut arrays, mut refused) = (Vec::new(), Vec::new());
        for name in npz.names().to_vec() {
            let header = match npz.header(&name) {
                Ok(header) => header,
                Err(NpzError::Npy { source, .. })
                    if matches!(source, NpyError::Pickled | NpyError::DType { .. }) =>
                {
                    refused.push(Refused { array: name, reason: source.to_string() });
                    continue;
                }
                Err(error) => return Err(error.into()),
            };
            if matches!(header.dtype.kind, Kind::Text | Kind::Bytes) {
                continue;
            }
            let ours = provenance.as_ref().and_then(|_| owner(&name, &features));
            arrays.push(ArrayEntry { name, ours, dtype: header.dtype.to_string() });
        }
        let source = Source::Npz(npz);
        Ok(Self { path: path.into(), source, arrays, table, provenance, refused })
    }

    fn npy(path: &Path) -> Result<Self, CompareError> {
        let wrong = |source| CompareError::Npy { path: path.into(), source };
        let file = File::open(path).map_err(|e| wrong(e.into()))?;
        let length = file.metadata().map_err(|e| wrong(e.into()))?.len();
        let (header, start) = Header::read(&mut BufReader::new(file)).map_err(wrong)?;
        let data = header.data_len().map_err(wrong)?;
        if start + data != length {
            let expected = format!("{data} bytes of data for shape {:?}", header.shape);
            let actual = length.saturating_sub(start).to_string();
            return Err(wrong(NpyError::Malformed { offset: start, expected, actual }));
        }
        let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let arrays = vec![ArrayEntry { name, ours: None, dtype: header.dtype.to_string() }];
        let (path, source) = (path.into(), Source::Npy(header));
        Ok(Self { path, source, arrays, table: None, provenance: None, refused: vec![] })
    }

    fn parquet(path: &Path) -> Result<Self, CompareError> {
        let table = parquet::columns(path)?;
        let reason = "a nested column, or not of numbers";
        let refused =
            table.skipped.iter().map(|name| Refused { array: name.clone(), reason: reason.into() });
        let refused = refused.collect();
        // Tables of other tools have no provenance.
        let provenance = parquet::read_provenance(path).ok();
        Ok(Self {
            path: path.into(),
            source: Source::Parquet,
            arrays: vec![],
            table: Some(table),
            provenance,
            refused,
        })
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// The format in a word.
    pub(super) fn format(&self) -> &'static str {
        match self.source {
            Source::Npz(_) => "npz",
            Source::Npy(_) => "npy",
            Source::Parquet => "parquet",
        }
    }

    pub(super) fn arrays(&self) -> &[ArrayEntry] {
        &self.arrays
    }

    /// The summary table, or the columns of a Parquet file.
    pub(super) fn table(&self) -> Option<&Columns> {
        self.table.as_ref()
    }

    pub(super) fn provenance(&self) -> Option<&Provenance> {
        self.provenance.as_ref()
    }

    /// Arrays that are there but cannot be read as numbers, text aside.
    pub(super) fn refused(&self) -> &[Refused] {
        &self.refused
    }

    /// The values of an array; complex ones with a first axis of real and imaginary parts.
    pub(super) fn load(&mut self, index: usize) -> Result<ArrayD<f64>, CompareError> {
        match &mut self.source {
            Source::Npz(npz) => Ok(npz.components(&self.arrays[index].name)?),
            Source::Npy(header) => {
                let wrong = |source| CompareError::Npy { path: self.path.clone(), source };
                let file = File::open(&self.path).map_err(|e| wrong(e.into()))?;
                let mut body = BufReader::new(file);
                Header::read(&mut body).map_err(wrong)?;
                npy::components(&mut body, header).map_err(wrong)
            }
            Source::Parquet => unreachable!("a Parquet file lists no arrays"),
        }
    }

    /// Names for a message.
    pub(super) fn listing(&self) -> String {
        const SHOWN: usize = 8;
        let arrays = self.arrays.iter().filter(|e| !e.name.starts_with(RESERVED)).map(|e| &e.name);
        let columns = self.table.iter().flat_map(|table| &table.names);
        let names: Vec<&String> = arrays.chain(columns).collect();
        let more = names.len().saturating_sub(SHOWN);
        let shown: Vec<String> = names.iter().take(SHOWN).map(|n| format!("{n:?}")).collect();
        match (names.len(), more) {
            (0, _) => "none".into(),
            (_, 0) => shown.join(", "),
            _ => format!("{} and {more} more", shown.join(", ")),
        }
    }
}

/// Features of a configuration that were written frame by frame.
fn feature_names(made: &Provenance) -> Vec<String> {
    let config: Value = serde_json::from_str(&made.config).unwrap_or_default();
    config["features"].as_object().map(|f| f.keys().cloned().collect()).unwrap_or_default()
}

/// Recording and feature of a frame-level member of an output of ours.
fn owner(name: &str, features: &[String]) -> Option<(String, String)> {
    if let Some(rest) = name.strip_prefix(layout::TIMES) {
        return Some((rest.into(), TIMES.into()));
    }
    if name.starts_with(RESERVED) {
        return None;
    }
    match features {
        [only] => Some((name.into(), only.clone())),
        _ => name.rsplit_once('/').map(|(id, feature)| (id.into(), feature.into())),
    }
}

fn columns(table: &Table) -> Columns {
    Columns {
        ids: Some(table.ids().to_vec()),
        names: table.feature_names().to_vec(),
        values: table.values().mapv(f64::from),
        skipped: Vec::new(),
    }
}
