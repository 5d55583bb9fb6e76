//! The best of this run next to the best of the paper, and all methods in one picture.

use corsmal_plot::{Mark, ScorePlot, ScoreRow};
use corsmal_report::{Cell, Figure, Row, Section, Source, Table};
use rayon::prelude::*;

use crate::benchmark::method::{Method, Part, of_task};
use crate::benchmark::results::{PartScores, Rows};
use crate::error::Result;
use crate::paper::{self, Task};

/// The best method of each task in this run, with the paper's figures for it and its best method.
pub(super) fn section(
    synthetic: bool,
    rows: &Rows,
    methods: &[Method],
    seed: u64,
) -> Result<Section> {
    let mut lines = Vec::new();
    let corrected: Vec<(&Method, PartScores)> = methods
        .iter()
        .filter(|m| m.protocol == "corrected" && !m.completes())
        .filter_map(|m| Some((m, m.scores(rows, Part::Training, seed, &|_| true)?)))
        .collect();
    for task in [Task::Level, Task::Type] {
        let scored = corrected.iter().filter_map(|(m, s)| Some((m, of_task(task, s)?)));
        let Some((method, _)) = scored.max_by(|a, b| a.1.total_cmp(&b.1)) else { continue };
        let paper = paper::scores(task);
        let same = paper.iter().find(|p| p.is_of(&method.name));
        let best = paper.iter().max_by(|a, b| a.combined.total_cmp(&b.combined));
        lines.push(Row {
            source: Source::Ours,
            cells: vec![
                Cell::Text(task.title().into()),
                Cell::Text(method.name.clone()),
                method.cell(rows, Part::Training, task, seed),
                Cell::score(same.map(|p| p.combined)),
                Cell::Text(best.map_or_else(String::new, |p| p.method.into())),
                Cell::score(best.map(|p| p.combined)),
            ],
        });
    }
    let figures = [Task::Level, Task::Type].map(|task| {
        let plot = plot(task, rows, methods, seed);
        Figure::new(format!("methods-{}", task.name()), "", &plot)
    });
    let comparable = if synthetic {
        "This run is on synthetic recordings, the paper's figures are on real ones: they cannot be \
         compared."
    } else {
        "The containers differ, so the columns are not directly comparable."
    };
    Ok(Section {
        text: vec![
            format!(
                "The best method of this run on held-out training containers, the paper's result \
                 for the same method on its test containers, and the paper's best method. Weighted F1 in percent. {comparable}"
            ),
            "Intervals hold 95 % of 1,000 bootstrap resamples. Scores on the training part \
             resample whole containers; scores on the test parts resample recordings, because \
             their three containers are too few, and therefore say nothing about other containers."
                .into(),
        ],
        figures: figures.into_iter().collect::<corsmal_report::Result<_>>()?,
        tables: vec![Table {
            name: "glance".into(),
            caption: "Best method of this run and the paper's results".into(),
            columns: [
                "Task",
                "Best in this run",
                "This run, held-out containers",
                "Paper, same method",
                "Paper's best",
                "Paper, combined",
            ]
            .map(String::from)
            .to_vec(),
            rows: lines,
        }],
        ..Section::new("glance", "At a glance")
    })
}

/// Every method of the paper and of this run on one scale, the best first.
fn plot(task: Task, rows: &Rows, methods: &[Method], seed: u64) -> ScorePlot {
    const PROTOCOLS: [&str; 2] = ["corrected", "published"];
    let mut lines: Vec<ScoreRow> = Vec::new();
    let published = paper::scores(task);
    for row in published.iter().rev() {
        let mark = Mark { series: 0, value: row.combined, interval: None };
        // The paper has one method with several inputs.
        let same = published.iter().filter(|other| other.method == row.method);
        let name = match same.count() {
            1 => row.method.to_owned(),
            _ => paper::named(row.method, row.inputs),
        };
        lines.push(ScoreRow { name, marks: vec![mark] });
    }
    let cell = |method: &Method| method.cell(rows, Part::Training, task, seed);
    let cells: Vec<Cell> = methods.par_iter().map(cell).collect();
    for (method, cell) in methods.iter().zip(cells) {
        let Cell::Score(value, interval) = cell else { continue };
        let series = match PROTOCOLS.iter().position(|p| *p == method.protocol) {
            Some(place) => 1 + place,
            None => 3,
        };
        let mark = Mark { series, value, interval };
        match lines.iter_mut().find(|line| line.name == method.name) {
            Some(line) => line.marks.push(mark),
            None => lines.push(ScoreRow { name: method.name.clone(), marks: vec![mark] }),
        }
    }
    let others = lines.iter().any(|l| l.marks.iter().any(|m| m.series == 3));
    let mut series =
        vec!["paper, test containers", "this run, corrected", "this run, as published"];
    if others {
        series.push("other estimates");
    }
    ScorePlot {
        title: task.title().into(),
        value_label: "weighted F1, percent".into(),
        series: series.into_iter().map(String::from).collect(),
        rows: lines,
        range: Some((0.0, 100.0)),
    }
}
