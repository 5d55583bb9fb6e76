//! The results that the paper prints (Xompero et al., "The CORSMAL benchmark for the prediction of
//! the properties of containers", 2022), as figures in percent.

use serde::Serialize;

const SCORES: &str = include_str!("../data/paper_scores.csv");
const BREAKDOWN: &str = include_str!("../data/paper_breakdown.csv");

/// What a table of the paper scores.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Task {
    /// T1, filling level: weighted F1.
    Level,
    /// T2, filling type: weighted F1.
    Type,
    /// T3, container capacity.
    Capacity,
    /// Filling mass.
    Mass,
}

impl Task {
    /// All tasks in the paper's order.
    pub const ALL: [Self; 4] = [Self::Level, Self::Type, Self::Capacity, Self::Mass];

    /// Name in the paper.
    pub fn title(self) -> &'static str {
        match self {
            Self::Level => "Filling level (T1)",
            Self::Type => "Filling type (T2)",
            Self::Capacity => "Container capacity (T3)",
            Self::Mass => "Filling mass",
        }
    }

    /// Short name, as in file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Level => "level",
            Self::Type => "type",
            Self::Capacity => "capacity",
            Self::Mass => "mass",
        }
    }
}

/// A row of a results table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaperScore {
    /// Method as the paper names it.
    pub method: &'static str,
    /// What it uses, joined by `+`; for the mass, the tasks it addresses.
    pub inputs: &'static str,
    /// On the public test set.
    pub public: f64,
    /// On the private test set.
    pub private: f64,
    /// On both.
    pub combined: f64,
}

impl PaperScore {
    /// Whether this is the row of a method, which may name its inputs as well.
    pub(crate) fn is_of(&self, method: &str) -> bool {
        self.method == method || method == named(self.method, self.inputs)
    }
}

/// A method with one of its inputs.
pub(crate) fn named(method: &str, inputs: &str) -> String {
    format!("{method}, {}", short_inputs(inputs))
}

/// `audio+rgb1+rgb2` as "audio, RGB 1 2".
pub(crate) fn short_inputs(inputs: &str) -> String {
    let mut text = String::new();
    let mut last = "";
    for part in inputs.split('+').filter(|p| !p.is_empty()) {
        let kind = part.trim_end_matches(|c: char| c.is_ascii_digit());
        if kind != last {
            let comma = if text.is_empty() { "" } else { ", " };
            let name = if kind == "rgb" { "RGB" } else { kind };
            text.push_str(&format!("{comma}{name}"));
        }
        let view = &part[kind.len()..];
        if !view.is_empty() {
            text.push_str(&format!(" {view}"));
        }
        last = kind;
    }
    text
}

/// Scores of a method by scenario and by test container.
#[derive(Clone, Debug, PartialEq)]
pub struct PaperBreakdown {
    /// Method as the paper names it.
    pub method: &'static str,
    /// Part (`scenario 0` to `scenario 2`, `container 10` to `container 15`) and score.
    pub parts: Vec<(&'static str, f64)>,
}

/// The table of a task, in the paper's order (ascending).
pub fn scores(task: Task) -> Vec<PaperScore> {
    let rows = SCORES.lines().skip(1).map(|line| line.split(',').collect::<Vec<_>>());
    rows.filter(|cells| cells[0] == task.name())
        .map(|cells| PaperScore {
            method: cells[1],
            inputs: cells[2],
            public: figure(cells[3]),
            private: figure(cells[4]),
            combined: figure(cells[5]),
        })
        .collect()
}

/// The table by scenario and container of a task; empty for the mass.
pub fn breakdown(task: Task) -> Vec<PaperBreakdown> {
    let mut table: Vec<PaperBreakdown> = Vec::new();
    for line in BREAKDOWN.lines().skip(1) {
        let cells: Vec<_> = line.split(',').collect();
        if cells[0] != task.name() {
            continue;
        }
        let part = (cells[2], figure(cells[3]));
        match table.last_mut().filter(|row| row.method == cells[1]) {
            Some(row) => row.parts.push(part),
            None => table.push(PaperBreakdown { method: cells[1], parts: vec![part] }),
        }
    }
    table
}

/// The tables are part of this crate and their numbers are checked by a test.
fn figure(text: &str) -> f64 {
    text.parse().unwrap_or(f64::NAN)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_complete_and_numeric() {
        for (task, rows) in Task::ALL.into_iter().zip([22, 23, 5, 7]) {
            let table = scores(task);
            assert_eq!(table.len(), rows, "{task:?}");
            for row in table {
                for value in [row.public, row.private, row.combined] {
                    assert!((0.0..=100.0).contains(&value), "{row:?}");
                }
            }
        }
        for (task, rows) in Task::ALL.into_iter().zip([5, 6, 4, 0]) {
            let table = breakdown(task);
            assert_eq!(table.len(), rows, "{task:?}");
            assert!(table.iter().all(|r| r.parts.len() == 9 && r.parts.iter().all(|p| p.1 > 0.0)));
        }
    }

    /// The capacity of the public set is the mean over its containers weighted by recordings.
    #[test]
    fn capacity_is_consistent() {
        for row in breakdown(Task::Capacity) {
            let c = |i: usize| row.parts[2 + i].1;
            let mean = (84.0 * c(1) + 84.0 * c(2) + 60.0 * c(3)) / 228.0;
            let table = scores(Task::Capacity);
            let printed = table.iter().find(|r| r.method == row.method).unwrap().public;
            assert!((mean - printed).abs() < 0.01, "{}", row.method);
        }
    }
}
