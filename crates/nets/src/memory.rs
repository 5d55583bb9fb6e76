//! How much memory a training or an evaluation takes, told before it begins.

use std::cmp::Reverse;

use crate::batch::Shape;
use crate::course::Course;
use crate::error::{NetError, Result};
use crate::items::{Items, TOGETHER};
use crate::network::{Input, Network};
use crate::recipe::{Offset, OptimizerKind, Padding, Recipe, Select};

const FLOAT: u64 = 4;

/// Bytes that a training takes, roughly: items, numbers with their gradients and moments, and what
/// the largest step keeps for its way back.
pub(crate) fn of_training(network: &Network, course: &Course<'_>, recipe: &Recipe) -> u64 {
    let items: usize = course.items.columns.iter().map(|c| c.values.len()).sum();
    let copies = match (recipe.optimizer, recipe.select) {
        (OptimizerKind::Adam, Select::Last) => 4,
        (OptimizerKind::Adam, _) => 5,
        (OptimizerKind::Sgd, Select::Last) => 3,
        (OptimizerKind::Sgd, _) => 4,
    };
    let numbers = items as u64 + copies * network.parameters().count() as u64;
    let step = |rows: &[usize], batch: usize, of: Numbers| {
        Worst::of(network, course.items, rows, batch, recipe).numbers(network, of)
    };
    let training = step(course.train, recipe.batch, Network::kept);
    let rating = step(course.watched, TOGETHER, Network::passing);
    let packed = if course.watched.is_empty() { 0 } else { packed(network) };
    FLOAT.saturating_mul(numbers.saturating_add(packed).saturating_add(training.max(rating)))
}

/// Bytes that the evaluation of these items together takes beyond the items and the network, roughly.
pub(crate) fn of_evaluation(
    network: &Network,
    items: &Items,
    rows: &[usize],
    recipe: &Recipe,
) -> u64 {
    let worst = Worst::of(network, items, rows, rows.len(), recipe);
    let passing = worst.numbers(network, Network::passing);
    FLOAT.saturating_mul(passing.saturating_add(packed(network)))
}

/// Numbers of the packed weights, at most: kernels of 3 x 3 over images become sixteen numbers of nine.
fn packed(network: &Network) -> u64 {
    let is_image = |input: &Input| matches!(input.shape, Shape::Image { .. });
    let copies = if network.inputs().iter().any(is_image) { 2 } else { 1 };
    copies * network.parameters().count() as u64
}

/// Numbers for an item of these shapes.
type Numbers = fn(&Network, &[Shape]) -> usize;

/// The batch that takes the most memory.
struct Worst {
    items: u64,
    /// numbers of the inputs, padding included
    inputs: u64,
    /// shapes of a mean item, without the padding where no work is done on it
    shapes: Vec<Shape>,
}

impl Worst {
    /// Of `batch` of these items.
    fn of(network: &Network, items: &Items, rows: &[usize], batch: usize, recipe: &Recipe) -> Self {
        let count = batch.min(rows.len());
        let mut inputs = 0u64;
        let shapes = network.inputs().iter().enumerate().map(|(column, input)| {
            let Shape::Sequence { numbers, .. } = input.shape else {
                inputs = inputs.saturating_add(count as u64 * input.shape.len() as u64);
                return input.shape;
            };
            let (padded, worked) = match recipe.offset {
                Offset::Random => (Offset::STEPS, Offset::STEPS),
                Offset::Start => {
                    let mut steps: Vec<usize> =
                        rows.iter().map(|&row| items.numbers(column, row) / numbers).collect();
                    steps.sort_unstable_by_key(|&n| Reverse(n));
                    let longest = steps.first().copied().unwrap_or(0);
                    let sum: usize = steps.iter().take(count).sum();
                    match recipe.padding {
                        Padding::Published => (longest, longest),
                        Padding::Masked => (longest, sum.div_ceil(count.max(1))),
                    }
                }
            };
            let width = (count as u64).saturating_mul(numbers as u64);
            inputs = inputs.saturating_add(width.saturating_mul(padded as u64));
            Shape::Sequence { steps: worked, numbers }
        });
        let shapes = shapes.collect();
        Self { items: count as u64, inputs, shapes }
    }

    fn numbers(&self, network: &Network, of: Numbers) -> u64 {
        let each = of(network, &self.shapes) as u64;
        self.inputs.saturating_add(self.items.saturating_mul(each))
    }
}

/// Refuses a training that needs more memory than is free, where the system tells how much is.
pub(crate) fn require(needed: u64, available: Option<u64>) -> Result<()> {
    match available {
        Some(available) if needed > available => Err(NetError::Memory { needed, available }),
        _ => Ok(()),
    }
}

/// The same for items that are only classified.
pub(crate) fn require_for_items(needed: u64, available: Option<u64>) -> Result<()> {
    match available {
        Some(available) if needed > available => Err(NetError::LargeItem { needed, available }),
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::items::{Column, Items};
    use crate::loss::{Loss, Targets};
    use crate::networks;

    #[test]
    fn what_a_training_takes_grows_with_batch_and_length() {
        let definition = networks::named("m5_vggish_level").unwrap();
        let network = definition.build(None, 0).unwrap();
        let of = |steps: usize, batch: usize| {
            let item = vec![0.0; steps * 128];
            let items = Items { columns: vec![Column::of([&item[..], &item, &item, &item])] };
            let course = Course {
                items: &items,
                targets: &Targets::Classes(vec![0, 1, 2, 0]),
                train: &[0, 1, 2, 3],
                watched: &[],
                loss: Loss::CrossEntropy,
                class_weights: Vec::new(),
            };
            of_training(&network, &course, &Recipe { batch, ..definition.recipe })
        };
        // Numbers, gradients and two moments.
        let least = 4 * 4 * network.parameters().count() as u64;
        assert!(of(1, 1) > least);
        assert!(of(10, 2) > of(10, 1) && of(20, 1) > of(10, 1));
        assert_eq!(of(10, 4), of(10, 64));
        // Five layers of 512 with three gates and a state each, four items of 100 steps.
        assert!(of(100, 4) > least + 4 * 4 * 100 * 5 * 512 * 4);
    }

    #[test]
    fn a_long_item_counts_once_where_padding_is_left_out() {
        let definition = networks::named("m5_vggish_level").unwrap();
        let network = definition.build(None, 0).unwrap();
        let (short, long) = (vec![0.0; 128], vec![0.0; 128 * 1000]);
        let mut column = Column::of([&long[..]]);
        (0..31).for_each(|_| column.push(&short));
        let items = Items { columns: vec![column] };
        let rows: Vec<usize> = (0..32).collect();
        let course = Course {
            items: &items,
            targets: &Targets::Classes((0..32).map(|i| i % 3).collect()),
            train: &rows,
            watched: &[],
            loss: Loss::CrossEntropy,
            class_weights: Vec::new(),
        };
        let of = |padding, train: &[usize]| {
            let course =
                Course { train, loss: Loss::CrossEntropy, class_weights: Vec::new(), ..course };
            of_training(&network, &course, &Recipe { padding, ..definition.recipe })
        };
        let (alone, together) = (of(Padding::Masked, &rows[..1]), of(Padding::Masked, &rows));
        // Inputs are padded, states are not.
        let inputs = 4 * 32 * 1000 * 128;
        assert!(together - alone < inputs + (8 << 20), "{alone} {together}");
        assert!(of(Padding::Published, &rows) > 8 * alone);
        let packed = 4 * network.parameters().count() as u64;
        let evaluated =
            |rows: &[usize]| of_evaluation(&network, &items, rows, &definition.recipe) - packed;
        assert!(evaluated(&rows) < inputs + (4 << 20) && evaluated(&rows[1..]) < 4 << 20);
    }

    #[test]
    fn too_little_memory_is_refused_in_words() {
        assert!(require(10, None).is_ok() && require(10, Some(10)).is_ok());
        let message = require(3 << 30, Some(1 << 30)).unwrap_err().to_string();
        assert!(message.contains("3.0 GiB") && message.contains("1.0 GiB"), "{message}");
        assert!(message.contains("batch"), "{message}");
    }
}
