//! Tables of class probabilities by recording, and their late fusion.
//!
//! Read are the files of `classify` and `cross-validate` (`id` or `path`, then `p_<label>` for each
//! class) and those that M5 published (`Object,Sequence`, then `p0`, `p1`, …).

use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::{Path, PathBuf};

use corsmal_models::{argmax, fusion};
use ndarray::{Array2, ArrayView2};

use crate::dataset::{Container, PathParts, SequenceName};
use crate::error::{CcmError, Result};
use crate::submission::{RowKey, SUM_TOLERANCE};
use crate::table::Table;

/// What tells recordings apart.
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RowName {
    /// A recording of the data set.
    Recording(RowKey),
    /// Anything else, by its id.
    Other(String),
}

impl fmt::Display for RowName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Recording(key) => key.fmt(f),
            Self::Other(id) => write!(f, "id {id}"),
        }
    }
}

/// A line of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbabilityRow {
    /// The recording.
    pub name: RowName,
    /// Text of the columns that name it.
    pub text: Vec<String>,
    /// The class predicted, or else the most probable one; `None` without a prediction.
    pub class: Option<usize>,
    /// One per class; `None` where the classifier gave none.
    pub proba: Option<Vec<f64>>,
}

/// Class probabilities of recordings, or of their windows.
#[derive(Clone, Debug, PartialEq)]
pub struct ProbabilityTable {
    /// Where they were read from.
    pub path: PathBuf,
    /// Columns that name a recording.
    pub naming: Vec<String>,
    /// Name of each class.
    pub labels: Vec<String>,
    /// The lines, in the order of the file.
    pub rows: Vec<ProbabilityRow>,
}

/// Columns of a table by what they hold.
struct Columns {
    naming: Vec<usize>,
    /// container and sequence number
    sequence: Option<(usize, usize)>,
    classes: Vec<usize>,
    predicted: Option<usize>,
}

impl ProbabilityTable {
    /// Reads a table; a recording may have several lines, one for each of its windows.
    ///
    /// # Errors
    /// [`CcmError`] for missing columns, no lines, sequences that are neither numbers nor names of the data
    /// set, probabilities that are not 0 to 1 with sum 1, and predictions that are no class.
    pub fn read(path: &Path) -> Result<Self> {
        let table = Table::read(path)?;
        let columns = Columns::find(&table)?;
        if table.rows() == 0 {
            return Err(CcmError::Request(format!("{}: has no predictions", path.display())));
        }
        let header = |&at: &usize| table.header()[at].clone();
        let label = |at: &usize| {
            let name = header(at);
            name.strip_prefix("p_").or(name.strip_prefix('p')).unwrap_or(&name).to_string()
        };
        let labels: Vec<String> = columns.classes.iter().map(label).collect();
        let rows = (0..table.rows()).map(|row| read_row(&table, row, &columns, &labels));
        let mut rows = rows.collect::<Result<Vec<_>>>()?;
        // Ids of other data may look like recordings of this one without being told apart by that.
        let mut texts = HashMap::new();
        let unclear = |row: &ProbabilityRow| {
            texts.insert(row.name.clone(), row.text.clone()).is_some_and(|other| other != row.text)
        };
        if columns.sequence.is_none() && rows.iter().any(unclear) {
            rows.iter_mut().for_each(|row| row.name = RowName::Other(row.text[0].clone()));
        }
        let naming = columns.naming.iter().map(header).collect();
        Ok(Self { path: path.to_path_buf(), naming, labels, rows })
    }

    /// Makes the windows of each recording one decision, in the order in which recordings appear.
    /// `decide` gives class and probabilities.
    ///
    /// # Errors
    /// What `decide` refuses.
    pub fn vote<E: From<CcmError>>(
        &self,
        decide: impl Fn(
            &fusion::WindowVotes,
        ) -> std::result::Result<Option<(usize, Option<Vec<f64>>)>, E>,
    ) -> std::result::Result<Self, E> {
        let mut at: HashMap<&RowName, usize> = HashMap::new();
        let mut recordings: Vec<(&ProbabilityRow, fusion::WindowVotes)> = Vec::new();
        for row in &self.rows {
            let next = recordings.len();
            let slot = *at.entry(&row.name).or_insert(next);
            if slot == next {
                recordings.push((row, fusion::WindowVotes::new(self.labels.len())));
            }
            if let Some(class) = row.class {
                recordings[slot]
                    .1
                    .add(class, row.proba.as_deref())
                    .map_err(|e| CcmError::Request(format!("{}: {e}", self.path.display())))?;
            }
        }
        let mut rows = Vec::with_capacity(recordings.len());
        for (first, votes) in recordings {
            let decision = decide(&votes)?;
            let (class, proba) = decision.map_or((None, None), |(c, p)| (Some(c), p));
            rows.push(ProbabilityRow { class, proba, ..first.clone() });
        }
        Ok(Self { rows, ..self.clone() })
    }

    /// Weighted mean of tables over the same recordings, in the order of the first. A recording
    /// without probabilities in one of them has none.
    ///
    /// # Errors
    /// [`CcmError`] for no tables, weights that are not one positive number per table, other
    /// classes, recordings with several lines, and ones that a table has and another has not.
    pub fn average(tables: &[Self], weights: Option<&[f64]>) -> Result<Self> {
        let Some(first) = tables.first() else {
            return Err(CcmError::Request("no prediction files to average".into()));
        };
        let aligned = tables.iter().map(|t| t.aligned_to(first)).collect::<Result<Vec<_>>>()?;
        let equal = vec![1.0; tables.len()];
        let views: Vec<_> = aligned.iter().map(|(values, _)| values.view()).collect();
        let mean = fusion::average(&views, weights.unwrap_or(&equal))
            .map_err(|e| CcmError::Request(format!("fusion by averaging: {e}")))?;
        let rows = first.rows.iter().enumerate().map(|(row, of)| {
            let known = aligned.iter().all(|(_, known)| known[row]);
            let proba = known.then(|| mean.row(row).to_vec());
            let class = proba.as_deref().map(argmax);
            ProbabilityRow { class, proba, ..of.clone() }
        });
        Ok(Self { rows: rows.collect(), ..first.clone() })
    }

    /// Refuses a recording with several lines.
    ///
    /// # Errors
    /// [`CcmError::Rows`] naming it.
    pub fn check_once_each(&self) -> Result<()> {
        let mut seen = HashSet::new();
        match self.rows.iter().find(|row| !seen.insert(&row.name)) {
            Some(row) => Err(self.rows_fault("more than one row", &row.name, self)),
            None => Ok(()),
        }
    }

    /// The rows and classes in the order of another table, which must have the same ones; rows
    /// without probabilities are zero and marked.
    fn aligned_to(&self, other: &Self) -> Result<(Array2<f64>, Vec<bool>)> {
        let mut at = HashMap::new();
        for row in &self.rows {
            if at.insert(&row.name, row).is_some() {
                return Err(self.rows_fault("more than one row", &row.name, other));
            }
        }
        let order: Option<Vec<usize>> =
            other.labels.iter().map(|l| self.labels.iter().position(|own| own == l)).collect();
        let Some(order) = order.filter(|o| o.len() == self.labels.len()) else {
            return Err(CcmError::Request(format!(
                "{}: has the classes {}, {} has {}",
                self.path.display(),
                self.labels.join(", "),
                other.path.display(),
                other.labels.join(", ")
            )));
        };
        let mut values = Array2::zeros((other.rows.len(), order.len()));
        let mut known = Vec::with_capacity(other.rows.len());
        for (row, mut to) in other.rows.iter().zip(values.outer_iter_mut()) {
            let Some(own) = at.remove(&row.name) else {
                return Err(self.rows_fault("missing rows", &row.name, other));
            };
            known.push(own.proba.is_some());
            if let Some(proba) = &own.proba {
                to.iter_mut().zip(&order).for_each(|(to, &class)| *to = proba[class]);
            }
        }
        match at.keys().min() {
            Some(extra) => Err(self.rows_fault("rows that the first file lacks", extra, other)),
            None => Ok((values, known)),
        }
    }

    fn rows_fault(&self, problem: &'static str, name: &RowName, other: &Self) -> CcmError {
        CcmError::Rows {
            path: self.path.clone(),
            problem,
            rows: name.to_string(),
            expected: format!("the {} lines of {}", other.rows.len(), other.path.display()),
        }
    }

    /// Probabilities `[lines, classes of into]`: each class of the table is one of `n_classes`
    /// others. Zero where there are none.
    ///
    /// # Errors
    /// Classes outside `n_classes`.
    pub fn merged(&self, into: &[usize], n_classes: usize) -> Result<Array2<f64>> {
        let mut all = Vec::with_capacity(self.rows.len() * self.labels.len());
        for row in &self.rows {
            match &row.proba {
                Some(proba) => all.extend_from_slice(proba),
                None => all.extend(std::iter::repeat_n(0.0, self.labels.len())),
            }
        }
        let fault =
            |e: &dyn fmt::Display| CcmError::Request(format!("{}: {e}", self.path.display()));
        let all = ArrayView2::from_shape((self.rows.len(), self.labels.len()), &all)
            .map_err(|e| fault(&e))?;
        fusion::merge_classes(all, into, n_classes).map_err(|e| fault(&e))
    }

    /// What each class of the table is, by its name.
    ///
    /// # Errors
    /// A name that `parse` does not know; `what` says what is expected.
    pub fn classes<T>(&self, parse: impl Fn(&str) -> Option<T>, what: &str) -> Result<Vec<T>> {
        let class = |label: &String| {
            parse(label).ok_or_else(|| {
                let path = self.path.display();
                CcmError::Request(format!("{path}: class '{label}' is not {what}"))
            })
        };
        self.labels.iter().map(class).collect()
    }
}

impl Columns {
    fn find(table: &Table) -> Result<Self> {
        let any = |names: &[&str]| names.iter().find_map(|n| table.find(n));
        let container = any(&["Object", "container", "Container ID"]);
        let sequence = container.zip(table.find("sequence"));
        let naming: Vec<usize> = match sequence {
            Some((container, sequence)) => vec![container, sequence],
            None => {
                ["id", "Configuration ID", "path"].iter().filter_map(|n| table.find(n)).collect()
            }
        };
        if naming.is_empty() {
            return Err(CcmError::Column {
                path: table.path().to_path_buf(),
                column: "id', 'path' or 'container' and 'sequence".into(),
                header: table.header().join(", "),
            });
        }
        let numbered: Vec<usize> = (0..).map_while(|c| table.find(&format!("p{c}"))).collect();
        let named = |(at, name): (usize, &String)| name.starts_with("p_").then_some(at);
        let classes = if numbered.len() > 1 {
            numbered
        } else {
            table.header().iter().enumerate().filter_map(named).collect()
        };
        if classes.len() < 2 {
            return Err(CcmError::Column {
                path: table.path().to_path_buf(),
                column: "p_<label>' (or 'p0', 'p1', …) for each of two or more classes".into(),
                header: table.header().join(", "),
            });
        }
        Ok(Self { naming, sequence, classes, predicted: table.find("predicted") })
    }
}

fn read_row(
    table: &Table,
    row: usize,
    columns: &Columns,
    labels: &[String],
) -> Result<ProbabilityRow> {
    let text: Vec<String> =
        columns.naming.iter().map(|&at| table.text(row, at).to_string()).collect();
    let name = match columns.sequence {
        Some((container, sequence)) => {
            RowName::Recording(sequence_key(table, row, container, sequence)?)
        }
        None => {
            // A path tells more than an id does, where it leads through the container's folder.
            let keys = text.iter().rev().filter_map(|t| PathParts::of(Path::new(t)).key());
            let keys: Vec<RowKey> = keys.collect();
            let whole = keys.iter().find(|k| matches!(k, RowKey::Sequence(..)));
            match whole.or(keys.first()) {
                Some(key) => RowName::Recording(*key),
                None => RowName::Other(text[0].clone()),
            }
        }
    };
    let mut proba = Vec::with_capacity(columns.classes.len());
    let blank = |&at: &usize| table.text(row, at).is_empty();
    if !columns.classes.iter().all(blank) {
        for &class in &columns.classes {
            let p = table.number(row, class)?;
            if !(0.0..=1.0 + SUM_TOLERANCE).contains(&p) {
                return Err(table.fault(row, class, "a probability (0 to 1)"));
            }
            proba.push(p);
        }
        let sum: f64 = proba.iter().sum();
        if (sum - 1.0).abs() > SUM_TOLERANCE {
            return Err(CcmError::Request(format!(
                "{}, line {}: the probabilities have the sum {sum}, not 1",
                table.path().display(),
                table.line(row)
            )));
        }
    }
    let proba = (!proba.is_empty()).then_some(proba);
    let class = match columns.predicted.filter(|&at| !table.text(row, at).is_empty()) {
        None => proba.as_deref().map(argmax),
        Some(at) => {
            let found = labels.iter().position(|l| l == table.text(row, at));
            Some(found.ok_or_else(|| table.fault(row, at, "one of the classes of the header"))?)
        }
    };
    Ok(ProbabilityRow { name, text, class, proba })
}

/// The recording named by container and sequence, the latter a number or a name.
fn sequence_key(table: &Table, row: usize, container: usize, sequence: usize) -> Result<RowKey> {
    let number = u8::try_from(table.integer(row, container)?)
        .map_err(|_| table.fault(row, container, "a container number"))?;
    let text = table.text(row, sequence);
    let position = text.parse().ok().or_else(|| {
        Container::new(number).zip(SequenceName::parse(text)).and_then(|(c, name)| name.number(c))
    });
    match position {
        Some(position) => Ok(RowKey::Sequence(number, position)),
        None => {
            Err(table.fault(row, sequence, "a sequence number or name such as s0_fi1_fu2_b0_l0"))
        }
    }
}

/// Capacity estimates by recording: columns `fileName` (`id10_0000.png`: container and sequence
/// number) and `capacity[mL]`, as M5 published them; -1 is no estimate.
///
/// # Errors
/// [`CcmError`] with line and column for other values, and for recordings that occur twice.
pub fn read_capacities(path: &Path) -> Result<HashMap<RowKey, Option<f64>>> {
    let table = Table::read(path)?;
    let file = table.column("fileName")?;
    let capacity = table.column("capacity[mL]")?;
    let mut by_key = HashMap::new();
    let mut seen = HashSet::new();
    for row in 0..table.rows() {
        let stem = table.text(row, file).trim_start_matches("id");
        let stem = stem.split('.').next().unwrap_or_default();
        let key = stem
            .split_once('_')
            .and_then(|(c, s)| Some(RowKey::Sequence(c.parse().ok()?, s.parse().ok()?)))
            .ok_or_else(|| table.fault(row, file, "a name such as id10_0000.png"))?;
        if !seen.insert(key) {
            return Err(table.fault(row, file, "a name that occurs once"));
        }
        let value = table.number(row, capacity)?;
        by_key.insert(key, (value > -1.0).then_some(value));
    }
    Ok(by_key)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> ProbabilityTable {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        ProbabilityTable::read(file.path()).unwrap()
    }

    #[test]
    fn averages_by_row_and_class_name_with_weights() {
        let a = table("id,p_x,p_y\nr,0.9,0.1\ns,0.4,0.6\n");
        let b = table("id,p_y,p_x\ns,0.9,0.1\nr,0.2,0.8\n");
        let mean = ProbabilityTable::average(&[a, b], Some(&[1.0, 3.0])).unwrap();
        let proba = mean.rows[0].proba.as_ref().unwrap();
        assert!((proba[0] - (0.9 + 3.0 * 0.8) / 4.0).abs() < 1e-12);
        assert_eq!(mean.rows.iter().map(|r| r.class.unwrap()).collect::<Vec<_>>(), [0, 1]);
    }

    #[test]
    fn refuses_other_rows_classes_and_weights() {
        let a = table("id,p_x,p_y\nr,1,0\ns,1,0\n");
        let message = |b: &ProbabilityTable, weights: Option<&[f64]>| {
            let tables = [a.clone(), b.clone()];
            ProbabilityTable::average(&tables, weights).unwrap_err().to_string()
        };
        let less = table("id,p_x,p_y\nr,1,0\n");
        assert!(message(&less, None).contains("missing rows: id s"));
        let more = table("id,p_x,p_y\nr,1,0\ns,1,0\nt,1,0\n");
        assert!(message(&more, None).contains("rows that the first file lacks: id t"));
        let twice = table("id,p_x,p_y\nr,1,0\nr,1,0\n");
        assert!(message(&twice, None).contains("more than one row: id r"));
        assert!(message(&table("id,p_x,p_z\nr,1,0\ns,1,0\n"), None).contains("classes x, z"));
        assert!(message(&a, Some(&[1.0])).contains("weights"));
        assert!(ProbabilityTable::average(&[], None).is_err());
    }

    #[test]
    fn recordings_are_known_by_path_number_and_name() {
        let ours = table(
            "id,path,status,predicted,p_0,p_1\n\
             0002_audio,test/10/audio/0002_audio.wav,ok,0,1,0\n\
             1/audio/s0_fi1_fu1_b0_l0_audio,x,ok,1,0.5,0.5\n\
             000007,000007.wav,ok,0,1,0\nhello,hello.wav,corrupt,,,\n",
        );
        let names: Vec<_> = ours.rows.iter().map(|r| r.name.clone()).collect();
        let key = RowName::Recording;
        assert_eq!(names[..2], [RowKey::Sequence(10, 2), RowKey::Sequence(1, 1)].map(key));
        assert_eq!(names[2..], [key(RowKey::Id(7)), RowName::Other("hello".into())]);
        // The classifier's own word counts where probabilities are equal.
        assert_eq!(ours.rows[1].class, Some(1));
        assert_eq!((ours.rows[3].class, ours.rows[3].proba.clone()), (None, None));
        let m5 = table("Object,Sequence,p0,p1\n10,0002,1,0\n1,s0_fi1_fu1_b0_l0,0.5,0.5\n");
        assert_eq!(names[..2], m5.rows.iter().map(|r| r.name.clone()).collect::<Vec<_>>());
        assert_eq!(m5.labels, ["0", "1"]);
    }

    #[test]
    fn ids_of_other_data_stay_apart() {
        let other = table("id,p_x,p_y\n2/a/7,1,0\n2/b/7,0,1\n");
        let names: Vec<_> = other.rows.iter().map(|r| r.name.to_string()).collect();
        assert_eq!(names, ["id 2/a/7", "id 2/b/7"]);
    }

    #[test]
    fn windows_become_one_line_a_recording() {
        let windows = table("id,start,predicted,p_x,p_y\nr,0,y,,\ns,0,x,,\nr,1,y,,\nr,2,x,,\n");
        let voted = windows.vote(|v| Ok::<_, CcmError>(v.majority(None).map(|c| (c, None))));
        let classes: Vec<_> = voted.unwrap().rows.iter().map(|r| r.class).collect();
        assert_eq!(classes, [Some(1), Some(0)]);
    }
}
