//! How a network is trained: the published recipe where there is one, with its defects as switches.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::{NetError, Result};
use crate::optimiser::OptimiserSpec;

/// Settings of a training. Values are those of the published code, where there is one, unless changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recipe {
    /// adam or sgd
    pub optimizer: OptimizerKind,
    /// learning rate
    pub lr: f64,
    /// momentum of sgd
    pub momentum: f64,
    /// coupled weight decay
    pub weight_decay: f64,
    /// largest common norm of the gradients; 0: no clipping
    pub clip_grad_norm: f64,
    /// how the learning rate changes from step to step
    #[serde(default)]
    pub schedule: Schedule,
    /// items of a step
    pub batch: usize,
    /// times through all items
    pub epochs: usize,
    /// leave out the last items of an epoch that do not fill a batch
    pub drop_last: bool,
    /// classes weigh by their inverse frequency
    pub class_weights: bool,
    /// whether dropout works
    pub dropout: bool,
    /// first values of the parameters
    pub initial: InitialKind,
    /// what becomes of the steps after a short sequence
    pub padding: Padding,
    /// where a short sequence begins
    #[serde(default)]
    pub offset: Offset,
    /// whether the loss sees the output activation
    pub activation: Activation,
    /// which epoch's numbers are kept
    pub select: Select,
    /// of initial values, order and dropout
    pub seed: u64,
}

/// Kind of optimiser.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum OptimizerKind {
    /// Adam
    Adam,
    /// stochastic gradient descent
    Sgd,
}

/// How the learning rate changes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Schedule {
    /// it does not
    #[default]
    Constant,
    /// it falls along half a cosine to zero at the end
    Cosine,
}

impl Schedule {
    /// The share of the learning rate after so many of all steps.
    pub fn share(self, done: u64, all: u64) -> f64 {
        match self {
            Self::Constant => 1.0,
            Self::Cosine => {
                0.5 * (1.0 + (std::f64::consts::PI * done as f64 / all.max(1) as f64).cos())
            }
        }
    }
}

/// First values.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum InitialKind {
    /// PyTorch's defaults
    Pytorch,
    /// Xavier uniform for matrices and kernels, PyTorch's for the rest
    Xavier,
    /// Xavier uniform, zeros for the rest (Keras)
    Glorot,
}

/// Steps after a short sequence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Padding {
    /// they are not there
    Masked,
    /// as M5 published it: filled with -10, and the network runs through them
    Published,
}

impl Padding {
    /// The number that fills them.
    pub fn value(self) -> f32 {
        match self {
            Self::Masked => 0.0,
            Self::Published => -10.0,
        }
    }
}

/// Where a short sequence begins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Offset {
    /// at the first step
    #[default]
    Start,
    /// as M4 published it: anywhere among [`Offset::STEPS`] steps, of which the others are zero, anew
    /// in each epoch; its predictions are made so, too
    Random,
}

impl Offset {
    /// Steps of a sequence at a random offset; of a longer one the first of them count.
    pub const STEPS: usize = 100;
}

/// The output activation in training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activation {
    /// the loss takes what comes before it, as cross-entropy expects
    Corrected,
    /// as M4 published it: cross-entropy on top of softmax or sigmoid
    Double,
}

/// Which epoch is kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Select {
    /// the last
    Last,
    /// the best on a group held out of the training rows
    Validation,
    /// as M5 published it: the best on the test fold, which makes its score too good
    Published,
    /// as M6 published it: the lowest loss on a random fifth of the training items of each class. These are
    /// not trained on, others of their groups are
    Split,
}

impl Recipe {
    /// Adam with this learning rate, batch and epochs; no defect.
    pub(crate) const fn adam(lr: f64, batch: usize, epochs: usize) -> Self {
        Self {
            optimizer: OptimizerKind::Adam,
            lr,
            momentum: 0.0,
            weight_decay: 0.0,
            clip_grad_norm: 0.0,
            schedule: Schedule::Constant,
            batch,
            epochs,
            drop_last: false,
            class_weights: false,
            dropout: true,
            initial: InitialKind::Pytorch,
            padding: Padding::Masked,
            offset: Offset::Start,
            activation: Activation::Corrected,
            select: Select::Last,
            seed: 0,
        }
    }

    /// The same with some keys replaced, as `--set` gives them.
    ///
    /// # Errors
    /// [`NetError::Recipe`] for an unknown key or an impossible value.
    pub fn with(&self, changes: &Map<String, Value>) -> Result<Self> {
        let refuse = |key: &str, value: &Value, allowed: String| NetError::Recipe {
            key: key.into(),
            value: value.to_string(),
            allowed,
        };
        let Ok(Value::Object(mut all)) = serde_json::to_value(self) else {
            unreachable!("a recipe is an object")
        };
        for (key, value) in changes {
            let known: Vec<String> = all.keys().cloned().collect();
            let Some(place) = all.get_mut(key) else {
                let known = known.iter().map(String::as_str);
                let choices = corsmal_names::choices(key, known);
                return Err(NetError::RecipeKey { key: key.clone(), choices });
            };
            *place = value.clone();
            // One key at a time, so that the refusal names it.
            if let Err(error) = serde_json::from_value::<Self>(Value::Object(all.clone())) {
                return Err(refuse(key, value, allowed(&error)));
            }
        }
        let recipe: Self = serde_json::from_value(Value::Object(all))
            .map_err(|e| refuse("recipe", &Value::Null, allowed(&e)))?;
        recipe.check()?;
        Ok(recipe)
    }

    /// Refuses impossible numbers.
    ///
    /// # Errors
    /// [`NetError::Recipe`].
    pub fn check(&self) -> Result<()> {
        let refuse = |key: &str, value: String, allowed: &str| {
            Err(NetError::Recipe { key: key.into(), value, allowed: allowed.into() })
        };
        let numbers = [
            ("momentum", self.momentum),
            ("weight_decay", self.weight_decay),
            ("clip_grad_norm", self.clip_grad_norm),
        ];
        for (key, value) in numbers {
            if !(value.is_finite() && value >= 0.0) {
                return refuse(key, value.to_string(), "a number of at least 0");
            }
        }
        if !(self.lr.is_finite() && self.lr > 0.0) {
            return refuse("lr", self.lr.to_string(), "a number above 0");
        }
        if self.batch == 0 || self.batch > 1 << 20 {
            return refuse("batch", self.batch.to_string(), "1 to 1048576");
        }
        if self.epochs == 0 || self.epochs > 1 << 20 {
            return refuse("epochs", self.epochs.to_string(), "1 to 1048576");
        }
        Ok(())
    }

    /// The optimiser.
    pub fn optimiser(&self) -> OptimiserSpec {
        let Self { lr, momentum, weight_decay, .. } = *self;
        match self.optimizer {
            OptimizerKind::Adam => OptimiserSpec::Adam { lr, weight_decay },
            OptimizerKind::Sgd => OptimiserSpec::Sgd { lr, momentum, weight_decay },
        }
    }
}

/// What a value must be, by serde's message about another one.
fn allowed(error: &serde_json::Error) -> String {
    let message = error.to_string();
    let message = message.split(" at line ").next().unwrap_or(&message);
    match message.split_once(", expected ").map(|(_, expected)| expected) {
        Some("f64" | "f32") => "a number".into(),
        Some("usize" | "u64" | "u32") => "a whole number of at least 0".into(),
        Some(other) => other.replace('`', ""),
        None => message.into(),
    }
}
