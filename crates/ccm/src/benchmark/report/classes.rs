//! Which classes are taken for which.

use corsmal_plot::ConfusionMatrix as Plot;
use corsmal_report::{Figure, FigureGroup, Section, Source};
use ndarray::Array2;
use rayon::prelude::*;

use crate::benchmark::method::{HELD_OUT, Method, joint_names, kind_names, level_names};
use crate::benchmark::names::file_name;
use crate::benchmark::results::{PartScores, Rows};
use crate::error::Result;
use crate::scores::ConfusionMatrix;

/// Class by class: the method that is best at the joint class first, then the others.
pub(super) fn section(rows: &Rows, methods: &[Method], seed: u64) -> Result<Option<Section>> {
    let shown = methods
        .iter()
        .filter(|m| !m.completes() && (m.protocol == "corrected" || m.source == Source::Added));
    let mut scored: Vec<(&Method, &str, PartScores)> = shown
        .filter_map(|m| {
            let (part, scores) = m.first_scores(rows, seed)?;
            Some((m, part, scores))
        })
        .filter(|(.., s)| s.level.is_some() || s.kind.is_some())
        .collect();
    // One that does not address both tasks, or was given for test recordings alone, comes last.
    let held_out = |part: &str| part == HELD_OUT;
    let order =
        |(_, part, s): &(&Method, &str, PartScores)| (held_out(part), s.joint.unwrap_or(-1.0));
    scored.sort_by(|a, b| {
        let (a, b) = (order(a), order(b));
        b.0.cmp(&a.0).then(b.1.total_cmp(&a.1))
    });
    let Some((best, best_part, _)) = scored.first() else { return Ok(None) };
    let text = format!(
        "Held-out training containers, unless a heading says otherwise; {} is best at the joint \
         class ({best_part}). A cell's shade is its share of the true class. The folder figures has \
         these pictures for every baseline, under both protocols, and for every system.",
        best.name
    );
    let groups = scored.par_iter().map(|(method, part, scores)| {
        let slug = format!("classes-{}", file_name(&method.name));
        let of = if held_out(part) { String::new() } else { format!(" ({part})") };
        Ok(FigureGroup {
            title: match scores.joint {
                Some(joint) => format!("{}, joint class {joint:.2} %{of}", method.name),
                None => format!("{}{of}", method.name),
            },
            figures: figures(&slug, &method.name, scores)?,
        })
    });
    Ok(Some(Section {
        text: vec![text],
        groups: groups.collect::<Result<_>>()?,
        ..Section::new("confusions", "Class by class")
    }))
}

/// The confusion matrices of the tasks that a method addresses.
pub(super) fn figures(name: &str, title: &str, scores: &PartScores) -> Result<Vec<Figure>> {
    let parts = [
        ("level", level_names(), &scores.level_matrix, scores.level),
        ("type", kind_names(), &scores.kind_matrix, scores.kind),
        ("joint", joint_names(), &scores.joint_matrix, scores.joint),
    ];
    let addressed = parts.into_iter().filter(|(.., score)| score.is_some());
    let figures = addressed.map(|(task, labels, matrix, _)| {
        let plot = plot(&format!("{title}: {task}"), labels, matrix);
        Figure::new(format!("{name}-{task}-confusion"), "", &plot)
    });
    Ok(figures.collect::<corsmal_report::Result<_>>()?)
}

fn plot(title: &str, labels: Vec<String>, matrix: &ConfusionMatrix) -> Plot {
    let n = labels.len();
    Plot {
        title: title.to_owned(),
        labels,
        counts: Array2::from_shape_fn((n, n + 1), |(t, e)| matrix.counts[t][e]),
        f1: matrix.classes().iter().map(|c| 100.0 * c.f1).collect(),
    }
}
