use corsmal_ccm::Result;
use corsmal_ccm::benchmark::{Estimate, Prepared, System, Work};
use corsmal_models::argmax;
use corsmal_nets::items::Items;

use crate::learning::{self, Learning, array};
use crate::definition::{Definition, Settings};

/// NTNU-ERC's system.
pub(crate) const M2: Definition = Definition {
    name: "m2",
    about: "M2 (NTNU-ERC): type from a convolutional network on MFCC",
    networks: &["m2_type", "m2_capacity"],
    limits: &["Its capacity network needs the depth views: `corsmal-feat capacity train --method m2`, \
               then `benchmark --capacity m2=MODEL`."],
    make: |settings| Box::new(Ntnu(settings)),
};

struct Ntnu(Settings);

struct Ready<'a> {
    learning: Learning<'a>,
    items: Items,
    types: Vec<usize>,
}

impl System for Ntnu {
    fn name(&self) -> &'static str {
        "M2"
    }

    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> Result<Box<dyn Prepared + 'a>> {
        let learning = Learning::new("M2", work, &self.0);
        learning.note("type only; its capacity needs the depth views.".into());
        let items = learning::single(learning.items("m2_type")?);
        let types = learning.types();
        Ok(Box::new(Ready { learning, items, types }))
    }
}

impl Prepared for Ready<'_> {
    fn notes(&self) -> Vec<String> {
        self.learning.notes()
    }

    fn predict(&self, train: &[usize], wanted: &[usize]) -> Result<Vec<Vec<Estimate>>> {
        let trained = self.learning.train("m2_type", 4, &self.items, &self.types, train)?;
        let found = self.learning.probabilities(&trained, &self.items, wanted)?;
        let estimate = |kind: &Vec<f64>| Estimate {
            kind: Some(argmax(kind)),
            kind_probabilities: array(kind),
            ..Estimate::default()
        };
        Ok(vec![found.iter().map(estimate).collect()])
    }
}
