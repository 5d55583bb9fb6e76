//! The report of the benchmark.

mod about;
mod classes;
mod containers;
mod corrections;
mod glance;
mod tasks;

use std::path::Path;

use corsmal_report::Report;

use super::Made;
use super::added::Placed;
use super::baselines::Outcome;
use super::method::{Part, methods};
use super::results::Rows;
use crate::dataset::DataSet;
use crate::error::Result;
use crate::paper::Task;

const SYNTHETIC: &str = "These recordings are SYNTHETIC. Nothing here says anything about the real \
                         data set or about the methods of the paper.";

pub(super) fn report(
    set: &DataSet,
    rows: &Rows,
    outcomes: &[Outcome],
    added: &[Placed],
    seed: u64,
    made: &Made,
) -> Result<Report> {
    let methods = methods(rows, outcomes, added, seed);
    let mut sections = vec![glance::section(set.synthetic, rows, &methods, seed)?];
    for task in Task::ALL {
        sections.push(tasks::section(task, rows, &methods, seed)?);
    }
    sections.push(corrections::section(rows, outcomes, seed)?);
    sections.push(containers::section(rows, &methods, seed)?);
    sections.extend(classes::section(rows, &methods, seed)?);
    sections.push(about::methods());
    let nowhere = added.iter().filter(|a| !a.is_any()).map(|a| a.name.as_str());
    sections.push(about::notes(nowhere));
    sections.push(about::cite());
    Ok(Report {
        title: "CORSMAL benchmark: audio baselines".into(),
        summary: "Filling level, filling type, capacity and filling mass of containers, estimated \
                  from the sound of pouring and shaking, next to the results published in the \
                  paper."
            .into(),
        warning: set.synthetic.then(|| SYNTHETIC.to_string()),
        facts: about::facts(set, rows, outcomes, seed, made),
        sections,
    })
}

/// Writes the confusion matrices of every baseline, of both protocols, into a folder.
pub(super) fn write_figures(
    folder: &Path,
    rows: &Rows,
    outcomes: &[Outcome],
    seed: u64,
) -> Result<()> {
    for (method, outcome) in methods(rows, outcomes, &[], seed).iter().zip(outcomes) {
        let Some(scores) = method.scores(rows, Part::Training, seed, &|_| true) else { continue };
        let name = format!("{}-{}", outcome.baseline.slug(), method.protocol);
        let title = format!("{}, {}", method.name, method.protocol);
        for figure in classes::figures(&name, &title, &scores)? {
            figure.write(folder)?;
        }
    }
    Ok(())
}
