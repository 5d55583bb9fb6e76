//! Scores by scenario and container.

use corsmal_plot::HeatMap;
use corsmal_report::{Cell, Figure, Row, Section, Source, Table};
use ndarray::Array2;

use crate::benchmark::method::{Method, Part, of_task};
use crate::benchmark::results::{Rows, Target, TestPart};
use crate::dataset::Subset;
use crate::error::Result;
use crate::paper::{self, Task};

pub(super) fn section(rows: &Rows, methods: &[Method], seed: u64) -> Result<Section> {
    let mut tables = Vec::new();
    for task in Task::ALL {
        for (part, containers, name) in
            [(Part::Training, 1..=9u8, "training"), (Part::Combined, 10..=15, "test")]
        {
            let mut lines = Vec::new();
            if matches!(part, Part::Combined) {
                lines.extend(paper::breakdown(task).into_iter().map(|p| {
                    let scores = p.parts.iter().map(|(_, score)| Cell::score(Some(*score)));
                    let name = Cell::Text(p.method.into());
                    Row {
                        source: Source::Paper,
                        cells: std::iter::once(name).chain(scores).collect(),
                    }
                }));
            }
            let of_task_here = |m: &&Method| match task {
                // Stand-ins for tasks that are not addressed say nothing about containers.
                Task::Mass => m.addresses_all(),
                _ => !m.completes(),
            };
            for method in methods.iter().filter(|m| m.protocol != "published").filter(of_task_here)
            {
                let is_labelled = |part: &&Part| match part {
                    Part::Training => true,
                    Part::Test(subset) => {
                        rows.tests.iter().any(|test| test.subset == *subset && test.is_labelled())
                    }
                    Part::Combined => rows.tests.iter().all(TestPart::is_labelled),
                };
                // One test part alone still has scores by container.
                let figure = |keep: &dyn Fn(&Target) -> bool| {
                    let whole = [part, Part::Test(Subset::Public), Part::Test(Subset::Private)];
                    let parts = if matches!(part, Part::Training) { &whole[..1] } else { &whole };
                    let scores = parts
                        .iter()
                        .filter(is_labelled)
                        .find_map(|p| method.scores(rows, *p, seed, keep));
                    Cell::score(scores.and_then(|s| of_task(task, &s)))
                };
                let scenario =
                    |s: u8| figure(&|t: &Target| t.recording.name.is_some_and(|n| n.scenario == s));
                let container = |c: u8| {
                    figure(&|t: &Target| t.recording.container.is_some_and(|k| k.number() == c))
                };
                let figures: Vec<Cell> =
                    (0..3).map(scenario).chain(containers.clone().map(container)).collect();
                if figures.iter().any(|f| *f != Cell::None) {
                    let name = std::iter::once(Cell::Text(method.name.clone()));
                    let cells = name.chain(figures).collect();
                    lines.push(Row { source: method.source, cells });
                }
            }
            if lines.is_empty() {
                continue;
            }
            let columns = std::iter::once("Method".to_string())
                .chain((0..3).map(|s| format!("Scenario {s}")))
                .chain(containers.map(|c| format!("C{c}")));
            let table = Table {
                name: format!("{}-by-container-{name}", task.name()),
                caption: format!("{}, {name} containers, percent", task.title()),
                columns: columns.collect(),
                rows: lines,
            };
            tables.push(table.without_empty_columns());
        }
    }
    let figures = tables.iter().map(|t| Figure::new(&t.name, "", &heat_map(t)));
    Ok(Section {
        text: vec![
            "Scenario 0: on a table; 1: in the hand; 2: standing away from the table. Cups are \
             containers 1 to 3, 10 and 13, glasses 4 to 6, 11 and 14, boxes 7 to 9, 12 and 15. \
             Baselines are the corrected ones."
                .into(),
        ],
        figures: figures.collect::<corsmal_report::Result<_>>()?,
        tables,
        ..Section::new("by-container", "By scenario and container")
    })
}

/// The same numbers as colours.
fn heat_map(table: &Table) -> HeatMap {
    let name = |row: &Row| match (&row.cells[0], row.source) {
        (Cell::Text(name), Source::Paper) => format!("{name} (paper)"),
        (Cell::Text(name), _) => name.clone(),
        _ => String::new(),
    };
    let size = (table.rows.len(), table.columns.len() - 1);
    let value = |(r, c): (usize, usize)| table.rows[r].cells[c + 1].value().unwrap_or(f64::NAN);
    let (title, unit) = table.caption.rsplit_once(", ").unwrap_or((&table.caption, ""));
    HeatMap {
        title: title.to_owned(),
        value_label: format!("score, {unit}"),
        rows: table.rows.iter().map(name).collect(),
        columns: table.columns[1..].to_vec(),
        values: Array2::from_shape_fn(size, value),
        range: (0.0, 100.0),
    }
}
