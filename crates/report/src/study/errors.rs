//! Predictions to listen to.

use super::content::{Prediction, Study};
use crate::{Cell, Row, Section, Source, Table};

/// Errors listed.
const LISTED: usize = 50;

/// The errors, the most confident first.
pub(super) fn section(study: &Study) -> Option<Section> {
    let mut wrong: Vec<&Prediction> =
        study.predictions.iter().filter(|p| p.predicted.is_some_and(|c| c != p.truth)).collect();
    let unanswered = study.predictions.iter().filter(|p| p.predicted.is_none()).count();
    if study.predictions.is_empty() {
        return None;
    }
    let sure = |p: &Prediction| p.confidence.unwrap_or(0.0);
    wrong.sort_by(|a, b| sure(b).total_cmp(&sure(a)).then_with(|| a.id.cmp(&b.id)));
    let mut text = format!("{} of {} rows are wrong.", wrong.len(), study.predictions.len());
    let confident = wrong.iter().any(|p| p.confidence.is_some());
    if confident {
        text.push_str(
            " The most confident errors come first: either their label is wrong, or they are the \
             most instructive to listen to.",
        );
    }
    if wrong.len() > LISTED {
        text.push_str(&format!(" The first {LISTED} are shown."));
    }
    if unanswered > 0 {
        text.push_str(&format!(" {unanswered} without a prediction."));
    }
    let time = |p: &Prediction| match p.stretch {
        Some((start, end)) => Cell::Number(start, format!("{start:.2} to {end:.2} s")),
        None => Cell::None,
    };
    let row = |p: &&Prediction| Row {
        source: Source::Ours,
        cells: vec![
            Cell::text(&p.id),
            time(p),
            Cell::text(study.class_name(p.truth)),
            Cell::text(p.predicted.map_or("none", |c| study.class_name(c))),
            Cell::score(p.confidence.map(|c| 100.0 * c)),
        ],
    };
    let table = Table {
        name: "errors".into(),
        caption: match confident {
            true => "Wrong predictions, the most confident first; confidence in percent".into(),
            false => "Wrong predictions".into(),
        },
        columns: ["Recording", "Time", "True", "Predicted", "Confidence"]
            .map(String::from)
            .to_vec(),
        rows: wrong.iter().take(LISTED).map(row).collect(),
    };
    let tables =
        if table.rows.is_empty() { Vec::new() } else { vec![table.without_empty_columns()] };
    Some(Section { text: vec![text], tables, ..Section::new("errors", "Errors to listen to") })
}
