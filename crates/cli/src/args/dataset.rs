//! Labelled features.

use std::path::{Path, PathBuf};

use corsmal_files::identity;
use corsmal_models::dataset::{LabelSource, LabelledTable, MemberNames};
use corsmal_models::predictions::NO_TARGETS;
use serde_json::{Value, json};

use super::network::CLASSIFIER;
use crate::failure::Failure;

/// What --labels says for class folders.
const FOLDERS: &str = "folders";

/// Column of the classes that folders name.
const FOLDER_COLUMN: &str = "class";

/// Most members that a message says to be no labels.
const SHOWN: usize = 3;

/// How to read a file that `extract` did not write.
#[derive(clap::Args, Clone)]
pub struct MemberArgs {
    /// In an .npz from another program: the member with the features, rows x features. Its
    /// one-dimensional members with as many rows are label columns.
    #[arg(long, value_name = "MEMBER", default_value = "X")]
    x: String,
    /// In a file from another program: the member or column with the ids; by default one called id
    /// or ids that has another value in every row, else rows are numbered from 0.
    #[arg(long, value_name = "MEMBER")]
    ids: Option<String>,
}

impl MemberArgs {
    /// The names.
    pub fn names(&self) -> MemberNames {
        MemberNames { x: self.x.clone(), ids: self.ids.clone() }
    }

    /// Refuses names of members where there is no file of another program.
    pub fn refuse(&self) -> Result<(), Failure> {
        match (self.x.as_str(), &self.ids) {
            ("X", None) => Ok(()),
            _ => Err(Failure::new("--x and --ids name members of an .npz: recordings have none")),
        }
    }
}

/// Where labels come from.
#[derive(clap::Args, Clone)]
pub struct LabelArgs {
    /// Labels: a CSV whose column id or path names the recordings, or `folders` if each recording is
    /// in a folder named after its class.
    #[arg(long, value_name = "CSV|folders")]
    labels: Option<PathBuf>,
    /// Column of the label file that names the recordings by id, path or file name, such as `file`.
    #[arg(long, value_name = "COLUMN", requires = "labels")]
    id_column: Option<String>,
}

impl LabelArgs {
    /// The file of labels, if there is one.
    pub fn file(&self) -> Option<&Path> {
        self.labels.as_deref().filter(|path| *path != Path::new(FOLDERS))
    }

    /// The source; `None` where labels are columns of the features or predictions themselves.
    pub fn source(&self, target: Option<&str>) -> Result<Option<LabelSource>, Failure> {
        match &self.labels {
            None => Ok(None),
            Some(path) if path == Path::new(FOLDERS) => match &self.id_column {
                None => {
                    let column = target.unwrap_or(FOLDER_COLUMN).into();
                    Ok(Some(LabelSource::Folders { column }))
                }
                Some(_) => {
                    Err(Failure::new("--id-column needs a label file; --labels folders has none"))
                }
            },
            Some(path) if !path.exists() && is_like_folders(path) => Err(Failure::new(format!(
                "--labels {}: there is no such file; did you mean {FOLDERS}?",
                path.display()
            ))),
            Some(path) => {
                Ok(Some(LabelSource::File { path: path.clone(), key: self.id_column.clone() }))
            }
        }
    }

    /// Whether the classes are folders.
    pub fn folders(&self) -> bool {
        self.labels.as_deref() == Some(Path::new(FOLDERS))
    }
}

fn is_like_folders(path: &Path) -> bool {
    corsmal_names::closest(&path.to_string_lossy(), [FOLDERS]).is_some()
}

/// Labelled features, as `train` and `cross-validate` take them.
#[derive(clap::Args)]
pub struct DatasetArgs {
    /// Features: an .npz or .parquet of `extract` with summaries, or any .npz. With --net also
    /// recordings: a file, a folder or a manifest; or a folder of pictures.
    #[arg(value_name = "FEATURES", required_unless_present_any = ["features", "crops"])]
    table: Option<PathBuf>,
    /// The same as the positional argument.
    #[arg(long, value_name = "FILE", conflicts_with = "table")]
    features: Option<PathBuf>,
    /// A folder of pictures instead, such as those of `corsmal-feat crops`, for networks that take
    /// them. The labels come from its labels.csv unless --labels is given.
    #[arg(long, value_name = "DIR", requires = "net", conflicts_with_all = CLASSIFIER)]
    #[arg(conflicts_with_all = ["table", "features"])]
    pub crops: Option<PathBuf>,
    #[command(flatten)]
    pub members: MemberArgs,
    #[command(flatten)]
    labels: LabelArgs,
    /// Label column to learn; not needed if there is only one. `joint` is type and level together
    /// if there is no such column.
    #[arg(long, visible_alias = "y", value_name = "COLUMN")]
    target: Option<String>,
    /// Label column of groups that must not be split between training and test. Without --cv,
    /// a column called container or group is the default.
    #[arg(long, value_name = "COLUMN")]
    pub groups: Option<String>,
}

impl DatasetArgs {
    /// The feature file.
    pub fn path(&self) -> &Path {
        let given = [&self.table, &self.features, &self.crops];
        given.into_iter().flatten().next().map_or(Path::new(""), PathBuf::as_path)
    }

    /// The file of labels, if there is one.
    pub fn label_file(&self) -> Option<&Path> {
        self.labels.file()
    }

    /// All files that are read.
    pub fn files(&self) -> Vec<PathBuf> {
        let own = self.crops.as_ref().map(|folder| folder.join("labels.csv"));
        let given = [Some(self.path()), self.labels.file()].into_iter().flatten();
        given.map(Path::to_path_buf).chain(own).collect()
    }

    /// Reads features and labels, refuses what cannot be learned from, warns of what is odd. Gives
    /// the name of the column to learn, too.
    pub fn load(&self) -> Result<(LabelledTable, String), Failure> {
        let mut table = LabelledTable::read(self.path(), &self.members.names())?;
        let target = self.label(&mut table, None)?;
        table.check()?;
        for doubt in table.doubts() {
            eprintln!("warning: {}: {doubt}", self.path().display());
        }
        Ok((table, target))
    }

    /// Adds the labels to a table, and names the column to learn; of several, that of the name `usual`.
    pub fn label(&self, table: &mut LabelledTable, usual: Option<&str>) -> Result<String, Failure> {
        if let Some(source) = self.labels.source(self.target.as_deref())? {
            for column in table.add_labels(&source)? {
                eprintln!(
                    "warning: {}: its column {column} is replaced by that of --labels",
                    self.path().display()
                );
            }
        }
        if let Some(unmatched) = table.unmatched.take() {
            eprintln!("warning: {}: {unmatched}", self.path().display());
        }
        self.target(table, usual)
    }

    fn target(&self, table: &LabelledTable, usual: Option<&str>) -> Result<String, Failure> {
        if let Some(target) = &self.target {
            return Ok(target.clone());
        }
        if self.labels.folders() {
            return Ok(FOLDER_COLUMN.into());
        }
        let is_group =
            |name: &&str| !NO_TARGETS.contains(name) && self.groups.as_deref() != Some(*name);
        let columns = table.columns().iter().map(|(name, _)| name.as_str());
        let candidates: Vec<&str> = columns.filter(is_group).collect();
        match candidates.as_slice() {
            [only] => Ok((*only).into()),
            [] => {
                let unread = table.unread().iter().take(SHOWN);
                let unread = unread.map(|(name, why)| format!("; member {name:?} {why}"));
                Err(Failure::new(format!(
                    "{}: has no label column; --labels adds labels from a CSV or from class \
                     folders{}",
                    self.path().display(),
                    unread.collect::<String>()
                )))
            }
            several if several.iter().any(|name| Some(*name) == usual) => {
                Ok(usual.unwrap_or_default().into())
            }
            several => Err(Failure::new(format!(
                "{}: name the column to learn: --target is one of {}",
                self.path().display(),
                several.join(", ")
            ))),
        }
    }

    /// Whether labels were named.
    #[cfg_attr(not(feature = "nets"), expect(dead_code, reason = "for networks"))]
    pub fn has_labels(&self) -> bool {
        self.labels.labels.is_some()
    }

    /// Where the table came from, for a model's provenance.
    pub fn provenance(&self) -> Result<Value, Failure> {
        let file = |path: &Path| -> Result<Value, Failure> {
            let identity = identity::of_file(path)
                .map_err(|e| Failure::new(format!("{}: {e}", path.display())))?;
            Ok(json!({ "path": path.display().to_string(), "identity": identity }))
        };
        Ok(json!({
            "features": file(self.path())?,
            "labels": self.labels.file().map(file).transpose()?,
        }))
    }
}
