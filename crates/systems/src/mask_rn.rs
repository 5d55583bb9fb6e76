use std::collections::HashMap;
use std::sync::atomic::Ordering;

use corsmal_ccm::{CcmError, Result};
use corsmal_ccm::benchmark::{Estimate, Prepared, System, Work};
use corsmal_ccm::capacity::Problem;
use corsmal_ccm::crop::crops;
use corsmal_ccm::dataset::{Container, FillingLevel, FillingType};
use corsmal_models::argmax;
use corsmal_nets::items::{Column, Items};
use corsmal_nets::networks;
use corsmal_nets::picture;
use rayon::prelude::*;

use crate::learning::Learning;
use crate::definition::{Definition, Settings};

/// The paper's vision baseline.
pub(crate) const MASK_RN: Definition = Definition {
    name: "mask-rn",
    about: "Mask + RN (vision baseline): one network each for level and type, on the container in \
            the last frame, each view separately",
    networks: &["resnet18_level", "resnet18_type"],
    limits: &["Detections (Mask R-CNN's in the paper) are read from tables next to the \
               recordings. The paper gives neither the size of the crops nor the training, nor \
               what counts if nothing is detected: those are our choice."],
    make: |settings| Box::new(Baseline(settings)),
};

/// Views, each of which answers alone.
const VIEWS: usize = 4;
/// Classes after the levels and types: the last says that the container is opaque.
const LEVELS: usize = FillingLevel::ALL.len();
const TYPES: usize = FillingType::ALL.len();

struct Baseline(Settings);

struct Ready<'a> {
    learning: Learning<'a>,
    /// one for each crop
    items: Items,
    /// item of each recording and view
    item_of: Vec<[Option<usize>; VIEWS]>,
    levels: Vec<usize>,
    types: Vec<usize>,
}

impl System for Baseline {
    fn name(&self) -> &'static str {
        "Mask + RN"
    }

    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> Result<Box<dyn Prepared + 'a>> {
        let learning = Learning::new("Mask + RN", work, &self.0);
        let definition =
            networks::named("resnet18_level").map_err(|e| learning.fault(&e))?;
        let Some((width, height)) = definition.picture() else {
            return Err(learning.fault(&"its networks take no pictures"));
        };
        // Sight alone, before anything is learned.
        let (subjects, stop) = (&work.subjects, work.stop);
        let seen: Vec<Result<_>> = subjects
            .par_iter()
            .map(|subject| {
                if stop.load(Ordering::Relaxed) {
                    return Err(CcmError::Interrupted);
                }
                let item = |crop: std::result::Result<corsmal_vision::Rgb, Problem>| match crop {
                    Ok(crop) => Ok(Some(picture::item(&crop.resized(width, height).data))),
                    Err(Problem::Missing(_)) => Ok(None),
                    Err(Problem::Damaged(reason)) => Err((subject.input.id.clone(), reason)),
                };
                Ok(crops(&subject.views, stop).map(item))
            })
            .collect();
        work.go_on()?;
        let (mut column, mut subject_of) = (Column::of([]), Vec::new());
        let mut item_of = vec![[None; VIEWS]; work.subjects.len()];
        let mut damaged = Vec::new();
        for (subject, seen) in seen.into_iter().enumerate() {
            for (view, item) in seen?.into_iter().enumerate() {
                let item = match item {
                    Ok(item) => item,
                    Err((id, reason)) => {
                        damaged.push(format!("{id}: {reason}"));
                        None
                    }
                };
                let Some(item) = item else { continue };
                item_of[subject][view] = Some(subject_of.len());
                column.push(&item);
                subject_of.push(subject);
            }
        }
        if subject_of.iter().all(|&subject| subject >= work.training) {
            let first = damaged.first().map(|first| format!("; the first damaged one, {first}"));
            return Err(learning.fault(&format!(
                "no view of a training recording shows a container: it needs colour frames (rgb/) and tables of \
                 detections (detections/), see docs/vision.md{}",
                first.unwrap_or_default()
            )));
        }
        learning.note_damaged(&damaged);
        for view in 0..VIEWS {
            let without = item_of.iter().filter(|items| items[view].is_none()).count();
            if without > 0 {
                learning.note(format!(
                    "view {}: no picture of a cup or wine glass in the last frame of {without} of {} recordings, \
                     which have neither level nor type and count as wrong.",
                    view + 1,
                    work.subjects.len()
                ));
            }
        }
        let opaque = |&subject: &usize| {
            let number = work.subjects[subject].container;
            number.and_then(Container::new).is_some_and(Container::is_opaque)
        };
        let classes = |of: Vec<usize>, last: usize| -> Vec<usize> {
            subject_of.iter().map(|s| if opaque(s) { last } else { of[*s] }).collect()
        };
        let levels = classes(learning.levels(), LEVELS);
        let types = classes(learning.types(), TYPES);
        let items = Items { columns: vec![column] };
        Ok(Box::new(Ready { learning, items, item_of, levels, types }))
    }
}

/// The class and its probabilities among those that are no "opaque"; nothing where that is what it is.
fn decided<const N: usize>(probabilities: &[f64]) -> (Option<usize>, Option<[f64; N]>) {
    let class = argmax(probabilities);
    if class >= N {
        return (None, None);
    }
    let sum: f64 = probabilities[..N].iter().sum();
    (Some(class), Some(std::array::from_fn(|k| probabilities[k] / sum)))
}

impl Prepared for Ready<'_> {
    fn inputs(&self) -> Vec<String> {
        (1..=VIEWS).map(|view| format!("rgb{view}")).collect()
    }

    fn notes(&self) -> Vec<String> {
        self.learning.notes()
    }

    /// One pair of networks for all views.
    fn predict(&self, train: &[usize], wanted: &[usize]) -> Result<Vec<Vec<Estimate>>> {
        let items = |subjects: &[usize]| -> Vec<usize> {
            subjects.iter().flat_map(|&s| self.item_of[s].into_iter().flatten()).collect()
        };
        let (known, asked) = (items(train), items(wanted));
        let proba = |network, outputs, classes: &[usize]| {
            let trained = self.learning.train(network, outputs, &self.items, classes, &known)?;
            self.learning.probabilities(&trained, &self.items, &asked)
        };
        let levels = proba("resnet18_level", LEVELS + 1, &self.levels)?;
        let types = proba("resnet18_type", TYPES + 1, &self.types)?;
        let mut found: HashMap<usize, Estimate> = HashMap::with_capacity(asked.len());
        for ((item, level), kind) in asked.iter().zip(&levels).zip(&types) {
            let (level, level_probabilities) = decided(level);
            let (kind, kind_probabilities) = decided(kind);
            found.insert(
                *item,
                Estimate { level, kind, level_probabilities, kind_probabilities, ..Estimate::default() },
            );
        }
        let of = |view: usize, subject: usize| {
            self.item_of[subject][view].and_then(|item| found.get(&item).cloned())
        };
        let by_view = |view| wanted.iter().map(|&s| of(view, s).unwrap_or_default()).collect();
        Ok((0..VIEWS).map(by_view).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn opaque_is_no_level() {
        let (class, shares) = decided::<3>(&[0.1, 0.2, 0.3, 0.4]);
        assert_eq!((class, shares), (None, None));
        let (class, shares) = decided::<3>(&[0.1, 0.2, 0.5, 0.2]);
        assert_eq!(class, Some(2));
        let shares = shares.unwrap();
        assert!(shares.iter().zip([0.125, 0.25, 0.625]).all(|(got, want)| (got - want).abs() < 1e-12));
    }
}
