//! An output in several files, by the values of a label.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::io;
use std::path::Path;

use corsmal_files::draft;
use corsmal_files::npz::NpzFile;
use corsmal_files::parquet;
use corsmal_files::partition::{self, FILE, MOST, Partition};
use corsmal_files::provenance::Provenance;
use corsmal_files::quote::quoted;
use corsmal_files::table::Table;
use tempfile::TempDir;

use super::error::RunError;
use super::frames;
use crate::inputs::Input;
use crate::ledger::Ledger;

/// Longest name of a folder in bytes.
const LONGEST: usize = 255;

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
        let count = values(label, inputs).into_iter().collect::<BTreeSet<_>>().len();
        if count > MOST {
            let why = format!("it has {count} values, and each is a folder: at most {MOST}");
            return Err(refuse(why));
        }
        // Shards end up in one folder: their values are compared, too.
        let values: BTreeSet<String> = values(label, all).into_iter().collect();
        check_values(label, &values).map_err(refuse)?;
        Ok(by)
    }

    /// The label.
    pub fn label(&self) -> &str {
        self.label
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
        let out = ledger.out().to_path_buf();
        let io = |path: &Path| {
            let path = path.display().to_string();
            move |e: io::Error| RunError::Folder(io::Error::new(e.kind(), format!("{path}: {e}")))
        };
        // Removed when it is dropped, with the output that this one replaces.
        let beside = self.beside(&out).map_err(io(&out))?;
        let (made, replaced) = (beside.path().join("made"), beside.path().join("replaced"));
        fs::create_dir(&made).map_err(io(&made))?;
        for Partition { part, table } in
            partition::split(table, self.label, &values(self.label, self.inputs))?
        {
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
        sync(&made).map_err(io(&made))?;
        drop(archive);
        ledger
            .publish_made(|| {
                // No call that all systems have replaces a folder: for a moment there is none.
                if out.exists() {
                    // It may be another one than when the run began.
                    if !is_ours(&out) {
                        return Err(io::Error::other(
                            "exists by now and is not a partitioned output",
                        ));
                    }
                    fs::rename(&out, &replaced)?;
                }
                fs::rename(&made, &out).inspect_err(|_| {
                    let _ = fs::rename(&replaced, &out);
                })
            })
            .map_err(RunError::from)
    }

    /// A hidden folder beside the output, without what a killed run has left of the same kind: the lock of
    /// the ledger keeps other runs of this output away.
    fn beside(&self, out: &Path) -> io::Result<TempDir> {
        let prefix = draft::hidden(out, ".partitions-");
        for entry in draft::folder(out).read_dir()?.flatten() {
            let name = entry.file_name();
            let random = name.as_encoded_bytes().strip_prefix(prefix.as_encoded_bytes());
            if random.is_some_and(|r| r.len() == 6 && r.iter().all(u8::is_ascii_alphanumeric)) {
                fs::remove_dir_all(entry.path())?;
            }
        }
        tempfile::Builder::new().prefix(&prefix).tempdir_in(draft::folder(out))
    }
}

/// Whether a partitioned output may be written in place of what is there: nothing, or another one.
pub fn is_ours(out: &Path) -> bool {
    let is_empty = out.is_dir() && out.read_dir().is_ok_and(|mut all| all.next().is_none());
    !out.exists() || is_empty || partition::is_partitioned(out)
}

/// The value of each input.
fn values(label: &str, inputs: &[Input]) -> Vec<String> {
    let value = |input: &Input| {
        let found = input.labels.iter().find(|(name, _)| name == label);
        found.map(|(_, value)| value.clone()).unwrap_or_default()
    };
    inputs.iter().map(value).collect()
}

/// Refuses values whose folders some systems or readers do not tell apart.
fn check_values(label: &str, values: &BTreeSet<String>) -> Result<(), String> {
    let mut folders = BTreeMap::new();
    for value in values {
        let folder = partition::folder(label, value);
        if folder.len() > LONGEST {
            let value = quoted(value);
            return Err(format!("the value {value} is too long for the name of a folder"));
        }
        // Some systems tell no capital letters apart.
        if let Some(other) = folders.insert(folder.to_lowercase(), value) {
            let (a, b) = (quoted(other), quoted(value));
            let case = match other.to_lowercase() == value.to_lowercase() {
                true => " on systems that ignore case",
                false => "",
            };
            return Err(format!("the values {a} and {b} would share a folder{case}"));
        }
    }
    // Where all values are whole numbers, or all are numbers, readers of such folders make them numbers.
    let written: Vec<&String> = values.iter().filter(|value| !value.is_empty()).collect();
    let alike = alike(&written, |value| value.parse::<i128>().ok())
        .or_else(|| alike(&written, |value| Some((value.parse::<f64>().ok()? + 0.0).to_bits())));
    if let Some(Some((a, b))) = alike {
        let (a, b) = (quoted(a), quoted(b));
        return Err(format!(
            "the values {a} and {b} would be read as the same number: write both the same way"
        ));
    }
    Ok(())
}

/// Two values that `read` makes the same, if there are such; `None` where it cannot read all of them.
fn alike<'v, N: Ord>(
    values: &[&'v String],
    read: impl Fn(&str) -> Option<N>,
) -> Option<Option<(&'v str, &'v str)>> {
    let mut known = BTreeMap::new();
    let mut found = None;
    for value in values {
        let other = known.insert(read(value)?, value.as_str());
        found = found.or(other.map(|other| (other, value.as_str())));
    }
    Some(found)
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inputs::InputSource;

    fn refused(values: &[&str]) -> String {
        let values = values.iter().map(|value| (*value).to_owned()).collect();
        check_values("take", &values).err().unwrap_or_default()
    }

    #[test]
    fn one_number_in_two_spellings_is_refused() {
        for [a, b] in [
            ["1", "01"],
            ["1", "1.0"],
            ["-2", "-2.00"],
            ["0.5", "5e-1"],
            ["0.0", "-0"],
            ["1", "+1"],
            ["10000000000000000", "1e16"],
        ] {
            assert!(refused(&[a, b, "", "7"]).contains("same number"), "{a} {b}");
            // Beside a word, all are read as text.
            assert_eq!(refused(&[a, b, "rice"]), "", "{a} {b}");
        }
        assert_eq!(refused(&["9007199254740993", "9007199254740992", ""]), "");
        // Beside a fraction, all are read in double precision.
        for other in ["0.1", "NaN", "inf"] {
            let why = refused(&["9007199254740993", "9007199254740992", other]);
            assert!(why.contains("same number"), "{other}: {why}");
        }
        assert!(refused(&["Rice", "rice"]).ends_with("share a folder on systems that ignore case"));
    }

    #[test]
    fn values_of_other_shards_count() {
        let input = |value: &str| Input {
            id: value.into(),
            source: InputSource::File(value.into()),
            start: None,
            end: None,
            labels: vec![("take".into(), value.into())],
        };
        let all = [input("1"), input("01")];
        let why = PartitionBy::of("take", &all, &all[..1]).err().map(|e| e.to_string());
        assert!(why.as_ref().is_some_and(|why| why.contains("same number")), "{why:?}");
        assert!(PartitionBy::of("take", &all[..1], &all[..1]).is_ok());
    }
}
