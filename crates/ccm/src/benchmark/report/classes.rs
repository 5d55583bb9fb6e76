//! Which classes are taken for which.

use corsmal_plot::ConfusionMatrix as Plot;
use corsmal_report::{Figure, FigureGroup, Section, Source};
use ndarray::Array2;

use crate::benchmark::method::{Method, Part, joint_names, kind_names, level_names};
use crate::benchmark::results::{PartScores, Rows};
use crate::error::Result;
use crate::scores::ConfusionMatrix;

/// Class by class: the method that is best at the joint class first, then the others.
pub(super) fn section(rows: &Rows, methods: &[Method], seed: u64) -> Result<Option<Section>> {
    let shown = methods.iter().filter(|m| m.protocol == "corrected" || m.source == Source::Added);
    let mut scored: Vec<(&Method, PartScores)> =
        shown.filter_map(|m| Some((m, m.scores(rows, Part::Training, seed, &|_| true)?))).collect();
    // One that does not address both tasks comes last.
    let joint = |s: &PartScores| s.joint.unwrap_or(-1.0);
    scored.sort_by(|a, b| joint(&b.1).total_cmp(&joint(&a.1)));
    let Some((best, _)) = scored.first() else { return Ok(None) };
    let text = format!(
        "Held-out training containers; {} is the best at the joint class. Shades are shares of the \
         true class. The folder figures has these pictures for every baseline, of both protocols, \
         and for every system.",
        best.name
    );
    let groups = scored.iter().map(|(method, scores)| {
        let slug = format!("classes-{}", slug(&method.name));
        Ok(FigureGroup {
            title: match scores.joint {
                Some(joint) => format!("{}, joint class {joint:.2} %", method.name),
                None => method.name.clone(),
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

fn slug(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("-")
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
