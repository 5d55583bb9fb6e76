//! What is there, missing and odd in a data set on disk.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;

use super::container::{Container, Subset};
use super::layout::DataSet;
use super::name::SequenceName;
use super::oddity::{Oddity, all_in_words, in_words, perhaps_in_words};

/// Shortest and longest recording of the real data set, in seconds, with room.
const DURATION_S: std::ops::RangeInclusive<f64> = 0.9..=200.0;

/// Findings about a data set.
#[derive(Debug, Serialize)]
pub struct Findings {
    /// The folder.
    #[serde(serialize_with = "in_words")]
    pub root: PathBuf,
    /// Made by `corsmal-feat synth`.
    pub synthetic: bool,
    /// Number of recordings.
    pub recordings: usize,
    /// How many of them have a known filling.
    pub labelled: usize,
    /// The containers with any recording.
    pub containers: Vec<ContainerFindings>,
    /// Containers without any.
    pub absent: Vec<Container>,
    /// Flat test files, which belong to no known container.
    pub unplaced: usize,
    /// Annotation files.
    #[serde(serialize_with = "all_in_words")]
    pub annotations: Vec<PathBuf>,
    /// Manual action annotations.
    #[serde(serialize_with = "perhaps_in_words")]
    pub actions: Option<PathBuf>,
    /// Total duration in seconds.
    pub seconds: f64,
    /// Channels, rate and encoding with the number of files.
    pub formats: BTreeMap<String, usize>,
    /// Everything odd.
    pub odd: Vec<Oddity>,
}

/// Findings about a container.
#[derive(Debug, Serialize)]
pub struct ContainerFindings {
    /// The container.
    pub container: Container,
    /// Category.
    pub category: &'static str,
    /// Part of the data set.
    pub subset: &'static str,
    /// Recordings that are there.
    pub found: usize,
    /// Recordings that the full data set has.
    pub expected: usize,
    /// Names (training) or numbers (test) that are missing.
    pub missing: Vec<String>,
}

impl Findings {
    /// Whether nothing is odd and, in a real data set, no container that is there is incomplete.
    pub fn sound(&self) -> bool {
        self.odd.is_empty()
            && (self.synthetic || self.containers.iter().all(|c| c.missing.is_empty()))
    }
}

/// Looks at every recording's place and header; samples are not read.
pub fn check(set: &DataSet) -> Findings {
    let mut odd = [set.odd.clone(), set.contradictions.clone()].concat();
    if let (Some(path), Err(error)) = (&set.actions, set.actions()) {
        odd.push(Oddity { path: path.clone(), what: error.to_string() });
    }
    let actions = set.actions().unwrap_or_default();
    let mut formats = BTreeMap::new();
    let mut seconds = 0.0;
    for recording in &set.recordings {
        let mut fault = |what: String| odd.push(Oddity { path: recording.path.clone(), what });
        match corsmal_audio::open(&recording.path) {
            Err(e) => fault(e.to_string()),
            Ok(source) => {
                let spec = source.spec();
                let text =
                    format!("{} channels, {} Hz, {}", spec.channels, spec.sample_rate, spec.format);
                *formats.entry(text).or_insert(0) += 1;
                let length =
                    spec.declared_frames.map_or(0.0, |n| n as f64 / f64::from(spec.sample_rate));
                seconds += length;
                let action = recording.container.zip(recording.name).and_then(|k| actions.get(&k));
                if let Some(Some((start, _))) = action
                    && spec.declared_frames.is_some()
                    && *start >= length
                {
                    fault(format!(
                        "its annotated action begins at {start} s, after its end at {length:.2} s"
                    ));
                }
                if let (Some(declared), Some(there)) = (spec.declared_frames, source.most_frames())
                    && there < declared
                {
                    fault(format!("cut off: {there} of {declared} samples a channel are there"));
                }
                if spec.channels != 8 || spec.sample_rate != 44_100 {
                    fault(format!(
                        "{} channels at {} Hz; the data set has 8 at 44100 Hz",
                        spec.channels, spec.sample_rate
                    ));
                }
                if !DURATION_S.contains(&length) {
                    fault(format!("{length:.2} s long; the data set's are 1.1 to 153 s"));
                }
            }
        }
    }
    let mut containers = Vec::new();
    let mut absent = Vec::new();
    for container in Container::all() {
        let there: Vec<_> =
            set.recordings.iter().filter(|r| r.container == Some(container)).collect();
        if there.is_empty() {
            absent.push(container);
            continue;
        }
        let has = |number: usize| there.iter().any(|r| r.sequence.map(usize::from) == Some(number));
        let missing = if container.subset() == Subset::Training {
            SequenceName::all(container)
                .enumerate()
                .filter(|(i, _)| !has(*i))
                .map(|(_, name)| name.to_string())
                .collect()
        } else {
            (0..container.recordings()).filter(|&i| !has(i)).map(|i| format!("{i:04}")).collect()
        };
        containers.push(ContainerFindings {
            container,
            category: container.category().name(),
            subset: container.subset().name(),
            found: there.len(),
            expected: container.recordings(),
            missing,
        });
    }
    Findings {
        root: set.root.clone(),
        synthetic: set.synthetic,
        recordings: set.recordings.len(),
        labelled: set.recordings.iter().filter(|r| r.name.is_some()).count(),
        containers,
        absent,
        unplaced: set.recordings.iter().filter(|r| r.container.is_none()).count(),
        annotations: set.annotations.iter().map(|a| a.path.clone()).collect(),
        actions: set.actions.clone(),
        seconds,
        formats,
        odd,
    }
}
