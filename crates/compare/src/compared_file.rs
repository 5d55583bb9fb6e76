//! A file of features, whatever its format.

use std::path::Path;

use corsmal_files::feature_file::{FeatureFile, FeatureFileError};
use corsmal_files::layout;
use corsmal_files::npy::{Kind, NpyError, NpyFile};
use corsmal_files::npz::{NpzError, NpzFile};
use corsmal_files::parquet::{NumericTable, ParquetFile};
use corsmal_files::provenance::Provenance;
use corsmal_files::table::{RESERVED, Table};
use ndarray::{Array1, ArrayD};
use serde::Serialize;

use super::pairing::Identities;
use super::rows;
use super::texts::{self, TextColumn};

/// Name under which frame times are compared.
const TIMES: &str = "frame times";

/// An array that is there but not read.
#[derive(Debug, Clone, Serialize)]
pub struct Refused {
    /// Its name.
    pub array: String,
    /// Why.
    pub reason: String,
}

/// Whose an array of an output of ours is.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub(super) struct Owner {
    /// The recording's id.
    pub id: String,
    /// The feature.
    pub feature: String,
    /// Whether it has the times of the frames.
    pub times: bool,
}

impl Owner {
    /// What the array is compared as.
    pub(super) fn title(&self) -> &str {
        if self.times { TIMES } else { &self.feature }
    }
}

/// An array that can be loaded.
#[derive(Debug)]
pub(super) struct ArrayEntry {
    /// Name in the file.
    pub name: String,
    /// The recording and the feature, where the file is ours.
    pub ours: Option<Owner>,
    /// Element type as numpy writes it.
    pub dtype: String,
}

/// Frames in a Parquet file, or the times of these frames.
#[derive(Debug)]
struct Place {
    row: usize,
    feature: String,
    times: bool,
}

/// An open file.
#[derive(Debug)]
pub(super) struct ComparedFile {
    source: FeatureFile,
    arrays: Vec<ArrayEntry>,
    /// Where each of them lies in a Parquet file.
    places: Vec<Place>,
    table: Option<NumericTable>,
    texts: Vec<TextColumn>,
    /// Ids of the rows of arrays, in an archive of another program.
    row_ids: Option<Vec<String>>,
    /// What is known of the contents of recordings, by id.
    identities: Identities,
    provenance: Option<Provenance>,
    refused: Vec<Refused>,
}

impl ComparedFile {
    /// Opens a file by its content and lists what it holds.
    pub(super) fn open(path: &Path) -> Result<Self, FeatureFileError> {
        match FeatureFile::open(path)? {
            FeatureFile::Npz(npz) => Self::npz(npz),
            FeatureFile::Npy(npy) => Ok(Self::npy(npy)),
            FeatureFile::Parquet(parquet) => Self::parquet(parquet),
        }
    }

    fn npz(mut npz: NpzFile) -> Result<Self, FeatureFileError> {
        let (mut table, mut provenance, mut features) = (None, None, Vec::new());
        let (mut texts, mut identities) = (Vec::new(), Identities::default());
        if layout::is_ours(&npz) {
            let (found, made) = layout::read_table(&mut npz)?;
            features = made.features();
            texts = texts::of_table(&found);
            identities = Identities::new(found.outcomes());
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
                if provenance.is_none() {
                    match npz.texts(&name) {
                        Ok(values) => {
                            let shape = header.shape.clone();
                            texts.push(TextColumn { name, ids: None, shape, values });
                        }
                        Err(error) => {
                            refused.push(Refused { array: name, reason: error.to_string() });
                        }
                    }
                }
                continue;
            }
            let ours = provenance.as_ref().and_then(|_| owner(&name, &features));
            arrays.push(ArrayEntry { name, ours, dtype: header.dtype.to_string() });
        }
        let row_ids = if provenance.is_none() { rows::ids(&mut npz) } else { None };
        Ok(Self {
            source: FeatureFile::Npz(npz),
            arrays,
            places: vec![],
            table,
            texts,
            row_ids,
            identities,
            provenance,
            refused,
        })
    }

    fn npy(npy: NpyFile) -> Self {
        let name = npy.path().file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let dtype = npy.header().dtype.to_string();
        let arrays = vec![ArrayEntry { name, ours: None, dtype }];
        let source = FeatureFile::Npy(npy);
        Self {
            source,
            arrays,
            places: vec![],
            table: None,
            texts: vec![],
            row_ids: None,
            identities: Identities::default(),
            provenance: None,
            refused: vec![],
        }
    }

    fn parquet(parquet: ParquetFile) -> Result<Self, FeatureFileError> {
        let features = if parquet.is_ours() { parquet.frame_features() } else { Vec::new() };
        if !features.is_empty() {
            return Self::parquet_frames(parquet, &features);
        }
        let table = parquet.numbers()?;
        let reason = "a nested column, or neither numbers nor text";
        let refused =
            table.skipped.iter().map(|name| Refused { array: name.clone(), reason: reason.into() });
        let refused = refused.collect();
        // Tables of other tools have no provenance.
        let provenance = parquet.provenance().ok();
        let (texts, identities) = match provenance {
            Some(_) => {
                let found = parquet.table()?.0;
                (texts::of_table(&found), Identities::new(found.outcomes()))
            }
            None => {
                let column = |(name, values): &(String, Vec<String>)| TextColumn {
                    name: name.clone(),
                    ids: table.ids.clone(),
                    shape: vec![values.len() as u64],
                    values: values.clone(),
                };
                (table.texts.iter().map(column).collect(), Identities::default())
            }
        };
        let source = FeatureFile::Parquet(parquet);
        let (arrays, places) = (vec![], vec![]);
        let table = Some(table);
        let row_ids = None;
        Ok(Self { source, arrays, places, table, texts, row_ids, identities, provenance, refused })
    }

    /// The frames of an output of ours, named as in an `.npz`.
    fn parquet_frames(parquet: ParquetFile, features: &[String]) -> Result<Self, FeatureFileError> {
        let (found, made) = parquet.table()?;
        let several = features.len() > 1;
        let (mut arrays, mut places) = (Vec::new(), Vec::new());
        for (row, id) in found.ids().iter().enumerate() {
            for feature in features {
                let named = several.then_some(feature.as_str());
                let frames = layout::frames_name(id, named);
                let times = layout::times_name(id, named);
                for (name, dtype, times) in [(frames, "<f4", false), (times, "<f8", true)] {
                    let ours = Owner { id: id.clone(), feature: feature.clone(), times };
                    arrays.push(ArrayEntry { name, ours: Some(ours), dtype: dtype.into() });
                    places.push(Place { row, feature: feature.clone(), times });
                }
            }
        }
        let (texts, identities) = (texts::of_table(&found), Identities::new(found.outcomes()));
        let source = FeatureFile::Parquet(parquet);
        let (table, row_ids, provenance, refused) = (None, None, Some(made), vec![]);
        Ok(Self { source, arrays, places, table, texts, row_ids, identities, provenance, refused })
    }

    pub(super) fn path(&self) -> &Path {
        self.source.path()
    }

    /// The format in a word.
    pub(super) fn format(&self) -> &'static str {
        match self.source {
            FeatureFile::Npz(_) => "npz",
            FeatureFile::Npy(_) => "npy",
            FeatureFile::Parquet(_) => "parquet",
        }
    }

    pub(super) fn arrays(&self) -> &[ArrayEntry] {
        &self.arrays
    }

    /// The summary table, or the columns of a Parquet file.
    pub(super) fn table(&self) -> Option<&NumericTable> {
        self.table.as_ref()
    }

    /// Labels and statuses of an output of ours, texts of another file.
    pub(super) fn texts(&self) -> &[TextColumn] {
        &self.texts
    }

    /// Makes columns of whole numbers texts where those of the other file are texts, as doubles would
    /// round them.
    pub(super) fn spell_out(&mut self, other: &Self) {
        if let Some(table) = &mut self.table {
            self.texts.extend(texts::spelled_out(table, &other.texts));
        }
    }

    /// Whether it is a table of texts only, of which the other has some.
    pub(super) fn shares_texts_only(&self, other: &Self) -> bool {
        let is_bare = |file: &Self| file.table.as_ref().is_some_and(|table| table.names.is_empty());
        let shares = |text: &TextColumn| other.texts.iter().any(|theirs| theirs.name == text.name);
        is_bare(self) && is_bare(other) && self.texts.iter().any(shares)
    }

    /// Ids of the rows of arrays, in an archive of another program.
    pub(super) fn row_ids(&self) -> Option<&[String]> {
        self.row_ids.as_deref()
    }

    /// Names the rows of its texts by the ids.
    pub(super) fn name_rows(&mut self) {
        let Some(ids) = &self.row_ids else { return };
        let of_rows = |text: &&mut TextColumn| text.shape == [ids.len() as u64];
        self.texts.iter_mut().filter(of_rows).for_each(|text| text.ids = Some(ids.clone()));
    }

    /// The values of an array of 64-bit integers; `None` of any other.
    pub(super) fn integers(&mut self, index: usize) -> Option<ArrayD<i128>> {
        let entry = &self.arrays[index];
        if !(entry.dtype.ends_with("i8") || entry.dtype.ends_with("u8")) {
            return None;
        }
        match &mut self.source {
            FeatureFile::Npz(npz) => npz.integers(&entry.name).ok(),
            FeatureFile::Npy(npy) => npy.integers().ok(),
            FeatureFile::Parquet(_) => None,
        }
    }

    pub(super) fn provenance(&self) -> Option<&Provenance> {
        self.provenance.as_ref()
    }

    /// What is known of the contents of the recordings.
    pub(super) fn identities(&self) -> &Identities {
        &self.identities
    }

    /// Arrays that are there but cannot be read.
    pub(super) fn refused(&self) -> &[Refused] {
        &self.refused
    }

    /// The values of an array; complex ones with a first axis of real and imaginary parts.
    pub(super) fn load(&mut self, index: usize) -> Result<ArrayD<f64>, FeatureFileError> {
        match &mut self.source {
            FeatureFile::Npz(npz) => Ok(npz.components(&self.arrays[index].name)?),
            FeatureFile::Npy(npy) => npy
                .components()
                .map_err(|source| FeatureFileError::Npy { path: npy.path().into(), source }),
            FeatureFile::Parquet(parquet) => {
                let Place { row, feature, times } = &self.places[index];
                Ok(match times {
                    true => Array1::from(parquet.frame_times(*row, feature)?).into_dyn(),
                    false => parquet.frame_values(*row, feature)?.mapv(f64::from),
                })
            }
        }
    }

    /// Recordings of an output of ours for a message; `None` for files of other programs.
    pub(super) fn recordings(&self) -> Option<Vec<&String>> {
        self.provenance.as_ref()?;
        let of_arrays = self.arrays.iter().filter_map(|e| e.ours.as_ref()).map(|owner| &owner.id);
        let of_table = self.table.iter().filter_map(|table| table.ids.as_ref()).flatten();
        let mut ids: Vec<&String> = of_arrays.chain(of_table).collect();
        ids.sort_unstable();
        ids.dedup();
        Some(ids)
    }

    /// The same, or the ids of a table of another program.
    pub(super) fn rows_or_recordings(&self) -> Option<Vec<&String>> {
        self.recordings().or_else(|| Some(self.table.as_ref()?.ids.as_ref()?.iter().collect()))
    }

    /// Names for a message.
    pub(super) fn listing(&self) -> String {
        let arrays = self.arrays.iter().filter(|e| !e.name.starts_with(RESERVED)).map(|e| &e.name);
        let columns = self.table.iter().flat_map(|table| &table.names);
        shown(&arrays.chain(columns).collect::<Vec<_>>())
    }
}

/// Some of the names, and how many more there are.
pub(super) fn shown(names: &[&String]) -> String {
    const SHOWN: usize = 8;
    let more = names.len().saturating_sub(SHOWN);
    let first: Vec<String> = names.iter().take(SHOWN).map(|n| format!("{n:?}")).collect();
    match (names.len(), more) {
        (0, _) => "none".into(),
        (_, 0) => first.join(", "),
        _ => format!("{} and {more} more", first.join(", ")),
    }
}

/// Recording and feature of a frame-level member of an output of ours.
fn owner(name: &str, features: &[String]) -> Option<Owner> {
    let (name, times) = match name.strip_prefix(layout::TIMES) {
        Some(rest) => (rest, true),
        None if name.starts_with(RESERVED) => return None,
        None => (name, false),
    };
    let (id, feature) = match features {
        [only] => (name, only.as_str()),
        _ => name.rsplit_once('/')?,
    };
    Some(Owner { id: id.into(), feature: feature.into(), times })
}

fn columns(table: &Table) -> NumericTable {
    NumericTable {
        ids: Some(table.ids().to_vec()),
        names: table.feature_names().to_vec(),
        types: vec!["float32"; table.feature_names().len()],
        values: table.values().mapv(f64::from),
        texts: Vec::new(),
        skipped: Vec::new(),
    }
}
