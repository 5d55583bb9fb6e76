//! What a network of the table is.

use serde_json::{Map, Value, json};

use crate::batch::Shape;
use crate::error::{NetError, Result};
use crate::front_end::FrontEnd;
use crate::network::{Architecture, Input, Network};
use crate::parameters::Declared;
use crate::recipe::{Activation, Offset, OptimizerKind, Padding, Recipe};
use crate::weights::State;

/// A network of the table.
#[derive(Clone, Copy, Debug)]
pub struct Definition {
    /// name on the command line; hyphen and underscore are equal
    pub name: &'static str,
    /// one sentence
    pub about: &'static str,
    /// outputs of the published network; of our own, those for the level
    pub outputs: usize,
    /// whether the outputs are classes, and not one number
    pub classifies: bool,
    /// layers, for a number of outputs
    pub architecture: fn(usize) -> Architecture,
    /// what an item is, in words
    pub takes: &'static str,
    /// how its input comes from a recording; `None` where it takes what other networks give, or
    /// more than sound
    pub front_end: Option<FrontEnd>,
    /// training as the published code has it, its defects corrected; of our own, what inner scores chose
    pub recipe: Recipe,
    /// what the paper says where it differs from the code
    pub paper: &'static [(&'static str, f64)],
}

/// Most outputs a network may be given.
pub const MAX_OUTPUTS: usize = 1 << 16;

impl Definition {
    /// The recipe with some keys replaced. Besides those of [`Recipe::with`] there is `recipe`: code,
    /// the default, or paper, which the other keys go on from.
    ///
    /// # Errors
    /// As [`Recipe::with`]; a value that does nothing for this network.
    pub fn recipe_with(&self, changes: &Map<String, Value>) -> Result<Recipe> {
        let mut changes = changes.clone();
        let from = match changes.remove("recipe") {
            None => self.recipe,
            Some(Value::String(name)) if name == "code" => self.recipe,
            Some(Value::String(name)) if name == "paper" => {
                let number = |&(key, value): &(&str, f64)| {
                    let whole = value >= 1.0;
                    let value = if whole { json!(value as u64) } else { json!(value) };
                    (key.to_owned(), value)
                };
                self.recipe.with(&self.paper.iter().map(number).collect())?
            }
            Some(other) => {
                return Err(NetError::Recipe {
                    key: "recipe".into(),
                    value: other.to_string(),
                    allowed: "code or paper".into(),
                });
            }
        };
        let recipe = from.with(&changes)?;
        self.refuse_unused(&changes, &recipe)?;
        Ok(recipe)
    }

    /// Refuses changes that would change nothing: the model would record them as if they did.
    fn refuse_unused(&self, changes: &Map<String, Value>, recipe: &Recipe) -> Result<()> {
        let layers = (self.architecture)(self.outputs);
        let is_sequence = |input: &Input| matches!(input.shape, Shape::Sequence { .. });
        let takes_sequences = layers.inputs.iter().any(is_sequence);
        let drops = layers.body.layers().any(|layer| layer.drops());
        let unused = [
            (
                recipe.optimizer == OptimizerKind::Adam && recipe.momentum != 0.0,
                ("momentum", recipe.momentum.to_string(), "0 with optimizer=adam"),
            ),
            (
                recipe.activation == Activation::Double && !layers.activation,
                ("activation", "double".into(), "corrected: the network has no output activation"),
            ),
            (
                recipe.padding == Padding::Published && !takes_sequences,
                ("padding", "published".into(), "masked: the network takes no sequences"),
            ),
            (
                recipe.padding == Padding::Published && recipe.offset == Offset::Random,
                (
                    "padding",
                    "published".into(),
                    "masked with offset=random, which fills with zeros",
                ),
            ),
            (
                !recipe.dropout && !drops,
                ("dropout", "false".into(), "true: the network has no dropout"),
            ),
            (
                recipe.offset == Offset::Random && !takes_sequences,
                ("offset", "random".into(), "start: the network takes no sequences"),
            ),
        ];
        let found =
            unused.into_iter().find(|(unused, (key, ..))| *unused && changes.contains_key(*key));
        match found {
            None => Ok(()),
            Some((_, (key, value, allowed))) => {
                Err(NetError::Recipe { key: key.into(), value, allowed: allowed.into() })
            }
        }
    }

    /// With initial numbers of this seed and as many outputs as asked for, or its own number.
    ///
    /// # Errors
    /// No outputs, or more than [`MAX_OUTPUTS`].
    pub fn build(&self, outputs: Option<usize>, seed: u64) -> Result<Network> {
        Network::new(self.name, self.layers(outputs)?, seed)
    }

    /// Its parameters without their numbers.
    ///
    /// # Errors
    /// As [`Definition::build`].
    pub(crate) fn declared(&self, outputs: usize) -> Result<Vec<Declared>> {
        let layers = self.layers(Some(outputs))?;
        Ok(layers.body.layers().flat_map(|layer| layer.parameters()).collect())
    }

    /// These weights without the numbers of the last layer, which then starts anew; see
    /// [`Network::begin_with`].
    pub fn without_outputs(&self, state: &State) -> State {
        let layer = |name: &str| name.rsplit_once('.').map(|(layer, _)| layer.to_owned());
        let declared = self.declared(self.outputs).unwrap_or_default();
        let last = declared.last().and_then(|d| layer(&d.name));
        let mut state = state.clone();
        for (_, shape, values) in state.iter_mut().filter(|(name, ..)| layer(name) == last) {
            values.clear();
            if let Some(outputs) = shape.first_mut() {
                *outputs = 0;
            }
        }
        state
    }

    /// What an item is: name and shape of each input.
    pub fn inputs(&self) -> Vec<Input> {
        (self.architecture)(self.outputs).inputs
    }

    /// Width and height of the pictures that it takes, where it takes pictures.
    pub fn picture(&self) -> Option<(usize, usize)> {
        match self.inputs().as_slice() {
            [Input { shape: Shape::Image { height, width, channels: 3 }, .. }] => {
                Some((*width, *height))
            }
            _ => None,
        }
    }

    fn layers(&self, outputs: Option<usize>) -> Result<Architecture> {
        let outputs = outputs.unwrap_or(self.outputs);
        if outputs == 0 || outputs > MAX_OUTPUTS {
            return Err(NetError::Recipe {
                key: "outputs".into(),
                value: outputs.to_string(),
                allowed: format!("1 to {MAX_OUTPUTS}"),
            });
        }
        Ok((self.architecture)(outputs))
    }
}
