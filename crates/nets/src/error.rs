//! What this crate refuses, and why.

use thiserror::Error;

use crate::batch::Shape;

const GIB: f64 = (1u64 << 30) as f64;

/// A refusal. Texts name the place, what was found and what would be accepted.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NetError {
    /// A name outside the registry.
    #[error("there is no network {name}: {allowed}")]
    UnknownNetwork {
        /// the name given
        name: String,
        /// the names there are
        allowed: String,
    },
    /// Inputs that do not have the shape the network takes.
    #[error("{network}: input {input} has shape {actual}, expected {expected}")]
    InputShape {
        /// the network
        network: String,
        /// which of its inputs
        input: String,
        /// shape expected
        expected: String,
        /// shape given
        actual: String,
    },
    /// Lengths that do not fit the sequences.
    #[error(
        "{network}: `lengths` must give a number from 1 to {steps} for each of {items} items, not {actual}"
    )]
    Lengths {
        /// the network
        network: String,
        /// steps of the sequences
        steps: usize,
        /// sequences
        items: usize,
        /// what is wrong with the lengths given
        actual: String,
    },
    /// Another number of inputs than the network takes.
    #[error("{network} takes {expected} inputs, {actual} were given")]
    InputCount {
        /// the network
        network: String,
        /// inputs it takes
        expected: usize,
        /// inputs given
        actual: usize,
    },
    /// Layers that do not fit one another.
    #[error("layer {layer}: expected {expected}, found {input}")]
    LayerInput {
        /// the layer
        layer: String,
        /// what it takes
        expected: String,
        /// what it was offered
        input: String,
    },
    /// Weights of another architecture.
    #[error("these weights do not fit {network}: {}", differences.join("; "))]
    Weights {
        /// the network
        network: String,
        /// each name or shape that differs
        differences: Vec<String>,
    },
    /// A number of a training that is not finite.
    #[error(
        "training step {step}: {what} is {value}; check that all inputs are finite, or try a smaller learning rate or clip_grad_norm"
    )]
    Diverged {
        /// step, counted from 1
        step: u64,
        /// the loss, or the parameter that it is of
        what: String,
        /// its value
        value: f32,
    },
    /// A recording that does not fill a window.
    #[error("too short: {frames} frames; {network} needs at least {needed}")]
    TooShort {
        /// the network
        network: String,
        /// frames there are
        frames: usize,
        /// frames of a window
        needed: usize,
    },
    /// A training step on too few items.
    #[error(
        "{network} trains on batches of at least {needed} items, whose variance it needs; this one has {items}"
    )]
    FewItems {
        /// the network
        network: String,
        /// items of the batch
        items: usize,
        /// items that it needs
        needed: usize,
    },
    /// A training that needs more memory than is free.
    #[error(
        "the training needs about {:.1} GiB of memory, but {:.1} GiB are free: a smaller batch or \
         fewer items need less",
        *needed as f64 / GIB, *available as f64 / GIB
    )]
    Memory {
        /// bytes needed
        needed: u64,
        /// bytes free
        available: u64,
    },
    /// Items whose classification needs more memory than is free.
    #[error(
        "an item needs about {:.1} GiB of memory, {:.1} GiB are free: it is too long",
        *needed as f64 / GIB, *available as f64 / GIB
    )]
    LargeItem {
        /// bytes needed
        needed: u64,
        /// bytes free
        available: u64,
    },
    /// A number that is not finite among the inputs.
    #[error("input {input}, item {item}: {value} is not a finite number")]
    NonFinite {
        /// the input
        input: String,
        /// index of the item
        item: usize,
        /// the number
        value: f32,
    },
    /// An output that is not finite: inputs or numbers of the network beyond single precision.
    #[error(
        "{network}, item {item}: the output is {value}: the inputs are too large for this network"
    )]
    Output {
        /// the network
        network: String,
        /// index of the item
        item: usize,
        /// the output
        value: f32,
    },
    /// A network whose outputs are not classes.
    #[error("{network} gives numbers, not classes, so it cannot be trained as a classifier")]
    NoClasses {
        /// the network
        network: String,
    },
    /// A checkpoint that cannot be read or written, or is another training's.
    #[error("checkpoint {0}")]
    Checkpoint(#[from] crate::weights::WeightsError),
    /// Training was ended from outside.
    #[error("stopped after {epochs} epoch{}", if *epochs == 1 { "" } else { "s" })]
    Stopped {
        /// epochs done
        epochs: usize,
    },
    /// Targets that do not fit the inputs or the loss.
    #[error("{0}")]
    Targets(String),
    /// A recipe's key or value.
    #[error("recipe: {key} must be {allowed}, not {value}")]
    Recipe {
        /// the key
        key: String,
        /// the value given
        value: String,
        /// what it may be
        allowed: String,
    },
    /// A key that recipes do not have.
    #[error("recipe: there is no key {key}: {choices}")]
    RecipeKey {
        /// the key
        key: String,
        /// the key that was probably meant, and the known ones
        choices: String,
    },
    /// A device that this build or machine does not have.
    #[error("device {name}: {reason}")]
    NoDevice {
        /// the name given
        name: String,
        /// why not
        reason: String,
    },
    /// A GPU that failed: out of memory, or its driver.
    #[error(
        "GPU {name}: {reason}; if its memory is full, try a smaller batch; --device cpu needs no GPU"
    )]
    Gpu {
        /// what it calls itself
        name: String,
        /// what its driver says
        reason: String,
    },
    /// Something asked of a network that it does not have.
    #[error("{network} has no {what}: {hint}")]
    Missing {
        /// the network
        network: String,
        /// what was asked for
        what: &'static str,
        /// what to use instead
        hint: String,
    },
}

impl NetError {
    /// The refusal of a layer.
    pub(crate) fn layer(
        layer: impl Into<String>,
        expected: impl Into<String>,
        found: Shape,
    ) -> Self {
        let (layer, expected, input) = (layer.into(), expected.into(), found.to_string());
        Self::LayerInput { layer, expected, input }
    }
}

/// Result of this crate.
pub type Result<T> = std::result::Result<T, NetError>;
