//! Which recordings of an archive the labels in it belong to.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use corsmal_files::quote::quoted;

use super::cells::{MAX_CELLS, MAX_LABEL_BYTES};
use super::member::Member;

/// A recording with what stands beside it.
pub(super) struct Entry {
    pub(super) member: Member,
    /// Name in the archive.
    pub(super) name: PathBuf,
    pub(super) labels: Vec<(String, String)>,
}

/// A member with labels: its name, and what it says.
pub(super) type Labels = (PathBuf, Vec<(String, String)>);

/// Gives recordings the labels beside them. `x.json` belongs to all recordings called `x`, and to
/// `x.left.wav`: up to the first dot they are one, as WebDataset has it. `x.1.json` belongs to `x.1.wav`
/// where there is one, else to `x.wav`, and never to `x.2.wav`.
///
/// # Errors
/// A label that a recording is given twice; more labels than memory should hold.
pub(super) fn join(recordings: &mut [Entry], labels: Vec<Labels>) -> Result<(), String> {
    let mut alike: HashMap<PathBuf, Vec<usize>> = HashMap::new();
    let mut samples: HashMap<PathBuf, Vec<usize>> = HashMap::new();
    for (i, recording) in recordings.iter().enumerate() {
        alike.entry(stem(&recording.name)).or_default().push(i);
        samples.entry(sample(&recording.name)).or_default().push(i);
    }
    let (mut cells, mut bytes) = (0, 0);
    for (name, fields) in labels {
        let (stem, sample) = (stem(&name), sample(&name));
        let of = match stem == sample {
            true => samples.get(&sample),
            false => alike.get(&stem).or_else(|| alike.get(&sample)),
        };
        let of = of.map(Vec::as_slice).unwrap_or_default();
        // One member may label any number of recordings.
        cells += of.len().saturating_mul(fields.len());
        if cells > MAX_CELLS {
            return Err(format!("its recordings have more than {MAX_CELLS} labels"));
        }
        let length: usize = fields.iter().map(|(column, value)| column.len() + value.len()).sum();
        bytes += of.len().saturating_mul(length);
        if bytes > MAX_LABEL_BYTES {
            let name = quoted(&name.to_string_lossy());
            return Err(format!(
                "the labels of all its recordings exceed {MAX_LABEL_BYTES} bytes; {name} adds {length} to each of {} \
                 recordings",
                of.len()
            ));
        }
        for &i in of {
            recordings[i].labels.extend_from_slice(&fields);
        }
    }
    for recording in recordings {
        let mut columns: Vec<&str> = recording.labels.iter().map(|(c, _)| c.as_str()).collect();
        columns.sort_unstable();
        if let Some(twice) = columns.windows(2).find(|pair| pair[0] == pair[1]) {
            let name = quoted(&recording.name.to_string_lossy());
            return Err(format!("the label {} of {name} is given twice", quoted(twice[0])));
        }
    }
    Ok(())
}

/// A name without its last extension.
fn stem(name: &Path) -> PathBuf {
    name.with_extension("")
}

/// A name up to its first dot: what the members of a sample have in common.
fn sample(name: &Path) -> PathBuf {
    let file = name.file_name().map(|file| file.to_string_lossy().into_owned()).unwrap_or_default();
    name.with_file_name(file.split('.').next().unwrap_or_default())
}
