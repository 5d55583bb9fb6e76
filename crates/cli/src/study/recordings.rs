//! What the recordings behind a report are like.

use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};

use corsmal_extract::inputs::is_stored;
use corsmal_files::identity;
use corsmal_plot::RecordingPicture;
use corsmal_report::study::{Recording, Study};
use corsmal_report::{Excerpt, Look, View, look};
use rayon::prelude::*;

use crate::progress::bar;

/// Classes of which a recording is drawn.
const PICTURES: usize = 50;
/// Stretches of a recording without features that are named.
const STRETCHES: usize = 5;

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
    /// the classes of its rows
    classes: HashSet<usize>,
    /// ids of its rows without features, and why
    unused: Vec<(String, String)>,
    rows: usize,
    present: Present,
    examples: Vec<(usize, Excerpt)>,
}

/// What is at the path of a recording.
#[derive(Clone, Copy, PartialEq)]
enum Present {
    Yes,
    Gone,
    /// a member of a tar, or an object in a store
    Elsewhere,
    /// another file
    Changed,
}

impl Present {
    fn of(source: &Source) -> Self {
        let known = !source.identity.is_empty() && source.identity != identity::STREAM;
        let is_member = || source.path.ancestors().skip(1).any(Path::is_file);
        match source.path.is_file() {
            false if is_member() || source.path.to_str().is_some_and(is_stored) => Self::Elsewhere,
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
    warn(&recordings, Present::Elsewhere, "lie in a tar or a store");
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

/// The recordings of the rows, with the first row of each class as an example.
fn heard(sources: Vec<Source>) -> Vec<Heard> {
    let mut recordings: Vec<Heard> = Vec::new();
    let (mut known, mut pictured, mut rows) = (HashMap::new(), HashSet::new(), Vec::new());
    for source in sources {
        let index = *known.entry(source.path.clone()).or_insert(recordings.len());
        let (class, stretch) = (source.class, source.stretch);
        let unused = source.unused.clone().map(|reason| (source.id.clone(), reason));
        if index == recordings.len() {
            recordings.push(Heard {
                source,
                classes: HashSet::new(),
                unused: Vec::new(),
                rows: 0,
                present: Present::Gone,
                examples: Vec::new(),
            });
        }
        let heard = &mut recordings[index];
        heard.classes.extend(class);
        heard.unused.extend(unused);
        heard.rows += 1;
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
    let Heard { source, classes, unused, rows, present, examples } = heard;
    // Of several stretches, the file is the recording. With stretches of several classes it has none.
    let id = if rows > 1 { source.path.display().to_string() } else { source.id };
    let class = classes.iter().next().copied().filter(|_| classes.len() == 1);
    let recording = Recording { id, class, ..Recording::default() };
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
    let more = unused.len().saturating_sub(STRETCHES);
    recording.notes.extend(unused.into_iter().take(STRETCHES).map(|(id, reason)| match rows {
        1 => reason,
        _ => format!("{id}: {reason}"),
    }));
    if more > 0 {
        recording.notes.push(format!("{more} more without features"));
    }
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
