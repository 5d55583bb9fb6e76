//! An output in several files, by the values of a label.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};

use corsmal_files::npz::NpzFile;
use corsmal_files::parquet;
use corsmal_files::partition::{self, FILE, MOST, Partition};
use corsmal_files::provenance::Provenance;
use corsmal_files::table::Table;

use super::error::RunError;
use super::frames;
use crate::inputs::Input;
use crate::ledger::Ledger;

/// The label by whose values an output is partitioned, and the inputs that have them.
pub struct PartitionBy<'a> {
    label: &'a str,
    inputs: &'a [Input],
}

impl<'a> PartitionBy<'a> {
    /// Takes a label that `all` inputs have, of whom `inputs` are those of the run.
    ///
    /// # Errors
    /// [`RunError::Partition`]: there is no such label, or it has too many values.
    pub fn of(label: &'a str, all: &[Input], inputs: &'a [Input]) -> Result<Self, RunError> {
        let refuse = |why| RunError::Partition { label: label.into(), why };
        let known: Vec<&str> = all
            .first()
            .into_iter()
            .flat_map(|i| &i.labels)
            .map(|(name, _)| name.as_str())
            .collect();
        if !all.is_empty() && !known.contains(&label) {
            return Err(refuse(match known.is_empty() {
                true => "the inputs have no labels: columns of a manifest are labels".into(),
                false => format!("the labels of the inputs are {}", known.join(", ")),
            }));
        }
        let by = Self { label, inputs };
        let values: BTreeSet<String> = by.values().into_iter().collect();
        if values.len() > MOST {
            let why =
                format!("it has {} values, and each is a folder: at most {MOST}", values.len());
            return Err(refuse(why));
        }
        Ok(by)
    }

    /// The label.
    pub fn label(&self) -> &str {
        self.label
    }

    /// The value of each input.
    fn values(&self) -> Vec<String> {
        let value = |input: &Input| {
            let found = input.labels.iter().find(|(name, _)| name == self.label);
            found.map(|(_, value)| value.clone()).unwrap_or_default()
        };
        self.inputs.iter().map(value).collect()
    }

    /// Writes all parts into a folder beside the output, then gives that its name. `archive` holds the
    /// frames, where there are some.
    pub(super) fn write(
        &self,
        ledger: Ledger,
        mut archive: Option<NpzFile>,
        table: &Table,
        provenance: &Provenance,
    ) -> Result<(), RunError> {
        // The lock of the ledger keeps others away from both.
        let out = ledger.out().to_path_buf();
        let (made, replaced) = (beside(&out, ".parts"), beside(&out, ".replaced"));
        let io = |path: &Path| {
            let path = path.display().to_string();
            move |e: io::Error| RunError::Folder(io::Error::new(e.kind(), format!("{path}: {e}")))
        };
        for left in [&made, &replaced] {
            if left.exists() {
                fs::remove_dir_all(left).map_err(io(left))?;
            }
        }
        for Partition { part, table } in partition::split(table, self.label, &self.values())? {
            let folder = made.join(partition::folder(&part.label, &part.value));
            fs::create_dir_all(&folder).map_err(io(&folder))?;
            let path = folder.join(FILE);
            let file = File::create_new(&path).map_err(io(&path))?;
            let provenance = Provenance { part: Some(part), ..provenance.clone() };
            match &mut archive {
                Some(archive) => frames::write(archive, (file, &path), &table, &provenance)?,
                None => parquet::write_over(file, &path, &table, &provenance)?,
            }
            sync(&folder).map_err(io(&folder))?;
        }
        if !made.exists() {
            // Of no inputs there is no part.
            fs::create_dir(&made).map_err(io(&made))?;
        }
        sync(&made).map_err(io(&made))?;
        drop(archive);
        ledger.publish_made(|| {
            // No system call that all systems have replaces a folder: for a moment there is none.
            if out.exists() {
                fs::rename(&out, &replaced)?;
            }
            fs::rename(&made, &out)
        })?;
        if replaced.exists() {
            fs::remove_dir_all(&replaced).map_err(io(&replaced))?;
        }
        Ok(())
    }
}

fn beside(out: &Path, suffix: &str) -> PathBuf {
    let mut path = out.as_os_str().to_owned();
    path.push(suffix);
    path.into()
}

/// Makes the names in a folder survive a power cut.
#[cfg(unix)]
fn sync(folder: &Path) -> io::Result<()> {
    File::open(folder)?.sync_all()
}

#[cfg(not(unix))]
fn sync(_: &Path) -> io::Result<()> {
    Ok(())
}
