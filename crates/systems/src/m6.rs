use corsmal_ccm::Result;
use corsmal_ccm::benchmark::{Estimate, Prepared, System, Work};
use corsmal_ccm::dataset::Filling;
use corsmal_models::argmax;
use corsmal_nets::items::Items;

use crate::learning::{self, Learning, UNKNOWN};
use crate::definition::{Definition, Settings};

/// ACC's system.
pub(crate) const M6: Definition = Definition {
    name: "m6",
    about: "M6 (ACC): one network distinguishes pouring, shaking and nothing; one more for each \
            action predicts type and level together",
    networks: &["m6_action", "m6_pouring", "m6_shaking"],
    limits: &[],
    make: |settings| Box::new(Acc(settings)),
};

/// Actions by their numbers: nothing, pouring, shaking.
const ACTIONS: usize = 3;
const POURED: usize = 1;
const SHAKEN: usize = 2;
/// Joint classes that can be poured: all but empty. Those that can be shaken: pasta and rice.
const POURABLE: usize = 6;
const SHAKABLE: usize = 4;
/// Containers that are boxes, which are shaken.
const BOXES: [u8; 5] = [7, 8, 9, 12, 15];

struct Acc(Settings);

struct Ready<'a> {
    learning: Learning<'a>,
    items: Items,
    actions: Vec<usize>,
    /// joint class without the empty one; 0 where it is empty
    fillings: Vec<usize>,
}

impl System for Acc {
    fn name(&self) -> &'static str {
        "M6"
    }

    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> Result<Box<dyn Prepared + 'a>> {
        let learning = Learning::new("M6", work, &self.0);
        let items = learning::single(learning.items("m6_action")?);
        let joint: Vec<usize> =
            learning.subjects().iter().map(|s| s.filling.map_or(UNKNOWN, Filling::joint)).collect();
        let shaken = |container: Option<u8>| container.is_some_and(|c| BOXES.contains(&c));
        let actions = learning.subjects().iter().zip(&joint).map(|(subject, &joint)| {
            match (joint, shaken(subject.container)) {
                (0, _) => 0,
                (_, false) => POURED,
                (_, true) => SHAKEN,
            }
        });
        let actions = actions.collect();
        let fillings = joint.iter().map(|j| j.saturating_sub(1)).collect();
        Ok(Box::new(Ready { learning, items, actions, fillings }))
    }
}

impl Prepared for Ready<'_> {
    fn notes(&self) -> Vec<String> {
        self.learning.notes()
    }

    fn predict(&self, train: &[usize], wanted: &[usize]) -> Result<Vec<Vec<Estimate>>> {
        let proba = |network, outputs, classes, rows: &[usize]| {
            let trained = self.learning.train(network, outputs, &self.items, classes, rows)?;
            self.learning.probabilities(&trained, &self.items, wanted)
        };
        let with = |action: usize| -> Vec<usize> {
            train.iter().copied().filter(|&row| self.actions[row] == action).collect()
        };
        let actions = proba("m6_action", ACTIONS, &self.actions, train)?;
        let poured = proba("m6_pouring", POURABLE, &self.fillings, &with(POURED))?;
        // Water is never shaken; a filling that only pours is no class of that network.
        let shakable: Vec<usize> = self.fillings.iter().map(|&f| f.min(SHAKABLE - 1)).collect();
        let shaken = proba("m6_shaking", SHAKABLE, &shakable, &with(SHAKEN))?;
        let estimate = |((action, poured), shaken): ((&Vec<f64>, &Vec<f64>), &Vec<f64>)| {
            // The classes of the whole cascade: nothing, or an action times what it moves.
            let mut joint = [0.0; Filling::COUNT];
            joint[0] = action[0];
            for (p, filling) in [(action[POURED], poured), (action[SHAKEN], shaken)] {
                filling.iter().zip(&mut joint[1..]).for_each(|(q, all)| *all += p * q);
            }
            let decided = match argmax(action) {
                POURED => 1 + argmax(poured),
                SHAKEN => 1 + argmax(shaken),
                _ => 0,
            };
            Estimate::joint(decided, Some(&joint))
        };
        Ok(vec![actions.iter().zip(&poured).zip(&shaken).map(estimate).collect()])
    }
}
