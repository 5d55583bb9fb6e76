//! What the systems share: features of all recordings, networks trained on some of them.

use std::cell::RefCell;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use corsmal_ccm::benchmark::{Subject, Work};
use corsmal_ccm::{CcmError, Result};
use corsmal_models::scores::Scores;
use corsmal_nets::NetError;
use corsmal_nets::fit::{self, Task};
use corsmal_nets::front_end::{FrontEnd, Item};
use corsmal_nets::items::{Column, Items};
use corsmal_nets::network::Network;
use corsmal_nets::networks::{self, Definition};
use corsmal_nets::recipe::{Recipe, Select};

use crate::definition::Settings;
use crate::recordings;

/// Trains the networks of a system.
pub struct Learning<'a> {
    system: &'static str,
    work: &'a Work<'a>,
    settings: &'a Settings,
    notes: RefCell<Vec<String>>,
}

/// A network with the recipe that trained it.
pub struct Learned {
    /// The network.
    pub network: Network,
    recipe: Recipe,
}

impl<'a> Learning<'a> {
    /// For a system.
    pub fn new(system: &'static str, work: &'a Work<'a>, settings: &'a Settings) -> Self {
        Self { system, work, settings, notes: RefCell::default() }
    }

    /// All recordings.
    pub fn subjects(&self) -> &[Subject] {
        &self.work.subjects
    }

    /// What differs from the published system.
    pub fn notes(&self) -> Vec<String> {
        self.notes.borrow().clone()
    }

    /// Says once that something differs.
    pub fn note(&self, text: String) {
        let mut notes = self.notes.borrow_mut();
        if !notes.contains(&text) {
            notes.push(text);
        }
    }

    /// Names damaged files of views, each with its recording; their recordings go on without them.
    pub fn note_damaged(&self, damaged: &[String]) {
        for fault in damaged {
            (self.work.progress)(&format!("{}: {fault}", self.system));
        }
        if let Some(first) = damaged.first() {
            self.note(format!(
                "{} damaged files count as if nothing was detected; the first, {first}.",
                damaged.len()
            ));
        }
    }

    /// An error with the system's name.
    pub fn fault(&self, error: &dyn std::fmt::Display) -> CcmError {
        CcmError::Request(format!("{}: {error}", self.system))
    }

    fn refuse(&self, error: &NetError) -> CcmError {
        match error {
            NetError::Stopped { .. } => CcmError::Interrupted,
            error => self.fault(error),
        }
    }

    /// The items of every recording by the front end of a network.
    pub fn items(&self, network: &str) -> Result<Vec<Vec<Item>>> {
        let definition = self.definition(network)?;
        let Some(front_end) = definition.front_end else {
            return Err(self.fault(&format!("{network} takes no features of recordings")));
        };
        let network = definition.build(None, 0).map_err(|e| self.refuse(&e))?;
        self.each(&front_end, |id, tensor| {
            front_end.items(&network, tensor).map_err(|e| self.fault(&format!("{id}: {e}")))
        })
    }

    /// Something of the features of every recording.
    fn each<T>(
        &self,
        front_end: &FrontEnd,
        mut of: impl FnMut(&str, corsmal_nets::front_end::Tensor) -> Result<T>,
    ) -> Result<Vec<T>> {
        let config = recordings::configuration(front_end).map_err(|e| self.fault(&e))?;
        let name = format!("{}-{:.12}.npz", front_end.preset, config.hash());
        let inputs: Vec<_> = self.subjects().iter().map(|s| s.input.clone()).collect();
        let path = self.work.features.join(name);
        let Work { jobs, stop, .. } = self.work;
        let mut kept = recordings::extract(&inputs, &Arc::new(config), &path, *jobs, stop)?;
        kept.require_all()?;
        inputs.iter().map(|input| of(&input.id, kept.tensor(&input.id)?)).collect()
    }

    /// Summaries of every recording by a preset.
    pub fn summaries(&self, preset: &'static str) -> Result<Vec<Vec<f32>>> {
        self.each(&FrontEnd::of(preset), |_, tensor| Ok(tensor.values))
    }

    /// Level of every recording.
    pub fn levels(&self) -> Vec<usize> {
        let level = |s: &Subject| s.filling.map_or(UNKNOWN, |f| f.level() as usize);
        self.subjects().iter().map(level).collect()
    }

    /// Type of every recording.
    pub fn types(&self) -> Vec<usize> {
        let kind = |s: &Subject| s.filling.map_or(UNKNOWN, |f| f.kind() as usize);
        self.subjects().iter().map(kind).collect()
    }

    fn definition(&self, network: &str) -> Result<&'static Definition> {
        networks::named(network).map_err(|e| self.refuse(&e))
    }

    /// The recipe of a network in this run.
    fn recipe(&self, definition: &Definition) -> Recipe {
        let mut recipe = definition.recipe;
        // Recipes with a seed of their own keep it in the first run.
        recipe.seed = recipe.seed.wrapping_add(self.work.seed).wrapping_sub(1);
        if let Some(epochs) = self.settings.epochs.filter(|&n| n != recipe.epochs) {
            let (name, published) = (definition.name, recipe.epochs);
            let times = if epochs == 1 { "1 epoch".into() } else { format!("{epochs} epochs") };
            self.note(format!("{name} was trained for {times}; its recipe has {published}."));
            recipe.epochs = epochs;
        }
        recipe
    }

    /// A network trained on some of the items. `classes` are those of all items; the network has
    /// `outputs` of them.
    ///
    /// # Errors
    /// A training that fails or is interrupted.
    pub fn train(
        &self,
        network: &str,
        outputs: usize,
        items: &Items,
        classes: &[usize],
        train: &[usize],
    ) -> Result<Learned> {
        let definition = self.definition(network)?;
        let mut recipe = self.recipe(definition);
        if recipe.drop_last && train.len() < recipe.batch {
            // Too few for one batch: then all of them are one.
            recipe.drop_last = false;
        }
        debug_assert!(recipe.select == Select::Last);
        let refuse = |e: NetError| match e {
            NetError::Stopped { .. } => CcmError::Interrupted,
            e => self.fault(&format!("{}: {e}", definition.name)),
        };
        let mut net = definition.build(Some(outputs), recipe.seed).map_err(refuse)?;
        net.run_on(self.settings.device.clone());
        if let Some(gpu) = self.settings.device.gpu_name() {
            self.note(format!("Networks were trained on a GPU ({gpu})."));
        }
        if let Some((_, weights)) = self.settings.weights.iter().find(|(name, _)| name == network) {
            weights.begin(&mut net).map_err(|e| self.fault(&e))?;
            self.note(format!("{network} started from {}.", weights.path().display()));
        }
        let task = Task { items, classes, train, watched: &[] };
        let told = |progress: fit::Progress<'_>| {
            if let (None, Some(epoch)) = (progress.step, progress.epochs.last()) {
                let (done, total) = (progress.epochs.len(), progress.total);
                let left = progress.left.as_secs();
                (self.work.progress)(&format!(
                    "{}: {}, epoch {done} of {total}: loss {:.4}, {left} s left",
                    self.system, definition.name, epoch.loss
                ));
            }
            !self.work.stop.load(Ordering::Relaxed)
        };
        let score = |truth: &[usize], found: &[usize]| {
            Scores::new(truth, found, outputs).map_or(0.0, |s| s.weighted_f1)
        };
        fit::fit(&mut net, task, &recipe, None, score, told).map_err(refuse)?;
        Ok(Learned { network: net, recipe })
    }

    /// Probability of each class for some of the items.
    ///
    /// # Errors
    /// Items that the network does not take.
    pub fn probabilities(
        &self,
        trained: &Learned,
        items: &Items,
        rows: &[usize],
    ) -> Result<Vec<Vec<f64>>> {
        self.work.go_on()?;
        fit::probabilities(&trained.network, items, rows, &trained.recipe)
            .map_err(|e| self.refuse(&e))
    }

    /// The inner features of a network for some of the items, one after another.
    ///
    /// # Errors
    /// Items or networks without features.
    pub fn inner(&self, trained: &Learned, items: &Items, rows: &[usize]) -> Result<Vec<Vec<f32>>> {
        let mut all = Vec::with_capacity(rows.len());
        for rows in rows.chunks(64) {
            self.work.go_on()?;
            let inputs = items.batch(&trained.network, rows, trained.recipe.padding);
            let found = trained.network.features(&inputs).map_err(|e| self.refuse(&e))?;
            let width = found.shape.len();
            all.extend(found.values.values().chunks_exact(width).map(<[f32]>::to_vec));
        }
        Ok(all)
    }
}

/// Recordings that are one item each.
pub fn single(items: Vec<Vec<Item>>) -> Items {
    let column = Column::of(items.iter().flatten().map(|item| item.values.as_slice()));
    Items { columns: vec![column] }
}

/// Class numbers of a recording that has none, where all items need one; never trained on.
pub const UNKNOWN: usize = 0;

/// Probabilities as an array of known length.
pub fn array<const N: usize>(probabilities: &[f64]) -> Option<[f64; N]> {
    probabilities.try_into().ok()
}
