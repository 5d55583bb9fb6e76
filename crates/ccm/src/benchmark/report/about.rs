//! What was used, what the names mean, what to cite.

use corsmal_report::{Fact, Section, capitalised};

use crate::benchmark::Made;
use crate::benchmark::baselines::BaselineResult;
use crate::benchmark::predicted::Predicted;
use crate::benchmark::results::Rows;
use crate::citation;
use crate::dataset::DataSet;

pub(super) fn facts(
    set: &DataSet,
    rows: &Rows,
    outcomes: &[BaselineResult],
    seed: u64,
    made: &Made,
) -> Vec<Fact> {
    let mut facts = citation::facts();
    facts.push(Fact::new("Data folder", set.root.display().to_string()));
    facts.push(Fact::new("Training recordings", format!("{} of 684", rows.training.len())));
    for test in &rows.tests {
        let labelled = test.rows.iter().filter(|t| t.filling.is_some()).count();
        facts.push(Fact::new(
            format!("{} recordings", capitalised(test.subset.name())),
            format!("{} of 228, {labelled} with labels", test.rows.len()),
        ));
    }
    let mut sets: Vec<String> = outcomes
        .iter()
        .map(|o| format!("{} {:.8}", o.baseline.features.preset(), o.config.hash()))
        .collect();
    sets.dedup();
    if !sets.is_empty() {
        facts.push(Fact::new("Feature configurations", sets.join(", ")));
    }
    facts.push(Fact::new("Seed", seed.to_string()));
    let (version, os, arch) =
        (env!("CARGO_PKG_VERSION"), std::env::consts::OS, std::env::consts::ARCH);
    facts.push(Fact::new("Made by", format!("corsmal-feat {version}, {os} {arch}")));
    facts.extend(made.on.iter().map(|on| Fact::new("Date", on)));
    facts.extend(made.command.iter().map(|command| Fact::new("Command", command)));
    facts
}

/// Who M1 to M6 are.
pub(super) fn methods() -> Section {
    Section {
        text: vec![
            "The paper compares six submissions to the CORSMAL Challenge with its own baselines. \
             Its short names denote these teams; what each method does is summarised from the \
             paper and, if it was published, from its code."
                .into(),
        ],
        terms: citation::methods(),
        ..Section::new("methods", "M1 to M6")
    }
}

/// `nowhere`: methods whose files have no recording of the data set.
pub(super) fn notes<'a>(
    nowhere: impl Iterator<Item = &'a str>,
    predicted: &Predicted<'_>,
) -> Section {
    let &Predicted { outcomes, runs, cautions, .. } = predicted;
    let of_systems = runs
        .iter()
        .flat_map(|run| run.notes.iter().map(|note| format!("{} of this run: {note}", run.system)));
    let absent = nowhere
        .map(|name| format!("The predictions of {name} are for no recording of this data set."));
    Section {
        text: [
            "The organisers do not publish the labels of the real test parts: the folder \
             submissions has estimates for them in the official format. Where this page shows test \
             scores of this run, labels were found in the data folder."
                .into(),
            "The paper's tables disagree with its text in places: its text gives 80.84, 79.65 and \
             78.65 for the filling level of M4, M5 and M6 where its table has 78.56, 79.65 and \
             80.84, and the combined filling mass of M3 (53.47) is not the mean of its public and \
             private figures (51.97). Figures on this page are those of the tables."
                .into(),
        ]
        .into_iter()
        .chain(outcomes.iter().any(|outcome| outcome.baseline.pca).then(|| {
            "The near-random scores of the paper's PCA baselines come with principal components \
             fitted separately on each test part, which the published protocol repeats in this run."
                .into()
        }))
        .chain(absent)
        .chain(cautions.iter().cloned())
        .chain(of_systems)
        .collect(),
        ..Section::new("notes", "Reading these figures")
    }
}

/// The paper and the data set.
pub(super) fn cite() -> Section {
    Section {
        text: vec![
            "Please cite the paper and the data set when you publish results of this benchmark."
                .into(),
        ],
        snippets: citation::bibtex(),
        ..Section::new("cite", "Cite")
    }
}
