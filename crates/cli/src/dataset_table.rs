//! Feature files as one table: features, names, ids, label columns, configuration.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use corsmal_files::feature_file::{FeatureFile, FeatureTable};
use corsmal_files::identity;
use corsmal_files::layout;
use corsmal_files::npy::{Kind, NpyError};
use corsmal_files::npz::{NpzError, NpzFile};
use corsmal_files::outcome::Outcome;
use corsmal_files::provenance::Provenance;
use corsmal_files::table::Table;
use corsmal_models::labels::Labels;
use ndarray::{Array2, Ix2};
use serde_json::{Value, json};

use crate::failure::Failure;
use crate::label_file::LabelFile;

/// How to read an `.npz` that `extract` did not write.
#[derive(clap::Args, Clone)]
pub struct ForeignArgs {
    /// In an .npz of another program: the member with the features, rows x features. Its
    /// one-dimensional members of that many rows are label columns.
    #[arg(long, value_name = "MEMBER", default_value = "X")]
    x: String,
    /// In an .npz of another program: the member with the ids; else rows are numbered from 0.
    #[arg(long, value_name = "MEMBER")]
    ids: Option<String>,
}

/// Labelled features, as `train` and `cross-validate` take them.
#[derive(clap::Args)]
pub struct DatasetArgs {
    /// Features: an .npz or .parquet of `extract` with summaries, or any .npz.
    #[arg(long, value_name = "FILE")]
    features: PathBuf,
    #[command(flatten)]
    foreign: ForeignArgs,
    /// Labels: a CSV with a column id or path. Without it the label columns of the feature file
    /// are used.
    #[arg(long, value_name = "CSV")]
    labels: Option<PathBuf>,
    /// Label column to learn. `joint` is type and level together where there is no such column.
    #[arg(long, visible_alias = "y", value_name = "COLUMN")]
    pub target: String,
    /// Label column of groups that must not be split between training and test. A column called
    /// container or group is taken by itself where no --cv is given.
    #[arg(long, value_name = "COLUMN")]
    pub groups: Option<String>,
}

impl DatasetArgs {
    /// Reads features and labels, refuses what cannot be learned from, warns of what is odd.
    pub fn load(&self) -> Result<DatasetTable, Failure> {
        let mut table = DatasetTable::read(&self.features, &self.foreign)?;
        if let Some(labels) = &self.labels {
            table.add_labels(labels)?;
        }
        let place = self.features.display();
        if table.ids.is_empty() {
            return Err(Failure::new(format!("{place}: has no recordings with features")));
        }
        if let Some((row, feature)) = table.non_finite().first() {
            let (id, name) = (&table.ids[*row], table.feature_name(*feature));
            let (value, count) = (table.x[[*row, *feature]], table.non_finite().len());
            return Err(Failure::new(format!(
                "{place}: {id}: feature {name} is {value} ({count} rows are not finite)"
            )));
        }
        let constant = table.constant_features();
        if let Some(&first) = constant.first() {
            eprintln!(
                "warning: {place}: {} of {} features have one value in all rows, the first is {}",
                constant.len(),
                table.x.ncols(),
                table.feature_name(first)
            );
        }
        Ok(table)
    }

    /// Where the table came from, for a model's provenance.
    pub fn provenance(&self) -> Result<Value, Failure> {
        let file = |path: &Path| -> Result<Value, Failure> {
            let identity = identity::of_file(path)
                .map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
            Ok(json!({ "path": path.display().to_string(), "identity": identity }))
        };
        Ok(json!({
            "features": file(&self.features)?,
            "labels": self.labels.as_deref().map(file).transpose()?,
        }))
    }
}

/// A feature file in memory.
pub struct DatasetTable {
    /// the file
    pub path: PathBuf,
    /// `[rows, features]`
    pub x: Array2<f64>,
    /// name of each feature; empty when the file has none
    pub feature_names: Vec<String>,
    /// one per row, all different
    pub ids: Vec<String>,
    /// one per input of the extraction, failed ones included; empty for files of other programs
    pub outcomes: Vec<Outcome>,
    /// feature configuration; null for files of other programs
    pub config: Value,
    /// its hash; empty for files of other programs
    pub config_hash: String,
    columns: Vec<(String, Vec<String>)>,
}

impl DatasetTable {
    /// Reads an `.npz` or `.parquet` of `extract`, or an `.npz` of another program.
    pub fn read(path: &Path, foreign: &ForeignArgs) -> Result<Self, Failure> {
        match FeatureFile::open(path)? {
            FeatureFile::Npz(mut npz) if !layout::is_ours(&npz) => {
                Self::of_foreign(path, &mut npz, foreign)
            }
            mut ours => {
                let FeatureTable { table, provenance, .. } = ours.table()?;
                Self::of_extraction(path, &table, provenance)
            }
        }
    }

    /// The table of an extraction.
    pub fn of_extraction(
        path: &Path,
        table: &Table,
        provenance: Provenance,
    ) -> Result<Self, Failure> {
        if table.feature_names().is_empty() && !table.ids().is_empty() {
            return Err(Failure::new(format!(
                "{}: has frame-level features only; extract with a configuration that has a \
                 [summary], such as --preset esc26",
                path.display()
            )));
        }
        Ok(Self {
            path: path.into(),
            x: table.values().mapv(f64::from),
            feature_names: table.feature_names().to_vec(),
            ids: table.ids().to_vec(),
            outcomes: table.outcomes().to_vec(),
            config: serde_json::from_str(&provenance.config)?,
            config_hash: provenance.config_hash,
            columns: table.labels().map(|(name, c)| (name.to_string(), c.to_vec())).collect(),
        })
    }

    fn of_foreign(path: &Path, npz: &mut NpzFile, args: &ForeignArgs) -> Result<Self, Failure> {
        let fault = |text: String| Failure::new(format!("{}: {text}", path.display()));
        if !npz.contains(&args.x) {
            let members = npz.names().join(", ");
            return Err(fault(format!("no member {:?} (--x): there are {members}", args.x)));
        }
        let x = npz.f64(&args.x)?;
        let shape = x.shape().to_vec();
        let x = x.into_dimensionality::<Ix2>().map_err(|_| {
            fault(format!("member {:?} has shape {shape:?}, expected rows x features", args.x))
        })?;
        let mut columns = Vec::new();
        for name in npz.names().to_vec() {
            let header = match npz.header(&name) {
                // Objects and dates are of no use here, and nobody asked for them.
                Err(NpzError::Npy {
                    source: NpyError::DType { .. } | NpyError::Pickled, ..
                }) if args.ids.as_ref() != Some(&name) => {
                    continue;
                }
                header => header?,
            };
            if header.shape == [x.nrows() as u64] && header.dtype.kind != Kind::Complex {
                let values = match header.dtype.kind {
                    Kind::Text | Kind::Bytes => npz.strings(&name)?,
                    // With a point: 1.0 is no class.
                    Kind::Float => npz.f64(&name)?.iter().map(|v| format!("{v:?}")).collect(),
                    _ => npz.integers(&name)?.iter().map(i128::to_string).collect(),
                };
                columns.push((name, values));
            }
        }
        let ids = match &args.ids {
            None => (0..x.nrows()).map(|row| row.to_string()).collect(),
            Some(name) => match columns.iter().find(|(column, _)| column == name) {
                Some((_, ids)) => ids.clone(),
                None => {
                    return Err(fault(format!("no member {name:?} (--ids) with one id per row")));
                }
            },
        };
        let mut seen = HashSet::new();
        if let Some(twice) = ids.iter().find(|id| !seen.insert(id.as_str())) {
            return Err(fault(format!("id {twice:?} occurs twice")));
        }
        let names_fit = npz.contains("feature_names")
            && npz.header("feature_names")?.shape == [x.ncols() as u64];
        let feature_names = if names_fit { npz.strings("feature_names")? } else { Vec::new() };
        Ok(Self {
            path: path.into(),
            x: x.as_standard_layout().into_owned(),
            feature_names,
            ids,
            outcomes: Vec::new(),
            config: Value::Null,
            config_hash: String::new(),
            columns,
        })
    }

    /// Adds the columns of a label file; they hide columns of the same name.
    fn add_labels(&mut self, path: &Path) -> Result<(), Failure> {
        let pairs = |with_features: bool| -> Vec<(&str, &str)> {
            let wanted = self.outcomes.iter().filter(|o| o.status.has_features() == with_features);
            wanted.map(|o| (o.id.as_str(), o.path.as_str())).collect()
        };
        let recordings = if self.outcomes.is_empty() {
            self.ids.iter().map(|id| (id.as_str(), id.as_str())).collect()
        } else {
            pairs(true)
        };
        let place = self.path.display().to_string();
        let labels = LabelFile::read(path)?;
        let columns = labels.for_recordings(&recordings, &pairs(false), &place)?;
        self.columns.splice(0..0, columns);
        Ok(())
    }

    /// A label column as text, one value per row.
    pub fn column(&self, name: &str) -> Result<Vec<String>, Failure> {
        let find = |name: &str| self.columns.iter().find(|(column, _)| column == name);
        if let Some((_, values)) = find(name) {
            return Ok(values.clone());
        }
        if name == "joint"
            && let (Some((_, kind)), Some((_, level))) = (find("type"), find("level"))
        {
            return Ok(kind.iter().zip(level).map(|(t, l)| format!("{t}-{l}")).collect());
        }
        let known: Vec<&str> = self.columns.iter().map(|(name, _)| name.as_str()).collect();
        let known = if known.is_empty() { "none; see --labels".into() } else { known.join(", ") };
        let place = self.path.display();
        Err(Failure::new(format!("{place}: no label column {name:?}: there is {known}")))
    }

    /// The classes of a label column. Empty and decimal values are no labels.
    pub fn classes(&self, name: &str) -> Result<(Labels, Vec<usize>), Failure> {
        let values = self.column(name)?;
        let place = self.path.display();
        for (id, value) in self.ids.iter().zip(&values) {
            let why = if value.is_empty() {
                "is empty"
            } else if value.parse::<f64>().is_ok() && value.parse::<i128>().is_err() {
                "is a decimal number; classes are whole numbers or names"
            } else {
                continue;
            };
            return Err(Failure::new(format!("{place}: {id}: label {name} = {value:?} {why}")));
        }
        let (labels, classes) = Labels::of(&values);
        if labels.len() < 2 {
            let only = labels.names().join(", ");
            let text = format!("{place}: all rows have {name} = {only}; at least 2 classes needed");
            return Err(Failure::new(text));
        }
        Ok((labels, classes))
    }

    /// Name of a feature, or its number.
    pub fn feature_name(&self, feature: usize) -> String {
        self.feature_names.get(feature).cloned().unwrap_or_else(|| feature.to_string())
    }

    /// Rows with a value that is not finite, each with the first such feature.
    pub fn non_finite(&self) -> Vec<(usize, usize)> {
        let rows = self.x.outer_iter().enumerate();
        rows.filter_map(|(i, row)| row.iter().position(|v| !v.is_finite()).map(|f| (i, f)))
            .collect()
    }

    fn constant_features(&self) -> Vec<usize> {
        let columns = self.x.columns().into_iter().enumerate();
        columns.filter(|(_, c)| c.iter().all(|v| *v == c[0])).map(|(i, _)| i).collect()
    }
}
