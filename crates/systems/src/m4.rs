use corsmal_ccm::Result;
use corsmal_ccm::benchmark::{Estimate, Prepared, Subject, System, Work};
use corsmal_models::argmax;
use corsmal_models::fusion::{Background, WindowVotes};
use corsmal_nets::items::{Column, Items};

use crate::learning::{Learning, array};
use crate::definition::{Definition, Settings};

/// HVRL's system.
pub(crate) const M4: Definition = Definition {
    name: "m4",
    about: "M4 (HVRL): type from a vote over windows of eight channels, level from LSTMs over them",
    networks: &["m4_type", "m4_level"],
    limits: &["Its capacity needs views: `corsmal-feat capacity --method m4`."],
    make: |settings| Box::new(Hvrl(settings)),
};

/// The type network's features are scaled by these published extremes.
const EXTREMES: (f32, f32) = (-1.194_836_9, 57.464_638);
/// Windows that the level network hears: the first ones.
const STEPS: usize = 100;
/// Windows that a filling type needs to win over none.
const LEAST: usize = 6;
/// Frames of 10 ms by which an action must reach into a window, at its end and at its beginning.
const REACH: (f64, f64) = (48.0, 16.0);

struct Hvrl(Settings);

struct Ready<'a> {
    learning: Learning<'a>,
    /// windows of all recordings, one recording after another
    windows: Items,
    /// where those of each recording begin, and the end
    ends: Vec<usize>,
    /// class of each window
    types: Vec<usize>,
    levels: Vec<usize>,
}

impl System for Hvrl {
    fn name(&self) -> &'static str {
        "M4"
    }

    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> Result<Box<dyn Prepared + 'a>> {
        let learning = Learning::new("M4", work, &self.0);
        let recordings = learning.items("m4_type")?;
        if learning.subjects()[..work.training].iter().any(|s| s.action.is_none()) {
            learning.note(
                "in recordings without an annotated action, all windows have the type of the \
                 recording.".into(),
            );
        }
        let (mut types, mut ends) = (Vec::new(), vec![0]);
        for (subject, items) in learning.subjects().iter().zip(&recordings) {
            let starts = items.iter().map(|item| item.frames.as_ref().map_or(0, |f| f.start));
            types.extend(starts.map(|start| window_type(subject, start)));
            ends.push(types.len());
        }
        let values = recordings.iter().flatten().map(|item| item.values.as_slice());
        let windows = Items { columns: vec![Column::of(values)] };
        let levels = learning.levels();
        Ok(Box::new(Ready { learning, windows, ends, types, levels }))
    }
}

/// The type of the window that begins at a frame: the recording's while something is poured or
/// shaken, else none.
fn window_type(subject: &Subject, start: usize) -> usize {
    let kind = subject.filling.map_or(0, |f| f.kind() as usize);
    let frame = start as f64;
    match subject.action {
        Some(Some((from, to))) => {
            let heard = 100.0 * from < frame + REACH.0 && 100.0 * to > frame + REACH.1;
            if heard { kind } else { 0 }
        }
        Some(None) => 0,
        None => kind,
    }
}

impl Ready<'_> {
    /// Windows of these recordings.
    fn windows_of(&self, subjects: &[usize]) -> Vec<usize> {
        subjects.iter().flat_map(|&s| self.ends[s]..self.ends[s + 1]).collect()
    }
}

impl Prepared for Ready<'_> {
    fn notes(&self) -> Vec<String> {
        self.learning.notes()
    }

    fn predict(&self, train: &[usize], wanted: &[usize]) -> Result<Vec<Vec<Estimate>>> {
        let learning = &self.learning;
        let train_windows = self.windows_of(train);
        let hears = learning.train("m4_type", 4, &self.windows, &self.types, &train_windows)?;
        drop(train_windows);

        let mut kinds = Vec::with_capacity(wanted.len());
        for &subject in wanted {
            let rows = self.windows_of(&[subject]);
            let mut votes = WindowVotes::new(4);
            for proba in learning.probabilities(&hears, &self.windows, &rows)? {
                votes.add(argmax(&proba), Some(&proba)).map_err(|e| learning.fault(&e))?;
            }
            let kind = votes.majority(Some(Background { class: 0, least: LEAST }));
            kinds.push((kind, votes.shares()));
        }

        // What the frozen network makes of the first windows of each recording.
        let used: Vec<usize> = train.iter().chain(wanted).copied().collect();
        let mut sequences = Vec::with_capacity(used.len());
        for &subject in &used {
            let mut rows = self.windows_of(&[subject]);
            rows.truncate(STEPS);
            let (low, high) = EXTREMES;
            let scale = |v: f32| (v - low) / (high - low);
            let steps = learning.inner(&hears, &self.windows, &rows)?;
            sequences.push(steps.into_iter().flatten().map(scale).collect::<Vec<f32>>());
        }
        let items = Items { columns: vec![Column::of(sequences.iter().map(Vec::as_slice))] };
        let levels: Vec<usize> = used.iter().map(|&s| self.levels[s]).collect();
        let (known, asked): (Vec<usize>, Vec<usize>) =
            ((0..train.len()).collect(), (train.len()..used.len()).collect());
        let follows = learning.train("m4_level", 3, &items, &levels, &known)?;
        let levels = learning.probabilities(&follows, &items, &asked)?;
        let estimate = |((kind, shares), level): (&(Option<usize>, Vec<f64>), &Vec<f64>)| Estimate {
            kind: *kind,
            kind_probabilities: array(shares),
            level: Some(argmax(level)),
            level_probabilities: array(level),
            ..Estimate::default()
        };
        Ok(vec![kinds.iter().zip(&levels).map(estimate).collect()])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use corsmal_ccm::capacity::Views;
    use corsmal_ccm::dataset::{Filling, FillingLevel, FillingType, Recording, Subset};
    use corsmal_extract::inputs::{Input, InputSource};

    #[test]
    fn a_window_has_the_type_while_it_is_poured() {
        let source = InputSource::Stdin;
        let input = Input { id: "x".into(), source, start: None, end: None, labels: Vec::new() };
        let filling = Filling::new(FillingType::Rice, FillingLevel::Full);
        let recording = Recording {
            path: "x.wav".into(),
            part: Subset::Training,
            container: None,
            id: None,
            sequence: None,
            name: None,
        };
        let of = |action, start| {
            let (input, views) = (input.clone(), Views::of(&recording, None));
            let subject = Subject { input, container: Some(1), name: None, filling, action, views };
            window_type(&subject, start)
        };
        let poured = Some(Some((1.0, 2.0)));
        // 1 s is frame 100: it must lie before frame 48 of the window, 2 s after its frame 16.
        assert_eq!(of(poured, 52), 0);
        assert_eq!(of(poured, 53), 2);
        assert_eq!(of(poured, 183), 2);
        assert_eq!(of(poured, 184), 0);
        assert_eq!(of(Some(None), 60), 0);
        assert_eq!(of(None, 500), 2);
    }
}
