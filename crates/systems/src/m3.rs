use corsmal_ccm::Result;
use corsmal_ccm::benchmark::{Estimate, Prepared, System, Work};
use corsmal_ccm::capacity::Problem;
use corsmal_ccm::dataset::{Container, FillingLevel, FillingType};
use corsmal_models::argmax;
use corsmal_nets::items::Items;
use corsmal_vision::category::{self, Category};

use crate::definition::{Definition, Settings};
use crate::learning::{self, Learning, array};

/// Concatenation's system.
pub(crate) const M3: Definition = Definition {
    name: "m3",
    about: "M3 (Concatenation): one perceptron each for level and type, on the end of the sound; \
            detections in the four views vote for the category of container, and each category \
            has its own perceptrons",
    networks: &["m3_mlp"],
    limits: &["Detections (YOLOv4's in the paper) are read from tables next to the recordings, \
               from any detector. The paper does not say how a spectrogram becomes 6,193 numbers, \
               nor what counts if nothing is detected: those are our \
               choice. Its capacity: `corsmal-feat capacity train --method m3`, then \
               `benchmark --capacity m3=MODEL`. A category without training recordings gets no \
               prediction; --weights m3-mlp=FILE gives the weights from which all six perceptrons \
               start."],
    make: |settings| Box::new(Concatenation(settings)),
};

const LEVELS: usize = FillingLevel::ALL.len();
const TYPES: usize = FillingType::ALL.len();

struct Concatenation(Settings);

struct Ready<'a> {
    learning: Learning<'a>,
    items: Items,
    levels: Vec<usize>,
    types: Vec<usize>,
    /// what each container is, where it is known: networks learn from these
    known: Vec<Option<Category>>,
    /// what the detections vote for: it chooses the networks
    voted: Vec<Option<Category>>,
}

impl System for Concatenation {
    fn name(&self) -> &'static str {
        "M3"
    }

    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> Result<Box<dyn Prepared + 'a>> {
        let learning = Learning::new("M3", work, &self.0);
        let (mut voted, mut damaged) = (Vec::with_capacity(work.subjects.len()), Vec::new());
        // Without a table, and with one that shows no container: of training, and of test recordings.
        let (mut untold, mut unseen) = ([0; 2], [0; 2]);
        for (at, subject) in work.subjects.iter().enumerate() {
            work.go_on()?;
            let part = usize::from(at >= work.training);
            let fault = |reason: String| format!("{}: {reason}", subject.input.id);
            let category = match subject.views.detections() {
                Ok(None) => {
                    untold[part] += 1;
                    None
                }
                Ok(Some(table)) => {
                    let vote = category::vote(&table, category::SHARE, work.seed);
                    unseen[part] += usize::from(vote.is_none());
                    vote.map(|vote| vote.category)
                }
                Err(Problem::Missing(reason) | Problem::Damaged(reason)) => {
                    damaged.push(fault(reason));
                    None
                }
            };
            voted.push(category);
        }
        if voted[..work.training].iter().all(Option::is_none) {
            let first = damaged.first().map(|first| format!("; the first damaged one, {first}"));
            return Err(learning.fault(&format!(
                "no training recording has a table of detections with a container: it needs detections/, or \
                 --detections, see docs/vision.md{}",
                first.unwrap_or_default()
            )));
        }
        learning.note_damaged(&damaged);
        for (why, counts) in
            [("have no table of detections", untold), ("show no container to the detector", unseen)]
        {
            for (part, count) in ["training", "test"].into_iter().zip(counts).filter(|(_, n)| *n > 0) {
                learning.note(format!(
                    "{count} {part} recordings {why}: they have neither level nor type, which counts as wrong."
                ));
            }
        }
        let known: Vec<Option<Category>> = work
            .subjects
            .iter()
            .map(|subject| subject.container.and_then(Container::new).map(Container::category))
            .collect();
        let told = known[..work.training].iter().zip(&voted).filter(|(known, _)| known.is_some());
        let right = told.clone().filter(|(known, voted)| known == voted).count();
        learning.note(format!(
            "the vote finds the category of {right} of {} training recordings \
             (paper: 92 % of cups, 73 % of \
             glasses, 88 % of boxes).",
            told.count()
        ));
        let items = learning::single(learning.items("m3_mlp")?);
        let (levels, types) = (learning.levels(), learning.types());
        Ok(Box::new(Ready { learning, items, levels, types, known, voted }))
    }
}

impl Prepared for Ready<'_> {
    fn inputs(&self) -> Vec<String> {
        vec!["audio+rgb1+rgb2+rgb3+rgb4".into()]
    }

    fn notes(&self) -> Vec<String> {
        self.learning.notes()
    }

    fn predict(&self, train: &[usize], wanted: &[usize]) -> Result<Vec<Vec<Estimate>>> {
        let mut estimates = vec![Estimate::default(); wanted.len()];
        for category in Category::ALL {
            let of = |rows: &[usize], categories: &[Option<Category>]| -> Vec<usize> {
                rows.iter().copied().filter(|&row| categories[row] == Some(category)).collect()
            };
            let (taught, asked) = (of(train, &self.known), of(wanted, &self.voted));
            if asked.is_empty() {
                continue;
            }
            if taught.is_empty() {
                let (name, asked) = (category.name(), asked.len());
                self.learning.note(format!(
                    "a fold has no training recording of a {name}: {asked} with that vote count \
                     as wrong."
                ));
                continue;
            }
            let proba = |outputs, classes| {
                let trained = self.learning.train("m3_mlp", outputs, &self.items, classes, &taught)?;
                self.learning.probabilities(&trained, &self.items, &asked)
            };
            let (levels, types) = (proba(LEVELS, &self.levels)?, proba(TYPES, &self.types)?);
            let places = (0..wanted.len()).filter(|&at| self.voted[wanted[at]] == Some(category));
            for ((at, level), kind) in places.zip(&levels).zip(&types) {
                estimates[at] = Estimate {
                    level: Some(argmax(level)),
                    kind: Some(argmax(kind)),
                    level_probabilities: array(level),
                    kind_probabilities: array(kind),
                    ..Estimate::default()
                };
            }
        }
        Ok(vec![estimates])
    }
}
