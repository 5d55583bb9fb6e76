//! The report's tables and pictures from what was predicted.

use std::path::Path;

use super::added::Placed;
use super::baselines::{Outcome, Variant};
use super::files;
use super::results::{Estimate, PartScores, Rows, Target, score};
use super::sections::{breakdown, confusions, corrections, glance, notes, task_section};
use crate::dataset::{DataSet, Filling, FillingLevel, FillingType, Subset};
use crate::error::Result;
use crate::paper::Task;
use crate::report::{Report, Source};
use crate::submission::pseudo_random;

const SYNTHETIC: &str = "These recordings are SYNTHETIC. Nothing here says anything about the real \
                         data set or about the methods of the paper.";

/// One line of the tables: a method with its estimates.
pub(super) struct Method {
    pub(super) name: String,
    pub(super) inputs: String,
    pub(super) protocol: String,
    pub(super) source: Source,
    /// Estimates of training recordings that were not trained on, by row number.
    training: Vec<(usize, Estimate)>,
    /// Estimates of each test part, where there are any.
    tests: Vec<Option<Vec<Estimate>>>,
}

/// A part of the recordings.
#[derive(Clone, Copy)]
pub(super) enum Part {
    Training,
    Test(Subset),
    Combined,
}

impl Method {
    /// Scores over the recordings of a part that `keep` takes; `None` where nothing is known.
    pub(super) fn scores(
        &self,
        rows: &Rows,
        part: Part,
        seed: u64,
        keep: &dyn Fn(&Target) -> bool,
    ) -> Option<PartScores> {
        let mut pairs: Vec<(&Target, &Estimate)> = Vec::new();
        match part {
            Part::Training => {
                pairs.extend(self.training.iter().map(|(row, e)| (&rows.training[*row], e)));
            }
            Part::Test(_) | Part::Combined => {
                for (test, estimates) in rows.tests.iter().zip(&self.tests) {
                    if matches!(part, Part::Test(subset) if subset != test.subset) {
                        continue;
                    }
                    pairs.extend(test.rows.iter().zip(estimates.as_ref()?));
                }
                // Only one of the two test parts is no combination.
                if matches!(part, Part::Combined) && rows.tests.len() < 2 {
                    return None;
                }
            }
        }
        pairs.retain(|(target, _)| keep(target));
        let (targets, estimates): (Vec<_>, Vec<_>) =
            pairs.into_iter().map(|(t, e)| (t, e.clone())).unzip();
        score(&targets, &estimates, seed)
    }
}

pub(super) fn report(
    set: &DataSet,
    rows: &Rows,
    outcomes: &[Outcome],
    added: &[Placed],
    seed: u64,
) -> Result<Report> {
    let methods = methods(rows, outcomes, added, seed);
    let mut sections = vec![glance(rows, &methods, seed)];
    sections.extend(Task::ALL.into_iter().map(|task| task_section(task, rows, &methods, seed)));
    sections.push(corrections(rows, outcomes, seed));
    sections.push(breakdown(rows, &methods, seed));
    sections.extend(confusions(rows, &methods, seed));
    let nowhere = added.iter().filter(|a| !a.is_any()).map(|a| a.name.as_str());
    sections.push(notes(nowhere));
    Ok(Report {
        title: "CORSMAL benchmark: audio baselines".into(),
        summary: "Filling level, filling type, capacity and filling mass of containers, estimated \
                  from the sound of pouring and shaking, beside the figures that the paper prints."
            .into(),
        warning: set.synthetic.then(|| SYNTHETIC.to_string()),
        facts: facts(set, rows, outcomes, seed),
        sections,
    })
}

/// Writes the pictures of every baseline.
pub(super) fn write_pictures(
    out: &Path,
    rows: &Rows,
    outcomes: &[Outcome],
    seed: u64,
) -> Result<()> {
    for (method, outcome) in methods(rows, outcomes, &[], seed).iter().zip(outcomes) {
        let Some(scores) = method.scores(rows, Part::Training, seed, &|_| true) else { continue };
        let slug = outcome.baseline.slug();
        for (task, labels, matrix) in [
            ("level", level_names(), &scores.level_matrix),
            ("type", kind_names(), &scores.kind_matrix),
            ("joint", joint_names(), &scores.joint_matrix),
        ] {
            let title = format!("{}, {}: {task}", method.name, method.protocol);
            files::write_pictures(
                out,
                &format!("{slug}-{}-{task}", method.protocol),
                &title,
                &labels,
                matrix,
            )?;
        }
    }
    Ok(())
}

fn methods(rows: &Rows, outcomes: &[Outcome], added: &[Placed], seed: u64) -> Vec<Method> {
    let mut list: Vec<Method> = outcomes
        .iter()
        .map(|o| Method {
            name: o.baseline.name(),
            inputs: "audio".into(),
            protocol: match o.variant {
                Variant::Published => "published".into(),
                Variant::Corrected => "corrected".into(),
            },
            source: Source::Ours,
            training: o.held_out.clone(),
            tests: o.tests.iter().cloned().map(Some).collect(),
        })
        .collect();
    let random = |targets: &[Target]| -> Vec<Estimate> {
        let keys: Vec<_> = targets.iter().map(|t| t.key).collect();
        pseudo_random(&keys, seed).into_iter().map(Estimate::from).collect()
    };
    list.push(Method {
        name: "Random".into(),
        inputs: String::new(),
        protocol: format!("seed {seed}"),
        source: Source::Ours,
        training: random(&rows.training).into_iter().enumerate().collect(),
        tests: rows.tests.iter().map(|t| Some(random(&t.rows))).collect(),
    });
    list.extend(added.iter().filter(|a| a.is_any()).map(|a| Method {
        name: a.name.clone(),
        inputs: String::new(),
        protocol: "given".into(),
        source: Source::Added,
        training: a.training.iter().flatten().cloned().enumerate().collect(),
        tests: a.tests.clone(),
    }));
    list
}

fn facts(set: &DataSet, rows: &Rows, outcomes: &[Outcome], seed: u64) -> Vec<(String, String)> {
    let mut facts = vec![
        ("Data set".to_string(), set.root.display().to_string()),
        ("Training recordings".into(), format!("{} of 684", rows.training.len())),
    ];
    for test in &rows.tests {
        let labelled = test.rows.iter().filter(|t| t.filling.is_some()).count();
        facts.push((
            format!("{} recordings", capitalised(test.subset.name())),
            format!("{} of 228, {labelled} with labels", test.rows.len()),
        ));
    }
    let mut sets: Vec<String> = outcomes
        .iter()
        .map(|o| format!("{} {:.8}", o.baseline.features.preset(), o.config.hash()))
        .collect();
    sets.dedup();
    facts.push(("Feature configurations".into(), sets.join(", ")));
    facts.push(("Seed".into(), seed.to_string()));
    facts.push(("Made by".into(), format!("corsmal-feat {}", env!("CARGO_PKG_VERSION"))));
    facts
}

fn capitalised(text: &str) -> String {
    let mut chars = text.chars();
    chars.next().map_or_else(String::new, |c| c.to_uppercase().chain(chars).collect())
}

pub(super) fn level_names() -> Vec<String> {
    FillingLevel::ALL.map(|l| l.name().to_string()).to_vec()
}

pub(super) fn kind_names() -> Vec<String> {
    FillingType::ALL.map(|k| k.name().to_string()).to_vec()
}

pub(super) fn joint_names() -> Vec<String> {
    Filling::all().map(|f| f.name().replace(" half", " 50").replace(" full", " 90")).collect()
}
