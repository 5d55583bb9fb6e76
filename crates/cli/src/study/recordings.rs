//! What the recordings behind a report are like.

use std::collections::{HashMap, HashSet};
use std::path::PathBuf;

use corsmal_files::identity;
use corsmal_plot::RecordingPicture;
use corsmal_report::study::{Recording, Study};
use corsmal_report::{Excerpt, Look, View, look};
use rayon::prelude::*;

use crate::progress::bar;

/// Classes of which a recording is drawn.
const PICTURES: usize = 50;

/// A row of a study: a recording, or a stretch of it, that may still be at its path.
pub(super) struct Source {
    pub id: String,
    pub path: PathBuf,
    pub class: Option<usize>,
    /// Where the stretch is in the recording, in seconds.
    pub stretch: Option<(f64, f64)>,
    /// What its bytes were known by; empty where that is not known.
    pub identity: String,
    /// Why it has no features.
    pub unused: Option<String>,
}

/// A recording, and what is drawn of it.
struct Heard {
    source: Source,
    present: Present,
    examples: Vec<(usize, Excerpt)>,
}

/// What is at the path of a recording.
#[derive(Clone, Copy, PartialEq)]
enum Present {
    Yes,
    Gone,
    /// another file
    Changed,
}

impl Present {
    fn of(source: &Source) -> Self {
        let known = !source.identity.is_empty() && source.identity != identity::STREAM;
        match source.path.is_file() {
            false => Self::Gone,
            true if known
                && identity::of_file(&source.path).ok().as_ref() != Some(&source.identity) =>
            {
                Self::Changed
            }
            true => Self::Yes,
        }
    }
}

/// Reads the recordings, each file once: their health, and a picture of the first row of each class. Where
/// none is at its path any more, the report does without.
pub(super) fn add(study: &mut Study, sources: Vec<Source>, quiet: bool) {
    let recordings = heard(sources);
    warn(&recordings, Present::Gone, "are no longer at their paths");
    warn(&recordings, Present::Changed, "are no longer those that the features were made from");
    if recordings.iter().all(|heard| heard.present != Present::Yes) {
        return;
    }
    let bar = bar(recordings.len(), "recordings", quiet);
    let looks: Vec<_> = recordings
        .into_par_iter()
        .map(|heard| {
            let found = described(heard);
            bar.inc(1);
            found
        })
        .collect();
    bar.finish_and_clear();
    for (recording, pictures) in looks {
        study.examples.extend(pictures);
        study.recordings.push(recording);
    }
    study.examples.sort_by_key(|(class, _)| *class);
}

/// The recordings of the rows, with the first row of each class as an example. A recording with stretches of
/// several classes has none.
fn heard(sources: Vec<Source>) -> Vec<Heard> {
    let mut recordings: Vec<Heard> = Vec::new();
    let (mut known, mut pictured, mut rows) = (HashMap::new(), HashSet::new(), Vec::new());
    for source in sources {
        let index = *known.entry(source.path.clone()).or_insert(recordings.len());
        let (class, stretch) = (source.class, source.stretch);
        if index == recordings.len() {
            recordings.push(Heard { source, present: Present::Gone, examples: Vec::new() });
        }
        let heard = &mut recordings[index];
        heard.source.class = heard.source.class.filter(|_| heard.source.class == class);
        rows.push((index, class, stretch));
    }
    recordings.par_iter_mut().for_each(|heard| heard.present = Present::of(&heard.source));
    for (index, class, stretch) in rows {
        let heard = &mut recordings[index];
        let Some(class) = class.filter(|_| heard.present == Present::Yes) else { continue };
        if pictured.len() < PICTURES && pictured.insert(class) {
            // All channels of an array would fill a page for each class.
            let start = stretch.map_or(0.0, |(start, _)| start);
            let view = View { channels: vec![0], start, ..View::default() };
            heard.examples.push((class, Excerpt { view, end: stretch.map(|(_, end)| end) }));
        }
    }
    recordings
}

fn warn(recordings: &[Heard], present: Present, what: &str) {
    let such = || recordings.iter().filter(|heard| heard.present == present);
    let Some(first) = such().next() else { return };
    let (count, all) = (such().count(), recordings.len());
    eprintln!(
        "warning: {count} of {all} recordings {what}, such as {}; the report leaves out their sound",
        first.source.path.display()
    );
}

fn described(heard: Heard) -> (Recording, Vec<(usize, RecordingPicture)>) {
    let Heard { source, present, examples } = heard;
    let recording = Recording { id: source.id, class: source.class, ..Recording::default() };
    let (classes, excerpts): (Vec<usize>, _) = examples.into_iter().unzip();
    let found = match present {
        Present::Changed => {
            Err("another file than the one that the features were made from".into())
        }
        _ => look(&source.path, excerpts).map_err(|error| error.to_string()),
    };
    let (mut recording, pictures) = match found {
        Ok(found) => (of_look(recording, &found), found.pictures),
        Err(failure) => (Recording { failure: Some(failure), ..recording }, Vec::new()),
    };
    recording.notes.extend(source.unused);
    (recording, classes.into_iter().zip(pictures).collect())
}

fn of_look(recording: Recording, found: &Look) -> Recording {
    Recording {
        seconds: found.seconds(),
        sample_rate: found.spec.sample_rate,
        channels: found.spec.channels,
        peak_dbfs: found.peak_dbfs(),
        notes: found.notes(),
        ..recording
    }
}
