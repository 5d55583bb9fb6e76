//! Prediction files ([`corsmal_models::predictions`]) whose lines are recordings of the data set, so
//! that those of `classify` and `cross-validate` (`id`, `path`) go with those that M5 published
//! (`Object,Sequence`).

use std::collections::{HashMap, HashSet};
use std::fmt;
use std::path::Path;

use corsmal_models::predictions::{Id, PredictionRow, PredictionTable};

use crate::dataset::{Container, PathParts, SequenceName, Subset};
use crate::error::{CcmError, Result};
use crate::submission::RowKey;
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

/// Predictions of recordings, told apart as those of the data set where they are such.
pub type RecordingPredictions = PredictionTable<RowName>;

/// Reads a prediction file; a recording may have several lines, one for each of its windows.
///
/// # Errors
/// [`CcmError`] for what [`PredictionTable::read`] refuses, and for sequences that are neither numbers
/// nor names of the data set.
pub fn read(path: &Path) -> Result<RecordingPredictions> {
    named(PredictionTable::read(path)?)
}

/// The same table with its lines known as recordings of the data set.
///
/// # Errors
/// As [`read`].
pub fn named(table: PredictionTable) -> Result<RecordingPredictions> {
    let by_sequence = table.naming == 2 && table.columns[1].eq_ignore_ascii_case("sequence");
    if by_sequence {
        for row in &table.rows {
            sequence_key(&table.path, &row.cells[0], &row.cells[1])?;
        }
        let path = table.path.clone();
        return Ok(table.with_keys(|row| {
            match sequence_key(&path, &row.cells[0], &row.cells[1]) {
                Ok(key) => RowName::Recording(key),
                Err(_) => RowName::Other(row.cells[0].clone()),
            }
        }));
    }
    if let Some(named) = by_labels(&table) {
        return Ok(table.with_keys(|row| named[&row.key].clone()));
    }
    let naming = table.naming;
    let texts = |row: &PredictionRow<RowName>| row.cells[..naming].to_vec();
    let named = table.with_keys(|row| by_text(&row.cells[..naming]));
    // Ids of other data may look like recordings of this one without being told apart by that.
    let mut known = HashMap::new();
    let unclear = |row: &PredictionRow<RowName>| {
        known.insert(row.key.clone(), texts(row)).is_some_and(|other| other != texts(row))
    };
    if named.rows.iter().any(unclear) {
        return Ok(named.with_keys(|row| RowName::Other(row.cells[0].clone())));
    }
    Ok(named)
}

/// What label columns for container and sequence call the recording of each id: they tell more than
/// a number does where each id is another recording of the data set by them. `None` where they are
/// labels of other data.
fn by_labels(table: &PredictionTable) -> Option<HashMap<Id, RowName>> {
    let find = |name: &str| table.columns.iter().position(|c| c.eq_ignore_ascii_case(name));
    let container = ["Object", "container", "Container ID"].iter().find_map(|name| find(name))?;
    let sequence = find("sequence")?;
    let mut named: HashMap<Id, RowName> = HashMap::new();
    for row in &table.rows {
        let key = sequence_key(&table.path, &row.cells[container], &row.cells[sequence]).ok()?;
        let RowKey::Sequence(number, _) = key else { return None };
        Container::new(number)?;
        let name = RowName::Recording(key);
        let before = named.insert(row.key.clone(), name.clone());
        if before.is_some_and(|before| before != name) {
            return None;
        }
    }
    let different: HashSet<&RowName> = named.values().collect();
    (different.len() == named.len()).then_some(named)
}

fn by_text(text: &[String]) -> RowName {
    // A path tells more than an id does, where it leads through the container's folder.
    let keys = text.iter().rev().filter_map(|t| PathParts::of(Path::new(t)).key());
    let keys: Vec<RowKey> = keys.collect();
    let whole = keys.iter().find(|k| matches!(k, RowKey::Sequence(..)));
    match whole.or(keys.first()) {
        Some(key) => RowName::Recording(*key),
        None => RowName::Other(text[0].clone()),
    }
}

/// What each class of a table is, by its name.
///
/// # Errors
/// A name that `parse` does not know; `what` says what is expected.
pub fn classes<T>(
    table: &RecordingPredictions,
    parse: impl Fn(&str) -> Option<T>,
    what: &str,
) -> Result<Vec<T>> {
    let class = |label: &String| {
        parse(label).ok_or_else(|| {
            let path = table.path.display();
            CcmError::Request(format!("{path}: class '{label}' is not {what}"))
        })
    };
    table.labels.iter().map(class).collect()
}

/// The recording named by container and sequence, the latter a number or a name.
fn sequence_key(path: &Path, container: &str, sequence: &str) -> Result<RowKey> {
    let refuse = |what: &str, value: &str, expected: &str| {
        let place = path.display();
        CcmError::Request(format!("{place}: {what} '{value}' is not {expected}"))
    };
    let number: u8 =
        container.parse().map_err(|_| refuse("container", container, "a container number"))?;
    let position = sequence.parse().ok().or_else(|| {
        let name = SequenceName::parse(sequence);
        Container::new(number).zip(name).and_then(|(c, name)| name.number(c))
    });
    position.map(|position| RowKey::Sequence(number, position)).ok_or_else(|| {
        let expected = "a sequence number or a name such as s0_fi1_fu2_b0_l0";
        refuse("sequence", sequence, expected)
    })
}

/// The recording that a file of its images is named after, as M5 names them: `id10_0000.png`
/// (container, sequence) or `id000000.png` (id of the flat release).
pub(crate) fn file_key(file: &str) -> Option<RowKey> {
    let stem = file.trim_start_matches("id").split('.').next().unwrap_or_default();
    match stem.split_once('_') {
        Some((c, s)) => c.parse().ok().zip(s.parse().ok()).map(|(c, s)| RowKey::Sequence(c, s)),
        None => stem.parse().ok().map(RowKey::Id),
    }
}

/// How a table names a recording. Ids begin at 0 in every part of the flat release.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Named {
    /// The part, where the container or a column tells; else an id may be of any.
    pub part: Option<Subset>,
    /// The recording in it.
    pub key: RowKey,
}

impl Named {
    /// A recording whose part nothing but its container tells.
    pub fn alone(key: RowKey) -> Self {
        let part = match key {
            RowKey::Sequence(container, _) => Container::new(container).map(Container::subset),
            RowKey::Id(_) => None,
        };
        Self { part, key }
    }
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.part, self.key) {
            (Some(part), RowKey::Id(_)) => write!(f, "{} of the {} part", self.key, part.name()),
            _ => self.key.fmt(f),
        }
    }
}

/// The recording in a row of a table of capacities.
pub(crate) fn row_name(table: &Table, row: usize, file: usize) -> Result<Named> {
    let key = file_key(table.text(row, file))
        .ok_or_else(|| table.fault(row, file, "a name such as id10_0000.png or id000000.png"))?;
    let named = Named::alone(key);
    let Some(column) = table.find("part").filter(|_| named.part.is_none()) else {
        return Ok(named);
    };
    let text = table.text(row, column);
    if text.is_empty() {
        return Ok(named);
    }
    let part = Subset::ALL.into_iter().find(|part| part.name() == text);
    let expected = "training, public test or private test";
    let part = part.ok_or_else(|| table.fault(row, column, expected))?;
    Ok(Named { part: Some(part), key })
}

/// Capacity estimates by recording: columns `fileName` (`id10_0000.png`: container and sequence
/// number; `id000000.png`: id of the flat release) and `capacity[mL]`, as M5 published them; -1 is not an estimate.
/// A column `part` tells the ids of several parts apart.
///
/// # Errors
/// [`CcmError`] with line and column for other values, and for recordings that occur twice.
pub fn read_capacities(path: &Path) -> Result<HashMap<Named, Option<f64>>> {
    let table = Table::read(path)?;
    let file = table.column("fileName")?;
    let capacity = table.column("capacity[mL]")?;
    let mut by_key = HashMap::new();
    let mut seen = HashSet::new();
    for row in 0..table.rows() {
        let named = row_name(&table, row, file)?;
        if !seen.insert(named) {
            return Err(table.fault(row, file, "a name that occurs once"));
        }
        let value = table.number(row, capacity)?;
        if value < 0.0 && value != -1.0 {
            return Err(table.fault(
                row,
                capacity,
                "a capacity of at least 0, or -1 for no estimate",
            ));
        }
        by_key.insert(named, (value != -1.0).then_some(value));
    }
    // An id without a part could be of any: beside others its estimate would be theirs, too.
    let ids = |part: bool| {
        let of_ids = |named: &&Named| matches!(named.key, RowKey::Id(_));
        seen.iter().filter(of_ids).find(|named| named.part.is_some() == part)
    };
    if let (Some(_), Some(named)) = (ids(true), ids(false)) {
        return Err(CcmError::Rows {
            path: path.to_path_buf(),
            problem: "ids without a part",
            rows: named.to_string(),
            expected: "a part for every id, or for none".into(),
        });
    }
    Ok(by_key)
}

#[cfg(test)]
mod tests {
    use corsmal_models::voting::VotingRule;

    use super::*;

    fn table(text: &str) -> RecordingPredictions {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        read(file.path()).unwrap()
    }

    #[test]
    fn averages_by_row_and_class_name_with_weights() {
        let a = table("id,p_x,p_y\nr,0.9,0.1\ns,0.4,0.6\n");
        let b = table("id,p_y,p_x\ns,0.9,0.1\nr,0.2,0.8\n");
        let mean = RecordingPredictions::average(&[a, b], Some(&[1.0, 3.0])).unwrap();
        let proba = mean.rows[0].proba.as_ref().unwrap();
        assert!((proba[0] - (0.9 + 3.0 * 0.8) / 4.0).abs() < 1e-12);
        assert_eq!(mean.rows.iter().map(|r| r.class.unwrap()).collect::<Vec<_>>(), [0, 1]);
    }

    #[test]
    fn refuses_other_rows_classes_and_weights() {
        let a = table("id,p_x,p_y\nr,1,0\ns,1,0\n");
        let message = |b: &RecordingPredictions, weights: Option<&[f64]>| {
            let tables = [a.clone(), b.clone()];
            RecordingPredictions::average(&tables, weights).unwrap_err().to_string()
        };
        let less = table("id,p_x,p_y\nr,1,0\n");
        assert!(message(&less, None).contains("missing rows: id s"));
        let more = table("id,p_x,p_y\nr,1,0\ns,1,0\nt,1,0\n");
        assert!(message(&more, None).contains("rows that the first file lacks: id t"));
        let twice = table("id,p_x,p_y\nr,1,0\nr,1,0\n");
        assert!(message(&twice, None).contains("more than one row: id r"));
        assert!(message(&table("id,p_x,p_z\nr,1,0\ns,1,0\n"), None).contains("classes x, z"));
        assert!(message(&a, Some(&[1.0])).contains("weights"));
        assert!(RecordingPredictions::average(&[], None).is_err());
    }

    #[test]
    fn recordings_are_known_by_path_number_and_name() {
        let ours = table(
            "id,path,status,predicted,p_0,p_1\n\
             0002_audio,test/10/audio/0002_audio.wav,ok,0,1,0\n\
             1/audio/s0_fi1_fu1_b0_l0_audio,x,ok,1,0.5,0.5\n\
             000007,000007.wav,ok,0,1,0\nhello,hello.wav,corrupt,,,\n",
        );
        let names: Vec<_> = ours.rows.iter().map(|r| r.key.clone()).collect();
        let key = RowName::Recording;
        assert_eq!(names[..2], [RowKey::Sequence(10, 2), RowKey::Sequence(1, 1)].map(key));
        assert_eq!(names[2..], [key(RowKey::Id(7)), RowName::Other("hello".into())]);
        // The classifier's own word counts where probabilities are equal.
        assert_eq!(ours.rows[1].class, Some(1));
        assert_eq!((ours.rows[3].class, ours.rows[3].proba.clone()), (None, None));
        let m5 = table("Object,Sequence,p0,p1\n10,0002,1,0\n1,s0_fi1_fu1_b0_l0,0.5,0.5\n");
        assert_eq!(names[..2], m5.rows.iter().map(|r| r.key.clone()).collect::<Vec<_>>());
        assert_eq!(m5.labels, ["0", "1"]);
    }

    /// Label columns of these names hid the ids, and two lines of other ids became one recording.
    #[test]
    fn container_and_sequence_beside_ids_name_recordings_of_the_data_set_only() {
        let names = |rows: &str| {
            let ours = table(&format!("id,container,sequence,p_x,p_y\n{rows}"));
            ours.rows.iter().map(|r| r.key.to_string()).collect::<Vec<_>>()
        };
        let numbered = names("0,10,3,1,0\n1,11,0004,0,1\n");
        let keys = [RowKey::Sequence(10, 3), RowKey::Sequence(11, 4)];
        assert_eq!(numbered, keys.map(|key| key.to_string()));
        for other in
            ["a,cup,1,1,0\nb,cup,1,0,1\n", "a,1,1,1,0\nb,1,1,0,1\n", "a,99,1,1,0\nb,1,1,1,0\n"]
        {
            assert_eq!(names(other), ["id a", "id b"], "{other}");
        }
    }

    #[test]
    fn ids_of_other_data_stay_apart() {
        let other = table("id,p_x,p_y\n2/a/7,1,0\n2/b/7,0,1\n");
        let names: Vec<_> = other.rows.iter().map(|r| r.key.to_string()).collect();
        assert_eq!(names, ["id 2/a/7", "id 2/b/7"]);
    }

    /// One file knows of a recording that could not be read, the other does not.
    #[test]
    fn a_failed_line_that_another_file_lacks_stays_without_prediction() {
        let failed = table("id,status,predicted,p_x,p_y\nr,ok,x,1,0\nbroken,corrupt,,,\n");
        let whole = table("id,true,predicted,p_x,p_y\nr,y,y,0,1\n");
        for tables in [[failed.clone(), whole.clone()], [whole, failed]] {
            let mean = RecordingPredictions::average(&tables, None).unwrap();
            assert_eq!(mean.rows.len(), 2);
            assert_eq!((mean.rows[1].class, &mean.rows[1].proba), (None, &None));
            assert_eq!(mean.rows[0].proba, Some(vec![0.5, 0.5]));
            let status = mean.columns.iter().position(|column| column == "status").unwrap();
            assert_eq!(
                (&*mean.rows[0].cells[status], &*mean.rows[1].cells[status]),
                ("ok", "corrupt")
            );
        }
    }

    #[test]
    fn true_classes_and_other_columns_are_carried() {
        let a = table("id,fold,true,site,predicted,p_x,p_y\nr,1,y,A,x,1,0\n");
        let mean = RecordingPredictions::average(&[a.clone(), a], None).unwrap();
        let written = String::from_utf8(mean.to_csv().unwrap()).unwrap();
        assert_eq!(written, "id,fold,true,site,predicted,p_x,p_y\nr,1,y,A,x,1,0\n");
    }

    #[test]
    fn capacities_name_the_part_of_every_id_or_of_none() {
        let read = |rows: &str| {
            let file = tempfile::NamedTempFile::new().unwrap();
            std::fs::write(file.path(), format!("fileName,capacity[mL],part\n{rows}")).unwrap();
            read_capacities(file.path()).map(|found| found.len()).map_err(|e| e.to_string())
        };
        let (named, unnamed) = ("id000000.png,400,public test\n", "id000000.png,300,\n");
        assert_eq!((read(named), read(unnamed)), (Ok(1), Ok(1)));
        let mixed = read(&[named, unnamed].concat()).unwrap_err();
        assert!(mixed.contains("ids without a part: id 0"), "{mixed}");
        assert_eq!(read(&format!("{named}id10_0001.png,200,\n")), Ok(2), "its container tells");
    }

    #[test]
    fn capacities_below_zero_are_no_estimates_only_as_minus_one() {
        let read = |value: &str| {
            let file = tempfile::NamedTempFile::new().unwrap();
            let text = format!("fileName,capacity[mL]\nid10_0001.png,{value}\n");
            std::fs::write(file.path(), text).unwrap();
            let found = read_capacities(file.path()).map_err(|e| e.to_string());
            found.map(|found| found.into_values().next().unwrap())
        };
        assert_eq!((read("-1"), read("0"), read("2.5")), (Ok(None), Ok(Some(0.0)), Ok(Some(2.5))));
        for value in ["-5", "-0.5"] {
            let refused = read(value).unwrap_err();
            assert!(refused.contains("at least 0, or -1 for no estimate"), "{refused}");
        }
    }

    #[test]
    fn windows_become_one_line_a_recording() {
        let windows = table("id,start,predicted,p_x,p_y\nr,0,y,,\ns,0,x,,\nr,1,y,,\nr,2,x,,\n");
        let voted = windows.vote(VotingRule::Majority(None));
        let classes: Vec<_> = voted.unwrap().rows.iter().map(|r| r.class).collect();
        assert_eq!(classes, [Some(1), Some(0)]);
    }
}
