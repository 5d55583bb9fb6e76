//! `train --net` and `cross-validate --net`.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::Ordering;

use corsmal_files::format::Content;
use corsmal_models::cv_plan::CvPlan;
use corsmal_models::labels::alike;
use corsmal_nets::NetError;
use corsmal_nets::device::Device;
use corsmal_nets::fit::Progress;
use corsmal_nets::networks;
use corsmal_nets::recipe::Recipe;
use corsmal_systems::SystemError;
use corsmal_systems::examples::Examples;
use corsmal_systems::training::{Trained, Training, Validated, Weights};
use serde_json::{Value, json};

use crate::args::{DatasetArgs, NetworkArgs, PipelineArgs};
use crate::failure::Failure;
use crate::plural::plural;
use crate::progress::repaired;
use crate::{interrupt, recordings};

/// What both commands are given.
pub struct Request<'a> {
    /// features and labels
    pub dataset: &'a DatasetArgs,
    /// what --set changes
    pub pipeline: &'a PipelineArgs,
    /// checkpoints
    pub network: &'a NetworkArgs,
    /// recordings that are extracted at a time
    pub jobs: usize,
    /// nothing but warnings
    pub quiet: bool,
}

/// Labelled items, and what is learned of them.
struct Loaded {
    examples: Examples,
    recipe: Recipe,
    target: String,
}

/// What has no items, by the kind of the reason: what is said of the first, and the ids of the others.
#[derive(Default)]
struct LeftOut(BTreeMap<String, (String, Vec<String>)>);

impl LeftOut {
    /// `name` is what the first of a kind is called: its file, or its id.
    fn add(&mut self, (id, name): (&str, &str), reason: &str) {
        // Behind it are figures of the one recording.
        let kind = reason.split_once(": ").map_or(reason, |(kind, _)| kind);
        match self.0.get_mut(kind) {
            Some((_, others)) => others.push(id.into()),
            None => {
                let first = format!("{name}: {reason}");
                self.0.insert(kind.into(), (first, Vec::new()));
            }
        }
    }

    fn tell(self) {
        for (kind, (first, others)) in self.0 {
            eprintln!("warning: {first}: left out of training");
            if !others.is_empty() {
                let named: Vec<&str> = others.iter().take(NAMED).map(String::as_str).collect();
                let more = match others.len().saturating_sub(NAMED) {
                    0 => String::new(),
                    more => format!(" and {more} more"),
                };
                let (count, named) = (others.len(), named.join(", "));
                eprintln!("warning: {count} more left out ({kind}): {named}{more}");
            }
        }
    }
}

/// Most that are named for one kind of reason.
const NAMED: usize = 10;

impl Request<'_> {
    fn load(&self, name: &str) -> Result<Loaded, Failure> {
        let definition = networks::classifier(name)?;
        let recipe = definition.recipe_with(&self.pipeline.changes()?)?;
        let (path, members) = (self.dataset.path(), &self.dataset.members);
        let takes_pictures = definition.picture().is_some();
        let mut examples = if self.dataset.crops.is_none() && is_inputs(path)? {
            Examples::of_file(definition, path, &members.names())?
        } else if takes_pictures || self.dataset.crops.is_some() {
            members.refuse()?;
            // Only the labels given by --labels count.
            let own = !self.dataset.has_labels();
            let mut left_out = LeftOut::default();
            let seen = Examples::of_pictures(
                definition,
                (path, own),
                interrupt::flag(),
                |id, file, reason| left_out.add((id, file), reason),
            );
            left_out.tell();
            match seen {
                Err(SystemError::Interrupted) => {
                    return Err(Failure::interrupted("interrupted; nothing was written"));
                }
                seen => seen?,
            }
        } else {
            members.refuse()?;
            let found = recordings::named(&[path], recordings::warn)?;
            let mut left_out = LeftOut::default();
            let heard = Examples::of_recordings(
                definition,
                (path, &found),
                self.jobs,
                interrupt::flag(),
                |input, reason| left_out.add((&input.id, &input.id), reason),
            );
            left_out.tell();
            let heard = match heard {
                Err(SystemError::Interrupted) => {
                    return Err(Failure::interrupted("interrupted; nothing was written"));
                }
                heard => heard?,
            };
            if let Some(repaired) = repaired(heard.table.outcomes.iter().map(|o| &o.repairs)) {
                recordings::warn(&format!("recordings: {repaired}"));
            }
            heard
        };
        // Networks are named after what they tell.
        let usual = ["level", "type"]
            .into_iter()
            .find(|column| definition.name.rsplit('_').next() == Some(column));
        let target = self.dataset.label(&mut examples.table, usual)?;
        let unlabelled = examples.keep_labelled(&target)?;
        if unlabelled > 0 {
            let items = plural(unlabelled, "item");
            eprintln!("warning: {}: {items} without {target}: left out", path.display());
        }
        if let Some(doubt) = examples.doubt() {
            eprintln!("warning: {}: {doubt}", path.display());
        }
        Ok(Loaded { examples, recipe, target })
    }

    /// Trains on all items.
    pub fn train(&self, name: &str) -> Result<Trained, Failure> {
        let device = Device::named(&self.network.device)?;
        let Loaded { examples, recipe, target } = self.load(name)?;
        for warning in alike(&examples.table.classes(&target)?.0) {
            eprintln!("warning: {warning}");
        }
        let files = match (examples.is_of_recordings(), examples.pictures()) {
            (true, _) => Value::Null,
            (false, Some(identity)) => {
                json!({ "pictures": self.dataset.path().display().to_string(), "identity": identity })
            }
            (false, None) => self.dataset.provenance()?,
        };
        let weights = self.weights()?;
        let training = self.training(&target, recipe, weights.as_ref(), device)?;
        if let Some(unheeded) = training.unheeded() {
            eprintln!("warning: {unheeded}");
        }
        let progress = |told: Progress<'_>| tell(examples.definition.name, told, self.quiet, F1);
        training.train(&examples, files, progress).map_err(|e| self.stopped(e))
    }

    /// Holds out parts of the items in turn.
    pub fn cross_validate(
        &self,
        name: &str,
        plan: Option<&CvPlan>,
    ) -> Result<(Examples, Validated), Failure> {
        if let Some(path) = &self.network.weights {
            refuse_own("--weights", path)?;
        }
        let device = Device::named(&self.network.device)?;
        let Loaded { examples, recipe, target } = self.load(name)?;
        let weights = self.weights()?;
        let training = self.training(&target, recipe, weights.as_ref(), device)?;
        let (folds, warnings) = training.folds(&examples, plan, self.pipeline.seed())?;
        for warning in warnings {
            eprintln!("warning: {warning}");
        }
        let found = training
            .cross_validate(&examples, folds, |fold, told| tell(fold, told, self.quiet, F1))
            .map_err(|e| self.stopped(e))?;
        Ok((examples, found))
    }

    fn training<'t>(
        &'t self,
        target: &'t str,
        recipe: Recipe,
        weights: Option<&'t Weights>,
        device: Device,
    ) -> Result<Training<'t>, Failure> {
        let groups = self.dataset.groups.as_deref();
        tell_device(&device, self.quiet);
        Ok(Training { target, groups, recipe, checkpoints: self.folder()?, weights, device })
    }

    fn weights(&self) -> Result<Option<Weights>, Failure> {
        Ok(self.network.weights.as_deref().map(Weights::read).transpose()?)
    }

    fn folder(&self) -> Result<Option<&Path>, Failure> {
        let Some(folder) = self.network.checkpoints.as_deref() else { return Ok(None) };
        std::fs::create_dir_all(folder)
            .map_err(|e| Failure::new(format!("{}: {e}", folder.display())))?;
        Ok(Some(folder))
    }

    fn stopped(&self, error: SystemError) -> Failure {
        match (&error, &self.network.checkpoints) {
            (SystemError::Network(NetError::Stopped { .. }), Some(_)) => {
                Failure::interrupted(format!("{error}; run the same command again to continue"))
            }
            (SystemError::Network(NetError::Stopped { .. }), None) => {
                Failure::interrupted(format!("{error}; --checkpoints FOLDER keeps finished epochs"))
            }
            _ => error.into(),
        }
    }
}

/// Names a GPU to the user.
pub fn tell_device(device: &Device, quiet: bool) {
    if let (Some(gpu), false) = (device.gpu_name(), quiet) {
        eprintln!("networks train on {gpu}");
    }
}

/// Refuses weights that a training of this tool made, where scores of recordings are wanted that it may have
/// seen.
pub fn refuse_own(option: &str, path: &Path) -> Result<(), Failure> {
    if !corsmal_nets::weights::trained_here(path) {
        return Ok(());
    }
    Err(Failure::new(format!(
        "{option}: {} is a network that this tool trained, perhaps on recordings that are held \
         out here; give weights from elsewhere",
        path.display()
    )))
}

/// The score of classifiers.
const F1: &str = "weighted F1";

/// A line for each epoch with its score of this name, unless `quiet`; before any step, false once the user asked to
/// stop.
pub fn tell(name: &str, progress: Progress<'_>, quiet: bool, scored: &str) -> bool {
    if !quiet && progress.step.is_none() {
        let (done, total) = (progress.epochs.len(), progress.total);
        let left = span(progress.left.as_secs());
        match progress.epochs.last() {
            None => {
                let mib = progress.memory.div_ceil(1 << 20);
                let epochs = if total == 1 { "epoch" } else { "epochs" };
                eprintln!("{name}: {total} {epochs}, about {left}, {mib} MiB of memory");
            }
            Some(epoch) => {
                let score = epoch.score.map(|s| format!(", {scored} {:.2}", 100.0 * s));
                let score = score.unwrap_or_default();
                eprintln!(
                    "{name}: epoch {done} of {total}: loss {:.4}{score}, {left} left",
                    epoch.loss
                );
            }
        }
    }
    !interrupt::flag().load(Ordering::SeqCst)
}

/// Whether a path names a file of a network's inputs, and not recordings; a stream is not looked into.
///
/// # Errors
/// A table that networks do not take.
pub fn is_inputs(path: &Path) -> Result<bool, Failure> {
    match path.is_file().then(|| Content::of(path)) {
        Some(Ok(Content::Npz)) => Ok(true),
        Some(Ok(Content::Parquet)) => Err(Failure::new(format!(
            "{}: is a Parquet table; a network takes an .npz of its inputs, or recordings",
            path.display()
        ))),
        _ => Ok(false),
    }
}

/// A duration for people.
fn span(seconds: u64) -> String {
    match seconds {
        0..120 => format!("{seconds} s"),
        120..7200 => format!("{} min", seconds / 60),
        _ => format!("{:.1} h", seconds as f64 / 3600.0),
    }
}
