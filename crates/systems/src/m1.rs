use corsmal_ccm::Result;
use corsmal_ccm::benchmark::{Estimate, Prepared, System, Work};
use corsmal_models::argmax;
use corsmal_nets::items::Items;

use crate::learning::{self, Learning, array};
use crate::definition::{Definition, Settings};

/// Challengers' system.
pub(crate) const M1: Definition = Definition {
    name: "m1",
    about: "M1 (Challengers): one perceptron each for level and type, from the sound",
    networks: &["m1"],
    limits: &["The paper gives neither the widths nor how frames become a vector: those are our \
               choice."],
    make: |settings| Box::new(Challengers(settings)),
};

struct Challengers(Settings);

struct Ready<'a> {
    learning: Learning<'a>,
    items: Items,
    levels: Vec<usize>,
    types: Vec<usize>,
}

impl System for Challengers {
    fn name(&self) -> &'static str {
        "M1"
    }

    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> Result<Box<dyn Prepared + 'a>> {
        let learning = Learning::new("M1", work, &self.0);
        let items = learning::single(learning.items("m1")?);
        let (levels, types) = (learning.levels(), learning.types());
        Ok(Box::new(Ready { learning, items, levels, types }))
    }
}

impl Prepared for Ready<'_> {
    fn notes(&self) -> Vec<String> {
        self.learning.notes()
    }

    fn predict(&self, train: &[usize], wanted: &[usize]) -> Result<Vec<Vec<Estimate>>> {
        let proba = |outputs, classes| {
            let trained = self.learning.train("m1", outputs, &self.items, classes, train)?;
            self.learning.probabilities(&trained, &self.items, wanted)
        };
        let (levels, types) = (proba(3, &self.levels)?, proba(4, &self.types)?);
        let estimate = |(level, kind): (&Vec<f64>, &Vec<f64>)| Estimate {
            level: Some(argmax(level)),
            kind: Some(argmax(kind)),
            level_probabilities: array(level),
            kind_probabilities: array(kind),
            ..Estimate::default()
        };
        Ok(vec![levels.iter().zip(&types).map(estimate).collect()])
    }
}
