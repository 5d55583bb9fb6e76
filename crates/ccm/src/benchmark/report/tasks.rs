//! A table for each task: the paper's methods and those of this run.

use corsmal_report::{Cell, Row, Section, Source, Table};
use rayon::prelude::*;

use crate::benchmark::method::{Method, Part};
use crate::benchmark::results::Rows;
use crate::dataset::Subset;
use crate::error::Result;
use crate::paper::{self, Task, short_inputs};

/// The parts in the order of the tables' columns.
const PARTS: [Part; 4] =
    [Part::Training, Part::Test(Subset::Public), Part::Test(Subset::Private), Part::Combined];

pub(super) fn section(task: Task, rows: &Rows, methods: &[Method], seed: u64) -> Result<Section> {
    // The best first; what was computed here follows the paper's row of the same method.
    let mut lines: Vec<Row> = paper::scores(task)
        .into_iter()
        .rev()
        .map(|p| Row {
            source: Source::Paper,
            cells: vec![
                Cell::Text(p.method.into()),
                Cell::Text(short_inputs(p.inputs)),
                Cell::Text("paper".into()),
                Cell::None,
                Cell::score(Some(p.public)),
                Cell::score(Some(p.private)),
                Cell::score(Some(p.combined)),
            ],
        })
        .collect();
    let cells = |method: &Method| PARTS.map(|part| method.cell(rows, part, task, seed));
    let figures: Vec<[Cell; 4]> = methods.par_iter().map(cells).collect();
    for (method, figures) in methods.iter().zip(figures) {
        if figures.iter().all(|f| *f == Cell::None) {
            continue;
        }
        // The paper's mass table has the tasks that a method addresses in this place.
        let inputs = match task {
            Task::Mass => method.addressed(),
            _ => short_inputs(&method.inputs),
        };
        let names = [&method.name, &inputs, &method.protocol];
        let cells = names.map(|t| Cell::Text(t.to_string())).into_iter().chain(figures).collect();
        let row = Row { source: method.source, cells };
        // The paper has one method with several inputs.
        let name = |line: &Row| match &line.cells[..2] {
            [Cell::Text(name), Cell::Text(inputs)] => format!("{name}, {inputs}"),
            _ => String::new(),
        };
        let same = |line: &Row| line.cells[0] == row.cells[0] || name(line) == method.name;
        match lines.iter().rposition(same) {
            Some(at) => lines.insert(at + 1, row),
            None => lines.push(row),
        }
    }
    let text = match task {
        Task::Level | Task::Type => "Weighted F1 in percent.",
        Task::Capacity => {
            "Mean of exp(-relative error) in percent. The audio baselines do not estimate it."
        }
        Task::Mass => {
            "Mean of exp(-error) in percent, multiplied by the share of the three tasks that a \
             method addresses. Pseudo-random estimates replace the others. For the paper's rows, \
             the inputs are the tasks addressed."
        }
    };
    let mut tables = vec![Table {
        name: task.name().into(),
        caption: format!(
            "{}: the paper's results and those of this run. Training: recordings not trained \
             on, a random 20 % (published) or whole containers (corrected)",
            task.title()
        ),
        columns: ["Method", "Inputs", "Protocol", "Training", "Public", "Private", "Combined"]
            .map(String::from)
            .to_vec(),
        rows: lines,
    }];
    if task == Task::Mass {
        tables.extend(weight(rows, methods, seed));
    }
    Ok(Section { text: vec![text.into()], tables, ..Section::new(task.name(), task.title()) })
}

/// The error of the object's weight, for the methods that estimate all three tasks.
fn weight(rows: &Rows, methods: &[Method], seed: u64) -> Option<Table> {
    let mut lines = Vec::new();
    for method in methods.iter().filter(|m| m.addresses_all()) {
        let figures = PARTS.map(|part| {
            let scores = method.scores(rows, part, seed, &|_| true);
            let error = scores.and_then(|s| s.weight_error);
            error.map_or(Cell::None, |error| Cell::Number(error, format!("{error:.3}")))
        });
        if figures.iter().any(|f| *f != Cell::None) {
            let names = [&method.name, &method.protocol].map(|t| Cell::Text(t.to_string()));
            lines.push(Row {
                source: method.source,
                cells: names.into_iter().chain(figures).collect(),
            });
        }
    }
    let table = Table {
        name: "weight".into(),
        caption: "Mean absolute error in newtons of the weight of container and filling, with the \
                  mass of the empty container known; recordings with an estimated filling mass"
            .into(),
        columns: ["Method", "Protocol", "Training", "Public", "Private", "Combined"]
            .map(String::from)
            .to_vec(),
        rows: lines,
    };
    (!table.rows.is_empty()).then(|| table.without_empty_columns())
}
