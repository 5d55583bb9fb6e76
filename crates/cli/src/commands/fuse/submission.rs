//! Fused type and level as an official submission.

use std::collections::HashMap;
use std::mem::discriminant;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

use corsmal_ccm::capacity::{self, Measured};
use corsmal_ccm::dataset::{Annotations, Container, Subset};
use corsmal_ccm::decision::{Containers, Rule, decide, decide_joint};
use corsmal_ccm::predictions::Named;
use corsmal_ccm::submission::{self, RowKey, Submission, SubmissionRow, official_rows};

use super::args::{Args, Format, Part};
use crate::failure::{FAILED_FILES, Failure};
use crate::output::is_stdout;

/// Decides, checks and writes.
pub fn run(args: &Args) -> Result<ExitCode, Failure> {
    let options = &args.submission;
    if is_stdout(&args.out) {
        let out = args.out.display();
        return Err(Failure::new(format!(
            "--out {out} is not possible for a submission: name a file"
        )));
    }
    let chosen = options.format.unwrap_or(Format::Y2020);
    if options.mass_prior && chosen == Format::Y2020 {
        return Err(Failure::new(
            "--mass-prior: the format of 2020 has no masses; --format 2022 has",
        ));
    }
    let fused = |paths: &[PathBuf], weights: &Option<Vec<f64>>| {
        let some = !paths.is_empty();
        some.then(|| args.fused(paths, weights.as_deref())).transpose()
    };
    if options.feasible {
        args.vote.refuse_background("--feasible")?;
    }
    let joint = fused(&args.joint, &args.weights)?;
    let kind = fused(&args.kind, &args.type_weights)?;
    let level = fused(&args.level, &args.level_weights)?;
    let tables: Vec<_> = [&kind, &level].into_iter().flatten().collect();
    if let Some(doubt) = corsmal_ccm::fused::doubt(&tables) {
        eprintln!("warning: {doubt}");
    }
    for table in kind.iter().filter(|table| table.labels == ["0", "1", "2"]) {
        eprintln!(
            "warning: {}: the classes of the type are 0, 1 and 2, without 3 (water): is this a \
             table of levels?",
            table.path.display()
        );
    }
    let rule = match (options.feasible, options.dry_boxes) {
        (false, _) => Rule::Separate,
        (true, false) => Rule::Joint,
        (true, true) => Rule::JointDryBoxes,
    };
    if rule != Rule::Separate && (kind.is_none() || level.is_none()) {
        return Err(Failure::new("--feasible needs both --type and --level"));
    }
    let format = match chosen {
        Format::Y2020 => submission::Format::Y2020,
        Format::Y2022 => submission::Format::Y2022,
    };
    let annotations = options.annotations.as_deref().map(Annotations::read).transpose()?;
    if let (Some(annotations), Some(part)) = (&annotations, options.part) {
        require_part(annotations, subset(part))?;
    }
    let containers = annotations.as_ref().map_or_else(Containers::new, containers);
    let mut predictions = match (&joint, &kind, &level) {
        (Some(joint), ..) => decide_joint(joint)?,
        (None, None, None) => {
            return Err(Failure::new(
                "nothing to fuse: give --predictions, --type, --level or --joint",
            ));
        }
        (None, kind, level) => decide(kind.as_ref(), level.as_ref(), rule, &containers)?,
    };
    let names = annotations.as_ref().map(|annotations| Names::of(annotations, format));
    if let Some(names) = &names {
        for prediction in &mut predictions {
            prediction.key = names.of_format(prediction.key).ok_or_else(|| {
                let path = names.path.display();
                Failure::new(match names.names.is_empty() {
                    true => format!(
                        "{path}: has no sequence numbers beside its ids, so rows cannot be named for --format {}",
                        match format {
                            submission::Format::Y2020 => 2020,
                            submission::Format::Y2022 => 2022,
                        }
                    ),
                    false => format!("{path}: has no line for {}", prediction.key),
                })
            })?;
        }
    }
    if let Some(path) = &options.capacity {
        complete(&mut predictions, path, options.part, names.as_ref())?;
    }
    if options.mass_prior {
        let mass = Some(capacity::PRIOR_MASS_G);
        predictions.iter_mut().for_each(|prediction| prediction.container_mass_g = mass);
    }
    let expected: Vec<RowKey> = match options.part {
        None => predictions.iter().map(|p| p.key).collect(),
        Some(part) => official_rows(subset(part), format),
    };
    Submission::write(&args.out, format, &predictions, &expected)?;
    let failed = predictions.iter().filter(|p| p.kind.is_none() && p.level.is_none()).count();
    let without = |has: fn(&SubmissionRow) -> bool| predictions.iter().filter(|p| !has(p)).count();
    let lacking = [
        ("type", without(|p| p.kind.is_some())),
        ("level", without(|p| p.level.is_some())),
        ("capacity", without(|p| p.capacity_ml.is_some())),
    ];
    args.tell(predictions.len(), failed, &lacking)?;
    Ok(if failed > 0 { ExitCode::from(FAILED_FILES) } else { ExitCode::SUCCESS })
}

/// Adds measured capacities, one to every prediction.
fn complete(
    predictions: &mut [SubmissionRow],
    path: &Path,
    part: Option<Part>,
    names: Option<&Names<'_>>,
) -> Result<(), Failure> {
    let mut capacities = of_part(capacity::read(path)?, part, path)?;
    if let Some(names) = names {
        let named = |(key, measured)| (names.of_format(key).unwrap_or(key), measured);
        capacities = capacities.into_iter().map(named).collect();
    }
    let is_other = |key: &RowKey| {
        predictions.iter().all(|prediction| discriminant(&prediction.key) != discriminant(key))
    };
    let remedy = match names.is_none() && capacities.keys().any(is_other) {
        true => "; it names recordings in another way, and --annotations has both names",
        false => "",
    };
    let place = path.display();
    for prediction in predictions {
        let key = prediction.key;
        let measured = capacities
            .remove(&key)
            .ok_or_else(|| Failure::new(format!("{place}: has no line for {key}{remedy}")))?;
        measured.complete(prediction);
    }
    match capacities.keys().min() {
        None => Ok(()),
        Some(extra) => {
            Err(Failure::new(format!("{place}: has a line for {extra}, which has no prediction")))
        }
    }
}

fn subset(part: Part) -> Subset {
    match part {
        Part::Training => Subset::Training,
        Part::Public => Subset::Public,
        Part::Private => Subset::Private,
    }
}

/// The rows of the wanted part, where they say of which part they are.
fn of_part(
    all: HashMap<Named, Measured>,
    part: Option<Part>,
    path: &Path,
) -> Result<HashMap<RowKey, Measured>, Failure> {
    let mut rows = HashMap::with_capacity(all.len());
    for (named, measured) in all {
        if part.is_some_and(|wanted| named.part.is_some_and(|part| part != subset(wanted))) {
            continue;
        }
        if rows.insert(named.key, measured).is_some() {
            return Err(Failure::new(format!(
                "{}: has {} in several parts of the data set: choose one with --part",
                path.display(),
                named.key
            )));
        }
    }
    Ok(rows)
}

/// Refuses annotations of another part of the data set, where the same numbers are other recordings.
fn require_part(annotations: &Annotations, part: Subset) -> Result<(), Failure> {
    let other = annotations.rows.iter().find(|row| {
        Container::new(row.container).is_some_and(|container| container.subset() != part)
    });
    match other {
        None => Ok(()),
        Some(row) => Err(Failure::new(format!(
            "{}: has container {}, which is not of the part that --part names",
            annotations.path.display(),
            row.container
        ))),
    }
}

/// The containers of the recordings, by their numbers.
fn containers(annotations: &Annotations) -> Containers {
    let rows = annotations.rows.iter();
    rows.filter_map(|row| Some((RowKey::Id(row.id?), Container::new(row.container)?))).collect()
}

/// What a format calls recordings that annotations name in both ways.
struct Names<'a> {
    path: &'a Path,
    format: submission::Format,
    names: HashMap<RowKey, RowKey>,
}

impl<'a> Names<'a> {
    fn of(annotations: &'a Annotations, format: submission::Format) -> Self {
        let pairs = annotations.rows.iter().filter_map(|row| {
            let sequence = RowKey::Sequence(row.container, row.sequence?);
            Some((sequence, RowKey::Id(row.id?)))
        });
        let names = match format {
            submission::Format::Y2022 => pairs.collect(),
            submission::Format::Y2020 => pairs.map(|(sequence, id)| (id, sequence)).collect(),
        };
        Self { path: &annotations.path, format, names }
    }

    /// The name in the format; `None` where the annotations do not have it.
    fn of_format(&self, key: RowKey) -> Option<RowKey> {
        match (self.format, key) {
            (submission::Format::Y2022, RowKey::Id(_))
            | (submission::Format::Y2020, RowKey::Sequence(..)) => Some(key),
            _ => self.names.get(&key).copied(),
        }
    }
}
