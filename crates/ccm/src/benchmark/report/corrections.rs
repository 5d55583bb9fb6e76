//! What the published protocol hides.

use corsmal_plot::{Slope, Slopes};
use corsmal_report::{Cell, Figure, Row, Section, Source, Table};

use crate::benchmark::baselines::{BaselineResult, Variant};
use crate::benchmark::results::{Estimate, Rows, Target, score};
use crate::error::Result;

/// Scores of a baseline on recordings that were mostly trained on, on a random fifth that shares its
/// containers with the training part, and on containers never heard; level, type and joint class.
struct Line<'a> {
    outcome: &'a BaselineResult,
    seen: Option<[f64; 3]>,
    random: Option<[f64; 3]>,
    held_out: Option<[f64; 3]>,
}

pub(super) fn section(rows: &Rows, outcomes: &[BaselineResult], seed: u64) -> Result<Section> {
    let joint = |o: &BaselineResult, held_out: bool| -> Option<[f64; 3]> {
        let (targets, estimates): (Vec<&Target>, Vec<Estimate>) = if held_out {
            o.held_out.iter().map(|(row, e)| (&rows.training[*row], e.clone())).unzip()
        } else {
            rows.training.iter().zip(o.seen.iter().cloned()).unzip()
        };
        let scores = score(&targets, &estimates, seed)?;
        Some([scores.level?, scores.kind?, scores.joint?])
    };
    let published = outcomes.iter().filter(|o| o.variant == Variant::Published);
    let lines: Vec<Line> = published
        .map(|p| {
            let corrected = outcomes
                .iter()
                .find(|c| c.variant == Variant::Corrected && c.baseline == p.baseline);
            Line {
                outcome: p,
                seen: joint(p, false),
                random: joint(p, true),
                held_out: corrected.and_then(|c| joint(c, true)),
            }
        })
        .collect();
    let kinds = [
        ("level", "filling level"),
        ("type", "filling type"),
        ("joint", "joint class of type and level"),
    ];
    let tables = kinds.iter().enumerate().map(|(i, (name, what))| table(&lines, i, name, what));
    let figures = kinds.iter().enumerate().map(|(i, (name, what))| {
        Figure::new(format!("corrections-{name}"), "", &slopes(&lines, i, what))
    });
    Ok(Section {
        text: vec![
            "The published code trains on a random 80 % of the recordings, so every container is \
             heard in training; it scales no feature and fits the principal components separately \
             on every \
             part. Its own validation figure covers all recordings, four fifths of which were \
             trained on. The corrected runs standardise features, fit everything on training data \
             only and hold out whole containers in three folds."
                .into(),
        ],
        figures: match lines.is_empty() {
            true => Vec::new(),
            false => figures.collect::<corsmal_report::Result<_>>()?,
        },
        tables: tables.collect(),
        ..Section::new("corrections", "Published against corrected")
    })
}

fn table(lines: &[Line], index: usize, name: &str, what: &str) -> Table {
    let row = |line: &Line| {
        let at = |scores: &Option<[f64; 3]>| scores.map(|s| s[index]);
        let (random, held_out) = (at(&line.random), at(&line.held_out));
        let difference = held_out.zip(random).map(|(h, r)| Cell::Difference(h - r));
        Row {
            source: Source::Ours,
            cells: vec![
                Cell::Text(line.outcome.baseline.name()),
                Cell::score(at(&line.seen)),
                Cell::score(random),
                Cell::score(held_out),
                difference.unwrap_or(Cell::None),
            ],
        }
    };
    Table {
        name: format!("corrections-{name}"),
        caption: format!("Weighted F1 of the {what} on training containers, percent"),
        columns: [
            "Baseline",
            "All recordings (80 % seen in training)",
            "Random 20 %",
            "Held-out containers",
            "Difference",
        ]
        .map(String::from)
        .to_vec(),
        rows: lines.iter().map(row).collect(),
    }
}

/// From the published random fifth to containers never heard.
fn slopes(lines: &[Line], index: usize, what: &str) -> Slopes {
    let at = |scores: Option<[f64; 3]>| scores.map_or(f64::NAN, |s| s[index]);
    Slopes {
        title: format!("{}{}", what[..1].to_uppercase(), &what[1..]),
        before: "published: random 20 %".into(),
        after: "corrected: containers".into(),
        lines: lines
            .iter()
            .map(|line| Slope {
                name: line.outcome.baseline.name(),
                before: at(line.random),
                after: at(line.held_out),
            })
            .collect(),
    }
}
