//! How much memory a training takes, told before it begins.

use crate::batch::Shape;
use crate::course::Course;
use crate::error::{NetError, Result};
use crate::network::Network;
use crate::recipe::{Offset, OptimizerKind, Recipe, Select};

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
    let longest = |column: usize, numbers: usize| {
        let ends = &course.items.columns[column].offsets;
        let of = |&row: &usize| (ends[row + 1] - ends[row]) / numbers;
        course.train.iter().chain(course.watched).map(of).max().unwrap_or(0)
    };
    let shapes = network.inputs().iter().enumerate().map(|(column, input)| match input.shape {
        Shape::Sequence { numbers, .. } if recipe.offset == Offset::Random => {
            Shape::Sequence { steps: Offset::STEPS, numbers }
        }
        Shape::Sequence { numbers, .. } => {
            Shape::Sequence { steps: longest(column, numbers), numbers }
        }
        shape => shape,
    });
    let step = network.kept(&shapes.collect::<Vec<_>>()) as u64;
    let batch = recipe.batch.min(course.train.len()) as u64;
    let numbers = items as u64 + copies * network.parameters().count() as u64;
    FLOAT * numbers.saturating_add(batch.saturating_mul(step))
}

/// Refuses a training that needs more memory than is free, where the system tells how much is.
pub(crate) fn require(needed: u64, available: Option<u64>) -> Result<()> {
    match available {
        Some(available) if needed > available => Err(NetError::Memory { needed, available }),
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
    fn too_little_memory_is_refused_in_words() {
        assert!(require(10, None).is_ok() && require(10, Some(10)).is_ok());
        let message = require(3 << 30, Some(1 << 30)).unwrap_err().to_string();
        assert!(message.contains("3.0 GiB") && message.contains("1.0 GiB"), "{message}");
        assert!(message.contains("batch"), "{message}");
    }
}
