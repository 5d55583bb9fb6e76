//! Finding the recordings of a data set on disk.
//!
//! Two layouts are known. The tree of 2020: `train/<container>/audio/s0_fi1_fu2_b0_l1_audio.wav`
//! and, for tests, `test/<container>/audio/0000_audio.wav`; folders may be nested otherwise as long
//! as one of them is the container's number. The flat release of 2021: `train/audio/000000.wav`,
//! where the annotation file tells what a number is.

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use super::annotation::{Annotation, Annotations};
use super::container::{Container, Subset};
use super::index::Index;
use super::name::SequenceName;
use super::oddity::Oddity;
use super::recording::Recording;
use crate::error::{CcmError, Result};
use crate::submission::RowKey;

/// Digits that the numbers of the flat release have.
const FLAT_DIGITS: usize = 6;

/// Folders deeper than this are not searched.
const MAX_DEPTH: usize = 6;

/// A data set on disk.
#[derive(Debug)]
pub struct DataSet {
    /// Its folder.
    pub root: PathBuf,
    /// The recordings, by container and sequence number, unexplained ones last.
    pub recordings: Vec<Recording>,
    /// The annotation files that were found.
    pub annotations: Vec<Annotations>,
    /// File with the manual action annotations.
    pub actions: Option<PathBuf>,
    /// Made by `corsmal-feat synth`.
    pub synthetic: bool,
    /// Files that could not be placed.
    pub odd: Vec<Oddity>,
    /// Annotation files that say different things about one recording.
    pub contradictions: Vec<Oddity>,
}

impl DataSet {
    /// Finds recordings and annotations below `root`.
    ///
    /// # Errors
    /// [`CcmError`] when a folder cannot be read or there is no recording at all.
    pub fn open(root: &Path) -> Result<Self> {
        let mut wavs = Vec::new();
        let mut tables = Vec::new();
        walk(root, 0, &mut wavs, &mut tables)?;
        let mut set = Self {
            root: root.to_path_buf(),
            recordings: Vec::new(),
            annotations: Vec::new(),
            actions: None,
            synthetic: root.join(crate::synth::NOTICE).exists(),
            odd: Vec::new(),
            contradictions: Vec::new(),
        };
        for path in tables {
            let name = path.file_name().unwrap_or_default().to_string_lossy().to_lowercase();
            if name.starts_with("man_annotation") {
                match &set.actions {
                    None => set.actions = Some(path),
                    Some(first) => {
                        let what = format!("is not used: {} has the actions", first.display());
                        set.odd.push(Oddity { path, what });
                    }
                }
            } else if name.contains("annotation") {
                match Annotations::read(&path) {
                    Ok(annotations) => set.annotations.push(annotations),
                    Err(e) => set.odd.push(Oddity { path, what: e.to_string() }),
                }
            }
        }
        let index = Index::new(&set.annotations);
        let mut seen = HashSet::new();
        for path in wavs {
            match place(root, &path, &index) {
                Ok(recording) => {
                    let key =
                        (recording.part, recording.container, recording.sequence, recording.id);
                    if !seen.insert(key) {
                        let what = "the same recording is present twice".into();
                        set.odd.push(Oddity { path, what });
                        continue;
                    }
                    set.recordings.push(recording);
                }
                Err(what) => set.odd.push(Oddity { path, what }),
            }
        }
        let contradictions = index.contradictions;
        set.contradictions = contradictions;
        if set.recordings.is_empty() {
            return Err(CcmError::Request(format!(
                "{}: contains no recording of the data set; expected files such as \
                 train/1/audio/s0_fi0_fu0_b0_l0_audio.wav or train/audio/000000.wav",
                root.display()
            )));
        }
        set.recordings
            .sort_by_key(|r| (r.container.is_none(), r.container, r.sequence, r.part, r.id));
        Ok(set)
    }

    /// The manual action annotations, none where there is no such file.
    ///
    /// # Errors
    /// [`CcmError`] when the file is there but unusable.
    pub fn actions(&self) -> Result<super::Actions> {
        self.actions.as_deref().map_or_else(|| Ok(super::Actions::new()), super::read_actions)
    }

    /// Ground truth of a recording, from whichever annotation file has it.
    pub fn annotation(&self, recording: &Recording) -> Option<&Annotation> {
        Index::new(&self.annotations).find(recording)
    }
}

/// What the path of a recording says by itself.
pub(crate) struct PathParts {
    folders: Vec<String>,
    /// Number of the container whose folder it is in; an error where the data set has no such one.
    container: Option<std::result::Result<Container, u8>>,
    name: Option<SequenceName>,
    number: Option<u32>,
}

impl PathParts {
    pub(crate) fn of(path: &Path) -> Self {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        let folders: Vec<_> = path
            .ancestors()
            .skip(1)
            .filter_map(|p| p.file_name().map(|n| n.to_string_lossy().into_owned()))
            .collect();
        let digits = stem.strip_suffix("_audio").unwrap_or(&stem);
        // Of a six-digit name, folders above the part are the user's: `/home/7/train/audio/000000.wav` is of no
        // container 7.
        let is_part = |f: &String| {
            let f = f.to_lowercase();
            f.starts_with("train") || f.starts_with("test")
        };
        let is_flat = digits.len() == FLAT_DIGITS && digits.len() == stem.len();
        let within = match folders.iter().position(is_part) {
            Some(part) if is_flat => &folders[..part],
            _ => &folders[..],
        };
        let container = within.iter().find_map(|f| f.parse().ok());
        Self {
            container: container.map(|n: u8| Container::new(n).ok_or(n)),
            name: SequenceName::parse(&stem),
            number: digits.parse().ok().filter(|_| digits.bytes().all(|b| b.is_ascii_digit())),
            folders,
        }
    }

    /// How submissions name the recording, where the path tells.
    pub(crate) fn key(&self) -> Option<RowKey> {
        match (&self.container, self.name, self.number) {
            (Some(Ok(c)), Some(name), _) => Some(RowKey::Sequence(c.number(), name.number(*c)?)),
            (Some(Ok(c)), None, Some(n)) => {
                Some(RowKey::Sequence(c.number(), u16::try_from(n).ok()?))
            }
            (None, None, Some(id)) => Some(RowKey::Id(id)),
            _ => None,
        }
    }

    /// The part of the flat release, by the names of its folders (`test_pub`, `test_priv`).
    fn flat_part(&self) -> Subset {
        let has = |text: &str| self.folders.iter().any(|f| f.to_lowercase().contains(text));
        match (has("test"), has("priv")) {
            (false, _) => Subset::Training,
            (true, false) => Subset::Public,
            (true, true) => Subset::Private,
        }
    }
}

/// What a file is, from its path and the annotations.
fn place(root: &Path, path: &Path, index: &Index<'_>) -> std::result::Result<Recording, String> {
    let parts = PathParts::of(path.strip_prefix(root).unwrap_or(path));
    let blank = Recording {
        path: path.into(),
        part: Subset::Training,
        container: None,
        id: None,
        sequence: None,
        name: None,
    };
    match (parts.container, parts.name, parts.number) {
        (Some(Err(n)), ..) => Err(format!("the data set has no container {n}")),
        (Some(Ok(container)), Some(name), _) => {
            let sequence = name.number(container).ok_or_else(|| {
                format!(
                    "container {} is never filled with {}",
                    container.number(),
                    name.filling.name()
                )
            })?;
            let recording = Recording {
                part: container.subset(),
                container: Some(container),
                sequence: Some(sequence),
                name: Some(name),
                ..blank
            };
            let annotated = index.find(&recording);
            if let Some(other) = annotated.and_then(|a| a.filling).filter(|f| *f != name.filling) {
                return Err(format!(
                    "its name says {}, its annotation {}",
                    name.filling.name(),
                    other.name()
                ));
            }
            Ok(Recording { id: annotated.and_then(|a| a.id), ..recording })
        }
        (Some(Ok(container)), None, Some(number)) => {
            let sequence = u16::try_from(number).map_err(|_| "its number is too large")?;
            let recording = Recording {
                part: container.subset(),
                container: Some(container),
                sequence: Some(sequence),
                ..blank
            };
            let annotated = index.find(&recording);
            let (id, name) = (annotated.and_then(|a| a.id), annotated.and_then(Annotation::name));
            Ok(Recording { id, name, ..recording })
        }
        (None, None, Some(id)) => {
            let recording = Recording { part: parts.flat_part(), id: Some(id), ..blank };
            let annotated = index.find(&recording);
            Ok(Recording {
                container: annotated.and_then(|a| Container::new(a.container)),
                sequence: annotated.and_then(|a| a.sequence),
                name: annotated.and_then(Annotation::name),
                ..recording
            })
        }
        (None, Some(_), _) => Err("no folder above it is a container number".into()),
        _ => Err("its name is not one of the data set's".into()),
    }
}

fn walk(
    dir: &Path,
    depth: usize,
    wavs: &mut Vec<PathBuf>,
    tables: &mut Vec<PathBuf>,
) -> Result<()> {
    let entries = std::fs::read_dir(dir).map_err(|e| CcmError::io(dir, e))?;
    let mut paths = Vec::new();
    for entry in entries {
        let entry = entry.map_err(|e| CcmError::io(dir, e))?;
        // Hidden files are not part of the data set, such as those that macOS puts beside others.
        if !entry.file_name().as_encoded_bytes().starts_with(b".") {
            paths.push(entry.path());
        }
    }
    paths.sort();
    for path in paths {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        if path.is_dir() {
            if depth < MAX_DEPTH {
                walk(&path, depth + 1, wavs, tables)?;
            }
        } else if extension.as_deref() == Some("wav") {
            wavs.push(path);
        } else if extension.as_deref() == Some("csv") && depth <= 1 {
            tables.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_above_the_part_are_no_containers() {
        let key = |path: &str| PathParts::of(Path::new(path)).key();
        for (path, expected) in [
            ("/home/7/flat/train/audio/000011.wav", Some(RowKey::Id(11))),
            ("7/test_pub/audio/000011.wav", Some(RowKey::Id(11))),
            ("/data/7/train/3/audio/s0_fi0_fu0_b0_l0_audio.wav", Some(RowKey::Sequence(3, 0))),
            ("7/test/12/audio/0011_audio.wav", Some(RowKey::Sequence(12, 11))),
            ("train/3/audio/000011.wav", Some(RowKey::Sequence(3, 11))),
            ("7/train/0011_audio.wav", Some(RowKey::Sequence(7, 11))),
            ("7/audio/000011.wav", Some(RowKey::Sequence(7, 11))),
            ("000011", Some(RowKey::Id(11))),
        ] {
            assert_eq!(key(path), expected, "{path}");
        }
    }
}
