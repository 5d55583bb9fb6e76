//! The report of the benchmark.

mod about;
mod capacities;
mod classes;
mod containers;
mod corrections;
mod glance;
mod tasks;

use corsmal_report::{Figure, Report};
use rayon::prelude::*;

use super::Made;
use super::method::{Part, methods};
use super::predicted::Predicted;
use super::results::Rows;
use crate::dataset::{DataSet, check};
use crate::error::Result;
use crate::paper::Task;

const SYNTHETIC: &str = "These recordings are SYNTHETIC. Nothing here says anything about the real \
                         data set or about the methods of the paper.";

pub(super) fn report(
    set: &DataSet,
    rows: &Rows,
    predicted: &Predicted<'_>,
    seed: u64,
    made: &Made,
) -> Result<Report> {
    let &Predicted { outcomes, runs, added, capacities, .. } = predicted;
    let methods = methods(rows, predicted, seed);
    let mut sections = vec![glance::section(set.synthetic, rows, &methods, seed)?];
    for task in Task::ALL {
        sections.push(tasks::section(task, rows, &methods, seed)?);
    }
    if !outcomes.is_empty() {
        sections.push(corrections::section(rows, outcomes, seed)?);
    }
    sections.push(containers::section(rows, &methods, seed)?);
    sections.extend(capacities::section(rows, &methods)?);
    sections.extend(classes::section(rows, &methods, seed)?);
    sections.push(about::methods());
    let given = added.iter().chain(capacities.iter().map(|(table, _)| table));
    let nowhere = given.filter(|a| !a.is_any()).map(|a| a.name.as_str());
    sections.push(about::notes(nowhere, predicted));
    sections.push(about::cite());
    Ok(Report {
        title: match (runs, capacities) {
            ([], []) => "CORSMAL benchmark: audio baselines".into(),
            _ => "CORSMAL benchmark".into(),
        },
        summary: "Filling level, filling type, capacity and filling mass of containers, estimated \
                  from the sound of pouring and shaking and from views, next to the results published in the \
                  paper."
            .into(),
        warning: warning(set),
        facts: about::facts(set, rows, outcomes, seed, made),
        sections,
    })
}

/// What must not be missed: that the data are synthetic, and recordings that are not as they should be.
fn warning(set: &DataSet) -> Option<String> {
    let odd = check(set).odd;
    let odd = odd.first().map(|first| {
        format!(
            "{} odd: {}: {}. `corsmal-feat dataset check` lists all.",
            match odd.len() {
                1 => "One file is".to_owned(),
                n => format!("{n} files are"),
            },
            first.path.display(),
            first.what
        )
    });
    let all: Vec<String> =
        set.synthetic.then(|| SYNTHETIC.to_owned()).into_iter().chain(odd).collect();
    (!all.is_empty()).then(|| all.join(" "))
}

/// The confusion matrices of every baseline, of both protocols, and of every system.
pub(super) fn figures(rows: &Rows, predicted: &Predicted<'_>, seed: u64) -> Result<Vec<Figure>> {
    let methods = methods(rows, predicted, seed);
    let figures = methods.par_iter().filter(|m| !m.completes()).map(|method| {
        let scores = method.scores(rows, Part::Training, seed, &|_| true);
        let Some((slug, scores)) = method.slug.as_ref().zip(scores) else { return Ok(Vec::new()) };
        classes::figures(slug, &format!("{}, {}", method.name, method.protocol), &scores)
    });
    Ok(figures.collect::<Result<Vec<_>>>()?.concat())
}
