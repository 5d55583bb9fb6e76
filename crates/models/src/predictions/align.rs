//! One table from several of the same recordings.

use std::collections::{HashMap, HashSet};
use std::fmt::Display;
use std::hash::Hash;

use corsmal_files::outcome::Status;
use ndarray::Array2;

use super::{
    AGREED, Id, OF_LINES, PredictionError, PredictionRow, PredictionTable, Result, STATUS, content,
};
use crate::fusion::{self, WindowVotes};
use crate::table::argmax;
use crate::voting::VotingRule;

impl<K: Clone + Eq + Hash + Ord + Display> PredictionTable<K> {
    /// Makes the windows of each recording one decision, in the order in which recordings appear. Its status is
    /// the worst of theirs; another column is empty where two of them say different things.
    ///
    /// # Errors
    /// What the rule refuses; a window that occurs twice, windows of a recording that contradict each
    /// other about its true class, fold or group.
    pub fn vote(&self, rule: VotingRule) -> Result<Self> {
        if let Some(fault) = self.repeated_window() {
            return Err(fault);
        }
        let status = self.position(STATUS);
        let mut at: HashMap<&K, usize> = HashMap::new();
        let mut recordings: Vec<(PredictionRow<K>, WindowVotes)> = Vec::new();
        let mut differing: HashSet<(usize, usize)> = HashSet::new();
        for row in &self.rows {
            let next = recordings.len();
            let slot = *at.entry(&row.key).or_insert(next);
            if slot == next {
                recordings.push((row.clone(), WindowVotes::new(self.labels.len())));
            }
            let (recording, votes) = &mut recordings[slot];
            for at in (self.naming..self.columns.len()).filter(|&at| Some(at) != status) {
                let (one, two) = (&mut recording.cells[at], &row.cells[at]);
                let column = self.columns[at].as_str();
                if two.is_empty() || one == two || differing.contains(&(slot, at)) {
                    continue;
                }
                if one.is_empty() {
                    one.clone_from(two);
                } else if self.is_agreed(column) {
                    return Err(self.content(format!(
                        "{}: {column} is {one} in one window and {two} in another; a vote needs \
                         one value for each recording, or a file without the column",
                        row.key
                    )));
                } else {
                    one.clear();
                    differing.insert((slot, at));
                }
            }
            if let Some(at) = status {
                let worst = worse(&recording.cells[at], &row.cells[at]).to_owned();
                recording.cells[at] = worst;
            }
            if let Some(class) = row.class {
                votes.add(class, row.proba.as_deref()).map_err(|e| self.model(e))?;
            }
        }
        let mut rows = Vec::with_capacity(recordings.len());
        for (recording, votes) in recordings {
            let decision = rule.decide(&votes).map_err(|e| self.model(e))?;
            let (class, proba) = decision.map_or((None, None), |(c, p)| (Some(c), p));
            rows.push(PredictionRow { class, proba, ..recording });
        }
        Ok(Self { rows, ..self.clone() }.of_recordings())
    }

    /// Weighted mean of tables over the same recordings, in the order of the first. A recording
    /// without a prediction in one of them, or with a rejected one, has none; one that some table
    /// lacks is allowed where the others have no prediction of it either. Its status is the worst that a table gives.
    ///
    /// # Errors
    /// [`PredictionError`] for no tables, weights that are not one positive number per table, other
    /// classes, recordings with several lines, predictions without probabilities, predictions that a
    /// table has and another has not, and tables that contradict each other about true class, fold or
    /// group of a recording.
    pub fn average(tables: &[Self], weights: Option<&[f64]>) -> Result<Self> {
        let Some(first) = tables.first() else {
            return Err(content("".as_ref(), "no prediction files to average"));
        };
        let mut first = first.clone();
        let mut known: HashSet<K> = first.rows.iter().map(|row| row.key.clone()).collect();
        for table in &tables[1..] {
            for row in table.rows.iter().filter(|row| row.class.is_none()) {
                if known.insert(row.key.clone()) {
                    let cell = |column: &String| table.position(column);
                    let cells = first.columns.iter().map(|column| {
                        cell(column).map_or(String::new(), |at| row.cells[at].clone())
                    });
                    let row = PredictionRow { cells: cells.collect(), ..row.clone() };
                    first.rows.push(row);
                }
            }
        }
        let aligned = tables.iter().map(|t| t.aligned_to(&first)).collect::<Result<Vec<_>>>()?;
        first.agree_with(tables)?;
        first.take_worst_status(tables);
        let equal = vec![1.0; tables.len()];
        let views: Vec<_> = aligned.iter().map(|(values, _)| values.view()).collect();
        let mean =
            fusion::average(&views, weights.unwrap_or(&equal)).map_err(|e| first.model(e))?;
        let rows = first.rows.iter().enumerate().map(|(row, of)| {
            let known = aligned.iter().all(|(_, known)| known[row]);
            let proba = known.then(|| mean.row(row).to_vec());
            let class = proba.as_deref().map(argmax);
            PredictionRow { class, proba, ..of.clone() }
        });
        Ok(Self { rows: rows.collect(), ..first.clone() }.of_recordings())
    }

    /// Refuses a recording with several lines.
    ///
    /// # Errors
    /// [`PredictionError::Rows`] naming it.
    pub fn check_once_each(&self) -> Result<()> {
        let mut seen = HashSet::new();
        match self.rows.iter().find(|row| !seen.insert(&row.key)) {
            Some(row) => Err(self.rows_fault("more than one row", &row.key, self)),
            None => Ok(()),
        }
    }

    /// Whether the rows are windows: several of a recording, told apart by a column `start`.
    ///
    /// # Errors
    /// Several rows of a recording that are no windows, or of one window.
    pub(crate) fn check_windows(&self) -> Result<bool> {
        let Err(repeated) = self.check_once_each() else { return Ok(false) };
        if self.column("start").is_none() {
            return Err(repeated);
        }
        self.repeated_window().map_or(Ok(true), Err)
    }

    /// Why the windows, told apart by their times, cannot be used: one occurs twice.
    fn repeated_window(&self) -> Option<PredictionError> {
        let (starts, ends) = (self.column("start")?, self.column("end"));
        let mut seen = HashSet::new();
        let mut windows = self.rows.iter().zip(&starts).enumerate();
        let (_, (row, start)) = windows.find(|(at, (row, start))| {
            !seen.insert((&row.key, **start, ends.as_ref().map(|ends| ends[*at])))
        })?;
        Some(self.content(format!(
            "more than one row for one window of {}, start {start:?}: remove the repeated lines",
            row.key
        )))
    }

    fn position(&self, name: &str) -> Option<usize> {
        self.columns.iter().position(|column| column == name)
    }

    /// Refuses tables that give a recording two true classes, folds or groups, and takes over what
    /// this one leaves empty. Another column is empty where tables say different things.
    fn agree_with(&mut self, tables: &[Self]) -> Result<()> {
        let others = self.columns[self.naming..].iter().map(String::as_str);
        let others = others.filter(|name| *name != STATUS && !AGREED.contains(name));
        for name in AGREED.into_iter().chain(others) {
            let mut said: HashMap<&K, (&str, &Self)> = HashMap::new();
            // Tables where `fold` is a label contradict nobody.
            let (agreed, others): (Vec<_>, Vec<_>) =
                tables.iter().partition(|table| table.is_agreed(name));
            for table in agreed.into_iter().chain(others) {
                let Some(at) = table.position(name) else { continue };
                for row in table.rows.iter().filter(|row| !row.cells[at].is_empty()) {
                    let own = row.cells[at].as_str();
                    let (their, other) = said.entry(&row.key).or_insert((own, table));
                    if own == *their {
                        continue;
                    }
                    if table.is_agreed(name) {
                        return Err(table.content(format!(
                            "{}: {name} is {own} here and {their} in {}: correct it, or remove \
                             the column {name} from one of the files",
                            row.key,
                            other.path.display()
                        )));
                    }
                    *their = "";
                }
            }
            let Some(at) = self.columns.iter().position(|column| column == name) else { continue };
            for row in &mut self.rows {
                if let Some((value, _)) = said.get(&row.key) {
                    row.cells[at] = (*value).to_string();
                }
            }
        }
        Ok(())
    }

    /// Gives each recording the worst status that a table has of it.
    fn take_worst_status(&mut self, tables: &[Self]) {
        let mut worst: HashMap<&K, &str> = HashMap::new();
        for table in tables {
            let Some(at) = table.position(STATUS) else { continue };
            for row in &table.rows {
                let known = worst.entry(&row.key).or_default();
                *known = worse(known, &row.cells[at]);
            }
        }
        if worst.is_empty() {
            return;
        }
        let at = self.position(STATUS).unwrap_or_else(|| {
            // Where `classify` has it.
            self.columns.insert(self.naming, STATUS.into());
            self.rows.iter_mut().for_each(|row| row.cells.insert(self.naming, String::new()));
            self.naming
        });
        for row in &mut self.rows {
            if let Some(status) = worst.get(&row.key) {
                row.cells[at] = (*status).to_string();
            }
        }
    }

    /// The same without the columns that tell how a single line came about: times, number of windows.
    pub fn of_recordings(self) -> Self {
        let keep: Vec<usize> = (0..self.columns.len())
            .filter(|&at| at < self.naming || !OF_LINES.contains(&self.columns[at].as_str()))
            .collect();
        let columns = keep.iter().map(|&at| self.columns[at].clone()).collect();
        let rows = self.rows.into_iter().map(|row| {
            let cells = keep.iter().map(|&at| row.cells[at].clone()).collect();
            PredictionRow { cells, ..row }
        });
        Self { columns, rows: rows.collect(), ..self }
    }

    /// The rows and classes in the order of another table, which must have the same ones; rows
    /// without probabilities are zero and marked.
    fn aligned_to(&self, other: &Self) -> Result<(Array2<f64>, Vec<bool>)> {
        let mut at = HashMap::new();
        for row in &self.rows {
            if at.insert(&row.key, row).is_some() {
                return Err(self.rows_fault("more than one row", &row.key, other));
            }
        }
        let order: Option<Vec<usize>> =
            other.labels.iter().map(|l| self.labels.iter().position(|own| own == l)).collect();
        let Some(order) = order.filter(|o| o.len() == self.labels.len()) else {
            return Err(self.content(format!(
                "has the classes {}, {} has {}",
                self.labels.join(", "),
                other.path.display(),
                other.labels.join(", ")
            )));
        };
        let mut values = Array2::zeros((other.rows.len(), order.len()));
        let mut known = Vec::with_capacity(other.rows.len());
        for (row, mut to) in other.rows.iter().zip(values.outer_iter_mut()) {
            let Some(own) = at.remove(&row.key) else {
                if row.class.is_none() {
                    known.push(false);
                    continue;
                }
                return Err(self.rows_fault("missing rows", &row.key, other));
            };
            if own.class.is_some() && own.proba.is_none() {
                return Err(self.content(format!(
                    "{}: is predicted without probabilities (p_<label>), and an average needs \
                     them: use a classifier that has them",
                    row.key
                )));
            }
            // A rejected prediction has probabilities, but is none.
            known.push(own.class.is_some());
            if let Some(proba) = &own.proba {
                to.iter_mut().zip(&order).for_each(|(to, &class)| *to = proba[class]);
            }
        }
        match at.keys().min() {
            Some(extra) => Err(self.rows_fault("rows that the first file lacks", extra, other)),
            None => Ok((values, known)),
        }
    }

    fn rows_fault(&self, problem: &'static str, key: &K, other: &Self) -> PredictionError {
        PredictionError::Rows {
            path: self.path.clone(),
            problem,
            row: key.to_string(),
            expected: format!("the lines of {}", other.path.display()),
        }
    }
}

/// Of two statuses the one that more was lost by, the first of equals.
fn worse<'s>(one: &'s str, two: &'s str) -> &'s str {
    let rank = |status: &str| match status {
        "" => 0,
        status if status == Status::Ok.name() => 1,
        status if status == Status::Truncated.name() => 2,
        _ => 3,
    };
    if rank(two) > rank(one) { two } else { one }
}

impl PredictionTable {
    /// The same with the recordings as ids where the rows are windows that `extract --window` made:
    /// ids `RECORDING@START`, or `RECORDING@TIMES` beside a column `recording`.
    ///
    /// # Errors
    /// [`PredictionError::Rows`] for a window that occurs twice.
    pub fn windows_by_recording(mut self) -> Result<Self> {
        let at = self.position("recording");
        let of_window = |row: &PredictionRow<Id>| {
            let (recording, start) = row.key.0.rsplit_once('@')?;
            // A window without features has no labels.
            match at.filter(|&at| !row.cells[at].is_empty()) {
                None => start.parse::<f64>().ok().map(|_| recording.to_owned()),
                Some(at) => {
                    let times = row.key.0.strip_prefix(row.cells[at].as_str())?;
                    times.starts_with('@').then(|| row.cells[at].clone())
                }
            }
        };
        let recordings: Option<Vec<String>> = self.rows.iter().map(of_window).collect();
        if let (Some(recordings), Some(id)) = (recordings, self.position("id")) {
            self.check_once_each()?;
            for (row, recording) in self.rows.iter_mut().zip(recordings) {
                row.cells[id].clone_from(&recording);
                row.key = Id(recording);
            }
        }
        Ok(self)
    }
}
