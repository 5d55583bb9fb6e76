//! What makes scores of classes doubtful: classes spelled in two ways, classes that no prediction can
//! be, probabilities that contradict the predictions.

use std::collections::{BTreeMap, BTreeSet};

use crate::labels::{caseless, number};
use crate::predictions::{PredictionError, PredictionTable, Result, UNKNOWN};

/// Classes that are listed in a message.
const LISTED: usize = 6;

/// The names of true classes and of those predicted or, with probabilities, predictable.
struct Names<'a> {
    truth: BTreeSet<&'a str>,
    predicted: BTreeSet<&'a str>,
}

impl<'a> Names<'a> {
    fn of<K>(table: &'a PredictionTable<K>, truth: &[&'a str]) -> Self {
        let has_proba = table.rows.iter().any(|row| row.proba.is_some());
        let predicted = match has_proba {
            true => table.labels.iter().map(String::as_str).collect(),
            false => table
                .rows
                .iter()
                .filter_map(|row| Some(table.labels[row.class?].as_str()))
                .collect(),
        };
        Self { truth: truth.iter().copied().collect(), predicted }
    }

    /// Several names of one class, by what they have in common.
    fn alike(&self, key: impl Fn(&str) -> Option<String>) -> Vec<Vec<&'a str>> {
        let mut groups: BTreeMap<String, Vec<&str>> = BTreeMap::new();
        for name in self.truth.union(&self.predicted) {
            if let Some(key) = key(name) {
                groups.entry(key).or_default().push(name);
            }
        }
        groups.into_values().filter(|names| names.len() > 1).collect()
    }
}

/// Refuses a number that the true classes spell in one way and the predictions in another, such as
/// 1 and 1.0: every row of it would be wrong. Decimal true values are numbers unless all of them, and
/// all predictions, are whole.
///
/// # Errors
/// [`PredictionError::Content`].
pub(crate) fn check_spelling<K>(
    table: &PredictionTable<K>,
    truth: &[&str],
    decimal: bool,
) -> Result<()> {
    let names = Names::of(table, truth);
    let whole = |name: &&str| name.parse::<f64>().is_ok_and(|value| value.fract() == 0.0);
    let is_integer = |name: &&str| name.parse::<i128>().is_ok();
    if decimal && !(names.truth.iter().all(whole) && names.predicted.iter().all(is_integer)) {
        return Ok(());
    }
    for alike in names.alike(number) {
        let only = |here: &BTreeSet<&str>, there: &BTreeSet<&str>| {
            alike.iter().copied().find(|name| here.contains(name) && !there.contains(name))
        };
        let pair = only(&names.truth, &names.predicted).zip(only(&names.predicted, &names.truth));
        if let Some((truth, predicted)) = pair {
            let numeric = match table.rows.iter().any(|row| row.proba.is_some()) {
                true => "",
                false => ", or score them as numbers (score --numeric)",
            };
            return Err(PredictionError::Content {
                path: table.path.clone(),
                reason: format!(
                    "the true class {truth:?} and the predicted {predicted:?} are the same number: \
                     spell both alike{numeric}. pandas adds .0 to whole numbers if one is \
                     missing; dtype \"Int64\" does not"
                ),
            });
        }
    }
    Ok(())
}

/// What a user should know of scored classes; `strange` are true classes that the table lacks.
pub(super) fn warnings<K>(
    table: &PredictionTable<K>,
    truth: &[&str],
    strange: &[String],
) -> Vec<String> {
    let mut warnings: Vec<String> = table.unmatched.iter().cloned().collect();
    warnings.extend(no_prediction(&table.labels, strange));
    let names = Names::of(table, truth);
    let case = |name: &str| number(name).is_none().then(|| caseless(name));
    for alike in names.alike(number).into_iter().chain(names.alike(case)) {
        warnings.push(format!("{} are scored as different classes", quoted(&alike)));
    }
    warnings.extend(improbable(table));
    warnings
}

fn no_prediction(known: &[String], strange: &[String]) -> Option<String> {
    let first = strange.first()?;
    let like = corsmal_names::closest(first, known.iter().map(String::as_str));
    let like = like.map(|name| format!("; did you mean {name:?}?")).unwrap_or_default();
    let word = match strange.iter().any(|name| name == UNKNOWN) {
        true => "; `unknown` as a prediction says that there is none",
        false => "",
    };
    Some(format!(
        "no prediction can be one of the true classes {}, so their rows are wrong{like}{word}",
        quoted(strange)
    ))
}

/// Whether the classes predicted are never the most probable ones, or whether those of some classes
/// are exchanged.
fn improbable<K>(table: &PredictionTable<K>) -> Option<String> {
    // Of each class predicted: whether it ever is the most probable one, and which are.
    let mut classes: BTreeMap<usize, (bool, BTreeSet<usize>)> = BTreeMap::new();
    let mut rows = 0;
    for row in &table.rows {
        let (Some(class), Some(proba)) = (row.class, row.proba.as_deref()) else { continue };
        rows += 1;
        let best = crate::table::argmax(proba);
        let seen = classes.entry(class).or_default();
        seen.0 |= proba[class] >= proba[best];
        seen.1.insert(best);
    }
    let never: BTreeSet<usize> =
        classes.iter().filter(|(_, seen)| !seen.0).map(|(class, _)| *class).collect();
    let remedy = "are their columns p_… in another order? Brier score, calibration and areas come from these";
    if rows > 1 && never.len() == classes.len() {
        return Some(format!("no class predicted is the most probable one of its line: {remedy}"));
    }
    let best: BTreeSet<usize> = never.iter().flat_map(|class| classes[class].1.clone()).collect();
    let names: Vec<&str> = never.iter().map(|class| table.labels[*class].as_str()).collect();
    (never.len() > 1 && best == never).then(|| {
        let names = quoted(&names);
        format!("where {names} are predicted, another of them is always more probable: {remedy}")
    })
}

fn quoted<S: AsRef<str>>(names: &[S]) -> String {
    let listed = names.iter().take(LISTED).map(|name| format!("{:?}", name.as_ref()));
    listed.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scores::{ScoreReport, Scoring};

    fn score(text: &str) -> std::result::Result<Vec<String>, String> {
        let table = PredictionTable::parse(text.as_bytes(), "p.csv".as_ref()).unwrap();
        match table.score(&Scoring { draws: 10, ..Scoring::default() }) {
            Ok(ScoreReport::Classes(report)) => Ok(report.warnings),
            Ok(ScoreReport::Numbers(_)) => Err("numbers".into()),
            Err(error) => Err(error.to_string()),
        }
    }

    #[test]
    fn one_number_in_two_spellings_is_refused() {
        for rows in
            ["a,1,1.0\nb,2,2.0\n", "a,1.0,1\nb,2.0,2\n", "a,1,01\nb,0,0\n", "a,7,+7\nb,0,0\n"]
        {
            let refused = score(&format!("id,true,predicted\n{rows}")).unwrap_err();
            assert!(refused.contains("are the same number"), "{rows}: {refused}");
            assert!(refused.contains("--numeric"), "{rows}: {refused}");
        }
        let refused = score("id,true,p_1.0,p_2.0\na,1,1,0\nb,2,0,1\n").unwrap_err();
        assert!(refused.contains("\"1\" and the predicted \"1.0\""), "{refused}");
        assert!(!refused.contains("--numeric"), "{refused}");
        // Estimates of numbers may be whole by chance.
        let numbers = score("id,true,predicted\na,100.0,100\nb,250.5,200\n");
        assert_eq!(numbers.unwrap_err(), "numbers");
        let numbers = score("id,true,predicted\na,100.0,100\nb,250.0,200.5\n");
        assert_eq!(numbers.unwrap_err(), "numbers");
    }

    #[test]
    fn names_that_look_alike_are_warned_of() {
        let rows = "a,01,1\nb,1,01\nc,True,true\nd,true,true\n";
        let warnings = score(&format!("id,true,predicted\n{rows}")).unwrap();
        let expected = ["\"01\", \"1\"", "\"True\", \"true\""];
        assert_eq!(
            warnings,
            expected.map(|names| format!("{names} are scored as different classes"))
        );
        assert_eq!(score("id,true,predicted\na,x,x\nb,y,x\n").unwrap(), [""; 0]);
    }

    #[test]
    fn probabilities_that_contradict_the_predictions_are_warned_of() {
        let warnings = |rows: &str| {
            score(&format!("id,true,predicted,p_x,p_y,p_z\n{rows}")).unwrap().join("; ")
        };
        let all = warnings("a,x,x,0.1,0.9,0\nb,y,y,0.8,0.2,0\n");
        assert!(all.contains("no class predicted is the most probable one"), "{all}");
        let some = warnings("a,x,x,0.1,0.9,0\nb,y,y,0.8,0.2,0\nc,z,z,0,0,1\n");
        assert!(some.contains("\"x\", \"y\" are predicted, another of them"), "{some}");
        // A vote with a background gives rarer classes the word; ties are nobody's.
        assert_eq!(warnings("a,x,x,0.3,0,0.7\nb,y,y,0,0.3,0.7\nc,z,z,0,0,1\n"), "");
        assert_eq!(warnings("a,x,y,0.5,0.5,0\nb,y,y,0.5,0.5,0\n"), "");
    }
}
