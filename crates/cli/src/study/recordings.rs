//! What the recordings behind a report are like.

use std::collections::HashSet;
use std::path::PathBuf;

use corsmal_plot::RecordingPicture;
use corsmal_report::study::{Recording, Study};
use corsmal_report::{Look, View, look};
use rayon::prelude::*;

use crate::progress::bar;

/// Classes of which a recording is drawn.
const PICTURES: usize = 50;

/// A recording that may still be at its path.
pub(super) struct Source {
    pub id: String,
    pub path: PathBuf,
    pub class: Option<usize>,
    /// Why it has no features.
    pub unused: Option<String>,
}

/// Reads the recordings, each file once: their health, and a picture of the first of each class. Where
/// none is at its path any more, the report does without.
pub(super) fn add(study: &mut Study, sources: Vec<Source>, quiet: bool) {
    let mut seen = HashSet::new();
    let sources: Vec<Source> =
        sources.into_iter().filter(|source| seen.insert(source.path.clone())).collect();
    let gone = sources.iter().filter(|source| !source.path.is_file()).count();
    if let Some(first) = sources.iter().find(|source| !source.path.is_file()) {
        eprintln!(
            "warning: {gone} of {} recordings are no longer at their paths, such as {}{}",
            sources.len(),
            first.path.display(),
            if gone == sources.len() { "; the report leaves out their sound" } else { "" }
        );
    }
    if gone == sources.len() {
        return;
    }
    let mut pictured = HashSet::new();
    let wanted: Vec<bool> = sources
        .iter()
        .map(|source| {
            let new = |class| pictured.len() < PICTURES && pictured.insert(class);
            source.path.is_file() && source.class.is_some_and(new)
        })
        .collect();
    let bar = bar(sources.len(), "recordings", quiet);
    let looks: Vec<(Recording, Option<RecordingPicture>)> = sources
        .par_iter()
        .zip(wanted)
        .map(|(source, wanted)| {
            let recording =
                Recording { id: source.id.clone(), class: source.class, ..Recording::default() };
            // All channels of an array would fill a page for each class.
            let view = wanted.then(|| View { channels: vec![0], ..View::default() });
            let mut found = match look(&source.path, view) {
                Ok(found) => (described(recording, &found), found.picture),
                Err(error) => (Recording { failure: Some(error.to_string()), ..recording }, None),
            };
            found.0.notes.extend(source.unused.clone());
            bar.inc(1);
            found
        })
        .collect();
    bar.finish_and_clear();
    for (recording, picture) in looks {
        study.examples.extend(recording.class.zip(picture));
        study.recordings.push(recording);
    }
    study.examples.sort_by_key(|(class, _)| *class);
}

fn described(recording: Recording, found: &Look) -> Recording {
    Recording {
        seconds: found.seconds(),
        sample_rate: found.spec.sample_rate,
        channels: found.spec.channels,
        peak_dbfs: found.peak_dbfs(),
        notes: found.notes(),
        ..recording
    }
}
