use std::collections::HashMap;

use corsmal_ccm::Result;
use corsmal_ccm::benchmark::{Estimate, Prepared, System, Work};
use corsmal_models::argmax;
use corsmal_models::classifiers::RandomForestParams;
use corsmal_models::pipeline::PipelineSpec;
use corsmal_nets::dataset::Dataset;
use corsmal_nets::items::{Column, Items};
use ndarray::{Array2, Axis};

use crate::learning::{Learning, array};
use crate::definition::{Definition, Settings};

/// Because It's Tactile's system.
pub(crate) const M5: Definition = Definition {
    name: "m5",
    about: "M5 (Because It's Tactile): a forest over statistics of the sound, GRUs over VGGish and \
            R(2+1)D embeddings, averaged",
    networks: &["m5_vggish_level", "m5_vggish_type", "m5_r21d_level"],
    limits: &["The embeddings come from `corsmal-feat embed`; give them with --embeddings; its \
               capacity needs views: `corsmal-feat capacity --method m5`."],
    make: |settings| Box::new(Tactile(settings)),
};

/// Embeddings by name, the networks that take them, and what they are made of.
const BRANCHES: [(&str, &str, Option<&str>, &str); 2] = [
    ("vggish", "m5_vggish_level", Some("m5_vggish_type"), "audio"),
    ("r21d", "m5_r21d_level", None, "rgb1+rgb2+rgb3+rgb4"),
];

/// The largest of the published numbers of trees to choose from.
const TREES: usize = 500;

struct Tactile(Settings);

struct Ready<'a> {
    learning: Learning<'a>,
    statistics: Array2<f64>,
    /// items of all recordings for each branch that has its embeddings
    branches: Vec<Branch>,
    levels: Vec<usize>,
    types: Vec<usize>,
    seed: u64,
}

struct Branch {
    level: &'static str,
    kind: Option<&'static str>,
    source: &'static str,
    items: Items,
}

impl System for Tactile {
    fn name(&self) -> &'static str {
        "M5"
    }

    fn prepare<'a>(&'a self, work: &'a Work<'a>) -> Result<Box<dyn Prepared + 'a>> {
        let learning = Learning::new("M5", work, &self.0);
        let known = BRANCHES.map(|(name, ..)| name);
        let mut given = self.0.embeddings.iter().map(|(name, _)| name);
        if let Some(other) = given.find(|name| !known.contains(&name.as_str())) {
            let known = known.join(" and ");
            return Err(learning.fault(&format!("it takes embeddings {known}, not {other}")));
        }
        let mut branches = Vec::new();
        for (name, level, kind, source) in BRANCHES {
            match embeddings(&learning, &self.0, name, level)? {
                Some(items) => branches.push(Branch { level, kind, source, items }),
                None => learning.note(format!(
                    "{name} embeddings were not given (--embeddings {name}=FILE.npz), so that \
                     branch is left out."
                )),
            }
        }
        let vectors = learning.summaries("a34f136")?;
        let shape = (vectors.len(), vectors.first().map_or(0, Vec::len));
        let flat = vectors.into_iter().flatten().map(f64::from).collect();
        let statistics = Array2::from_shape_vec(shape, flat).map_err(|e| learning.fault(&e))?;
        let (levels, types) = (learning.levels(), learning.types());
        let seed = work.seed;
        Ok(Box::new(Ready { learning, statistics, branches, levels, types, seed }))
    }
}

/// The embeddings of every recording, where files of that name were given.
fn embeddings(
    learning: &Learning<'_>,
    settings: &Settings,
    name: &str,
    network: &str,
) -> Result<Option<Items>> {
    let files = settings.embeddings.iter().filter(|(n, _)| n == name);
    let network = corsmal_nets::networks::named(network)
        .and_then(|definition| definition.build(None, 0))
        .map_err(|e| learning.fault(&e))?;
    let mut sets = Vec::new();
    for (_, path) in files {
        sets.push((path, Dataset::read(path, &network).map_err(|e| learning.fault(&e))?));
    }
    if sets.is_empty() {
        return Ok(None);
    }
    let mut places: HashMap<&str, (usize, usize)> = HashMap::new();
    for (s, (_, set)) in sets.iter().enumerate() {
        for (row, id) in set.ids.iter().enumerate() {
            if let Some((other, _)) = places.insert(id, (s, row)) {
                return Err(learning.fault(&format!(
                    "{} and {}: both have {name} embeddings of {id}; leave one out or, if they are of different recordings, \
                     use ids such as 1/s0_fi1_fu1_b0_l0",
                    sets[other].0.display(),
                    sets[s].0.display()
                )));
            }
        }
    }
    let find = |subject: &corsmal_ccm::benchmark::Subject| {
        let named = subject.container.zip(subject.name).map(|(c, n)| format!("{c}/{n}"));
        let named = named.and_then(|id| places.get(id.as_str()));
        named.or_else(|| places.get(subject.input.id.as_str())).copied()
    };
    let found: Vec<Option<(usize, usize)>> = learning.subjects().iter().map(find).collect();
    let missing = found.iter().filter(|f| f.is_none()).count();
    if let Some(first) = found.iter().position(Option::is_none) {
        let id = &learning.subjects()[first].input.id;
        return Err(learning.fault(&format!(
            "{}: {name} embeddings of {missing} recordings are missing, the first is {id}; ids are \
             those, or container/sequence such as 1/s0_fi1_fu1_b0_l0",
            sets[0].0.display()
        )));
    }
    let columns = (0..network.inputs().len()).map(|input| {
        let item = |&(set, row): &(usize, usize)| {
            let Column { values, offsets } = &sets[set].1.items.columns[input];
            &values[offsets[row]..offsets[row + 1]]
        };
        Column::of(found.iter().flatten().map(item))
    });
    Ok(Some(Items { columns: columns.collect() }))
}

impl Ready<'_> {
    /// The forest's probabilities.
    fn forest(
        &self,
        classes: &[usize],
        n_classes: usize,
        train: &[usize],
        wanted: &[usize],
    ) -> Result<Vec<Vec<f64>>> {
        let fault = |e: corsmal_models::ModelError| self.learning.fault(&e);
        let params = RandomForestParams { trees: TREES, seed: self.seed, ..Default::default() };
        let y: Vec<usize> = train.iter().map(|&row| classes[row]).collect();
        let model = PipelineSpec::standardized(params)
            .train(self.statistics.select(Axis(0), train).view(), &y, n_classes)
            .map_err(fault)?;
        let proba = model
            .predict_proba(self.statistics.select(Axis(0), wanted).view())
            .map_err(fault)?;
        Ok(proba.rows().into_iter().map(|row| row.to_vec()).collect())
    }
}

/// Means of the members' probabilities.
fn mean(members: &[Vec<Vec<f64>>]) -> Vec<Vec<f64>> {
    let rows = members.first().map_or(0, Vec::len);
    let sum = |row: usize, class: usize| members.iter().map(|m| m[row][class]).sum::<f64>();
    let of = |row: usize| {
        (0..members[0][row].len()).map(|class| sum(row, class) / members.len() as f64).collect()
    };
    (0..rows).map(of).collect()
}

impl Prepared for Ready<'_> {
    fn inputs(&self) -> Vec<String> {
        let more = self.branches.iter().map(|b| b.source).filter(|s| *s != "audio");
        vec![std::iter::once("audio").chain(more).collect::<Vec<_>>().join("+")]
    }

    fn notes(&self) -> Vec<String> {
        let trees = format!("{TREES} trees; the published code chooses among 10 to 500.");
        self.learning.notes().into_iter().chain([trees]).collect()
    }

    fn predict(&self, train: &[usize], wanted: &[usize]) -> Result<Vec<Vec<Estimate>>> {
        let mut levels = vec![self.forest(&self.levels, 3, train, wanted)?];
        let mut types = vec![self.forest(&self.types, 4, train, wanted)?];
        for branch in &self.branches {
            let proba = |network, outputs, classes| {
                let trained = self.learning.train(network, outputs, &branch.items, classes, train)?;
                self.learning.probabilities(&trained, &branch.items, wanted)
            };
            levels.push(proba(branch.level, 3, &self.levels)?);
            if let Some(kind) = branch.kind {
                types.push(proba(kind, 4, &self.types)?);
            }
        }
        let (levels, types) = (mean(&levels), mean(&types));
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
