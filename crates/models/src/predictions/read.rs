//! Reading prediction files.

use std::collections::HashMap;
use std::path::Path;

use corsmal_files::csv_text::{self, Fault};

use super::{
    Id, KEYS, MAX_BYTES, PredictionError, PredictionRow, PredictionTable, Result, SUM_TOLERANCE,
    UNKNOWN, content,
};
use crate::labels::{Labels, positions};
use crate::table::argmax;

impl PredictionTable {
    /// Reads a file; a recording may have several lines, one for each of its windows. A column `id`
    /// names it; without one, `Object` or `container` with `sequence` do so together, else `path`.
    ///
    /// # Errors
    /// [`PredictionError`] for a file that is not a table, missing columns, no lines, probabilities
    /// that are not 0 to 1 with sum 1, and predictions that are no class.
    pub fn read(path: &Path) -> Result<Self> {
        let bytes = corsmal_files::content::read(path, MAX_BYTES)
            .map_err(|source| PredictionError::Io { path: path.into(), source })?;
        Self::parse(&bytes, path)
    }

    /// The same from bytes; `path` is named in errors.
    ///
    /// # Errors
    /// As [`PredictionTable::read`].
    pub fn parse(bytes: &[u8], path: &Path) -> Result<Self> {
        // A line of `classify --json`.
        if bytes.trim_ascii_start().starts_with(b"{") {
            let reason = "is JSON, but prediction files are read as CSV: `classify` without --json \
                          writes it";
            return Err(content(path, reason));
        }
        let mut reader = csv_text::reader(bytes).map_err(|e| content(path, e.to_string()))?;
        let fault = |fault: Fault| content(path, format!("not a readable table: {fault}"));
        let header = csv_text::header(&mut reader).map_err(fault)?;
        let header: Vec<String> = header.iter().map(String::from).collect();
        let lines: Vec<_> = csv_text::records(&mut reader)
            .collect::<std::result::Result<_, Fault>>()
            .map_err(fault)?;
        if lines.is_empty() {
            return Err(content(path, "has no predictions"));
        }
        PredictionColumns::find(path, &header, &lines)?.table(path, &header, &lines)
    }
}

/// Columns that are known by their names, ignoring case.
const MEANT: [&str; 8] =
    ["id", "path", "true", "predicted", "sequence", "object", "container", "container id"];

type Lines = [(u64, csv::StringRecord)];

/// Columns by what they hold.
struct PredictionColumns {
    naming: Vec<usize>,
    /// whether these name a recording together, else the first of them does
    together: bool,
    others: Vec<usize>,
    /// one per class; none in files without probabilities
    proba: Vec<usize>,
    predicted: Option<usize>,
    labels: Vec<String>,
}

impl PredictionColumns {
    fn find(path: &Path, header: &[String], lines: &Lines) -> Result<Self> {
        if let Some(column) = csv_text::repeated(header) {
            return Err(content(path, format!("two columns are named {column:?}")));
        }
        // `True` beside `true` leaves open which one is meant.
        for name in MEANT {
            if header.iter().filter(|h| h.eq_ignore_ascii_case(name)).count() > 1 {
                return Err(content(
                    path,
                    format!("two columns are named {name:?} (case is ignored); rename one"),
                ));
            }
        }
        let find = |name: &str| header.iter().position(|h| h.eq_ignore_ascii_case(name));
        let container = ["Object", "container", "Container ID"].iter().find_map(|n| find(n));
        let lacking = |column: &str| PredictionError::Column {
            path: path.into(),
            column: column.into(),
            header: header.join(", "),
        };
        let keys = KEYS.iter().filter_map(|name| find(name)).collect::<Vec<_>>();
        // Beside ids, columns of these names are labels.
        let has_id = KEYS.iter().any(|name| *name != "path" && find(name).is_some());
        let (naming, together) = match (container, find("sequence")) {
            (Some(container), Some(sequence)) if !has_id => (vec![container, sequence], true),
            _ => (keys, false),
        };
        if naming.is_empty() {
            return Err(lacking("id, path, or container and sequence"));
        }
        let numbered: Vec<usize> = (0..).map_while(|c| find(&format!("p{c}"))).collect();
        let named: Vec<usize> =
            (0..header.len()).filter(|&i| header[i].starts_with("p_")).collect();
        // Beside columns of the classes by name, `p0` and `p1` are labels.
        let proba = if numbered.len() > 1 && named.len() < 2 { numbered } else { named };
        let predicted = find("predicted");
        let labels = match (proba.len(), predicted) {
            (0, None) => {
                return Err(lacking(
                    "predicted, nor p_<label> (or p0, p1, …) for each of two or more classes",
                ));
            }
            // Without probabilities the classes are those that occur.
            (0, Some(predicted)) => {
                let values = |at: usize| lines.iter().map(move |(_, line)| &line[at]);
                let truth: Vec<&str> = find("true").into_iter().flat_map(values).collect();
                // What is true somewhere is a class, and no word for a rejected prediction.
                let is_true = truth.contains(&UNKNOWN);
                let is_class = |v: &&str| !v.is_empty() && (*v != UNKNOWN || is_true);
                let all = truth.iter().copied().chain(values(predicted));
                let given: Vec<&str> = all.filter(is_class).collect();
                Labels::of(&given).0.names().to_vec()
            }
            (1, _) => return Err(lacking("p_<label> for each of two or more classes")),
            _ => {
                let label = |&at: &usize| {
                    let name = &header[at];
                    name.strip_prefix("p_").or(name.strip_prefix('p')).unwrap_or(name).to_string()
                };
                proba.iter().map(label).collect()
            }
        };
        if let Some(twice) = csv_text::repeated(&labels) {
            return Err(content(path, format!("two columns for the class {twice}")));
        }
        let taken = |i: &usize| naming.contains(i) || proba.contains(i) || predicted == Some(*i);
        let others = (0..header.len()).filter(|i| !taken(i)).collect();
        Ok(Self { naming, together, others, proba, predicted, labels })
    }

    fn table(self, path: &Path, header: &[String], lines: &Lines) -> Result<PredictionTable> {
        let order: Vec<usize> = self.naming.iter().chain(&self.others).copied().collect();
        let classes = positions(&self.labels);
        let rows = lines.iter().map(|line| self.row(path, header, line, (&order, &classes)));
        Ok(PredictionTable {
            path: path.into(),
            columns: order.iter().map(|&at| header[at].clone()).collect(),
            naming: self.naming.len(),
            rows: rows.collect::<Result<_>>()?,
            labels: self.labels,
            unmatched: None,
        })
    }

    fn row(
        &self,
        path: &Path,
        header: &[String],
        (line, record): &(u64, csv::StringRecord),
        (order, classes): (&[usize], &HashMap<&str, usize>),
    ) -> Result<PredictionRow> {
        let text = |at: usize| record.get(at).unwrap_or_default();
        let refuse = |at: usize, expected: String| {
            Err(PredictionError::Value {
                path: path.into(),
                line: *line,
                column: header[at].clone(),
                value: text(at).into(),
                expected,
            })
        };
        let mut proba = Vec::with_capacity(self.proba.len());
        if !self.proba.iter().all(|&at| text(at).trim().is_empty()) {
            for &at in &self.proba {
                match text(at).trim().parse::<f64>() {
                    Ok(p) if (0.0..=1.0 + SUM_TOLERANCE).contains(&p) => proba.push(p),
                    _ => return refuse(at, "a probability (0 to 1)".into()),
                }
            }
            let sum: f64 = proba.iter().sum();
            if (sum - 1.0).abs() > SUM_TOLERANCE {
                let reason = format!("line {line}: the probabilities add up to {sum}, not 1");
                return Err(content(path, reason));
            }
        }
        let proba = (!proba.is_empty()).then_some(proba);
        let class = match self.predicted.map(|at| (at, text(at))) {
            Some((_, UNKNOWN)) if !classes.contains_key(UNKNOWN) => None,
            None | Some((_, "")) => proba.as_deref().map(argmax),
            // Other programs may leave the blanks out of the header.
            Some((at, name)) => match classes.get(name).or_else(|| classes.get(name.trim())) {
                Some(class) => Some(*class),
                None => {
                    let choices =
                        corsmal_names::choices(name, self.labels.iter().map(String::as_str));
                    return refuse(at, format!("one of the classes of the header: {choices}"));
                }
            },
        };
        let cells: Vec<String> = order.iter().map(|&at| text(at).to_string()).collect();
        let named_by = if self.together { self.naming.len() } else { 1 };
        let key = Id(cells[..named_by].join("/"));
        Ok(PredictionRow { key, cells, class, proba })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A class of this name was never right.
    #[test]
    fn unknown_is_a_class_where_it_is_true() {
        let read = |text: &str| {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), text).unwrap();
            PredictionTable::read(file.path()).unwrap()
        };
        let classes =
            |table: &PredictionTable| table.rows.iter().map(|row| row.class).collect::<Vec<_>>();
        let table = read("id,true,predicted\n1,unknown,unknown\n2,x,x\n3,x,unknown\n4,x,\n");
        assert_eq!(table.labels, ["unknown", "x"]);
        assert_eq!(classes(&table), [Some(0), Some(1), Some(0), None]);
        let table = read("id,true,predicted\n1,y,unknown\n2,x,x\n");
        assert_eq!((table.labels.len(), classes(&table)), (2, vec![None, Some(0)]));
    }
}
