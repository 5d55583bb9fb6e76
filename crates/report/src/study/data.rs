//! What the recordings are like.

use std::collections::BTreeMap;

use corsmal_plot::Histogram;

use super::content::{Recording, Study};
use crate::{Cell, Figure, FigureGroup, Result, Row, Section, Source, Table};

/// Recordings with notes that are listed.
const LISTED: usize = 50;
/// Bins of a histogram.
const BINS: usize = 30;

/// Lengths, rates, channels, and what is wrong with which recording.
pub(super) fn section(study: &Study) -> Result<Option<Section>> {
    let sound: Vec<&Recording> = study.recordings.iter().filter(|r| r.failure.is_none()).collect();
    if study.recordings.is_empty() {
        return Ok(None);
    }
    let odd: Vec<&Recording> =
        study.recordings.iter().filter(|r| r.failure.is_some() || !r.notes.is_empty()).collect();
    let seconds: Vec<f64> = sound.iter().map(|r| r.seconds).collect();
    let total: f64 = seconds.iter().sum();
    let mut text = vec![format!(
        "{} recordings, {:.1} minutes in all. {} of them have notes: clipping, dead channels, \
         offsets, channels that are copies of another, or no features, which leaves them out of \
         the scores.",
        study.recordings.len(),
        total / 60.0,
        odd.len()
    )];
    if odd.len() > LISTED {
        text.push(format!("The first {LISTED} are shown."));
    }
    let mut figures = Vec::new();
    for (name, title, label, values) in [
        ("durations", "Lengths", "seconds", seconds),
        (
            "peaks",
            "Peak levels",
            "dB relative to full scale",
            sound.iter().filter_map(|r| r.peak_dbfs).collect(),
        ),
    ] {
        let (counts, range) = Histogram::of(&values, BINS);
        let plot = Histogram {
            title: title.into(),
            value_label: label.into(),
            count_label: "recordings".into(),
            range,
            counts,
        };
        figures.push(Figure::new(name, "", &plot)?);
    }
    let mut tables = vec![formats(&sound)];
    if !odd.is_empty() {
        tables.push(notes(study, &odd));
    }
    Ok(Some(Section { text, figures, tables, ..Section::new("data", "The recordings") }))
}

fn formats(sound: &[&Recording]) -> Table {
    let mut kinds: BTreeMap<(u32, u16), Vec<f64>> = BTreeMap::new();
    for recording in sound {
        let kind = (recording.sample_rate, recording.channels);
        kinds.entry(kind).or_default().push(recording.seconds);
    }
    let row = |((rate, channels), seconds): (&(u32, u16), &Vec<f64>)| {
        let shortest = seconds.iter().copied().fold(f64::INFINITY, f64::min);
        let longest = seconds.iter().copied().fold(0.0, f64::max);
        let number = |v: f64| Cell::Number(v, format!("{v:.2}"));
        Row {
            source: Source::Ours,
            cells: vec![
                Cell::Number(f64::from(*rate), rate.to_string()),
                Cell::count(usize::from(*channels)),
                Cell::count(seconds.len()),
                number(shortest),
                number(seconds.iter().sum::<f64>() / seconds.len().max(1) as f64),
                number(longest),
            ],
        }
    };
    Table {
        name: "formats".into(),
        caption: "Sample rates and channels; lengths in seconds".into(),
        columns: ["Hz", "Channels", "Recordings", "Shortest", "Mean", "Longest"]
            .map(String::from)
            .to_vec(),
        rows: kinds.iter().map(row).collect(),
    }
}

fn notes(study: &Study, odd: &[&Recording]) -> Table {
    let row = |recording: &&Recording| Row {
        source: Source::Ours,
        cells: vec![
            Cell::text(&recording.id),
            Cell::text(recording.class.map_or("", |c| study.class_name(c))),
            Cell::text(match &recording.failure {
                Some(failure) => failure.clone(),
                None => recording.notes.join("; "),
            }),
        ],
    };
    Table {
        name: "notes".into(),
        caption: "Recordings with notes".into(),
        columns: ["Recording", "Class", "Notes"].map(String::from).to_vec(),
        rows: odd.iter().take(LISTED).map(row).collect(),
    }
}

/// How many recordings each class has, and one of each to look at.
pub(super) fn classes(study: &Study) -> Result<Option<Section>> {
    if study.examples.is_empty() {
        return Ok(None);
    }
    let figures = study.examples.iter().map(|(class, picture)| {
        let name = study.class_name(*class);
        let mut picture = picture.clone();
        picture.title = format!("{name}: {}", picture.title);
        Ok(Figure::new(format!("example-{class}"), "", &picture)?.wide())
    });
    // The first two are open; of many classes the page would be all pictures.
    let mut figures = figures.collect::<Result<Vec<_>>>()?.into_iter();
    let first: Vec<Figure> = figures.by_ref().take(2).collect();
    let rest: Vec<Figure> = figures.collect();
    let mut groups = vec![FigureGroup { title: "The first classes".into(), figures: first }];
    if !rest.is_empty() {
        groups.push(FigureGroup { title: "The other classes".into(), figures: rest });
    }
    Ok(Some(Section {
        text: vec!["The first recording of each class, or the first stretch of one: waveform and spectrogram.".into()],
        groups,
        ..Section::new("examples", "An example of each class")
    }))
}
