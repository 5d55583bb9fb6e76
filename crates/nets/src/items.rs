//! Items to train on or to classify: one array for each input of a network.

use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
use crate::network::Network;
use crate::random::Stream;
use crate::recipe::{Offset, Padding, Recipe};

/// Items classified together where nothing asks for another number; M5's predictions depend on it.
pub(crate) const TOGETHER: usize = 64;

/// All items of one input, one after another, channels last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Column {
    /// numbers of all items
    pub values: Vec<f32>,
    /// where each item begins, and the end
    pub offsets: Vec<usize>,
}

impl Column {
    /// Items one after another.
    pub fn of<'a>(items: impl IntoIterator<Item = &'a [f32]>) -> Self {
        let mut column = Self { values: Vec::new(), offsets: vec![0] };
        items.into_iter().for_each(|item| column.push(item));
        column
    }

    /// None yet, with room for so many of so many numbers each.
    pub fn with_capacity(items: usize, numbers: usize) -> Self {
        Self { values: Vec::with_capacity(items.saturating_mul(numbers)), offsets: vec![0] }
    }

    /// Adds an item after the others.
    pub fn push(&mut self, item: &[f32]) {
        self.values.extend_from_slice(item);
        self.offsets.push(self.values.len());
    }

    fn item(&self, item: usize) -> &[f32] {
        &self.values[self.offsets[item]..self.offsets[item + 1]]
    }
}

/// Items of a network.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Items {
    /// a column for each input
    pub columns: Vec<Column>,
}

impl Items {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.columns.first().map_or(0, |c| c.offsets.len().saturating_sub(1))
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Some of them, in this order.
    pub fn pick(&self, items: &[usize]) -> Self {
        let of = |column: &Column| Column::of(items.iter().map(|&item| column.item(item)));
        Self { columns: self.columns.iter().map(of).collect() }
    }

    /// Refuses items that the network does not take, and numbers that are not finite.
    ///
    /// # Errors
    /// [`NetError::InputCount`], [`NetError::InputShape`], [`NetError::NonFinite`].
    pub fn check(&self, network: &Network) -> Result<()> {
        let inputs = network.inputs();
        if self.columns.len() != inputs.len() {
            return Err(NetError::InputCount {
                network: network.name().into(),
                expected: inputs.len(),
                actual: self.columns.len(),
            });
        }
        for (column, input) in self.columns.iter().zip(inputs) {
            let refuse = |actual: String| {
                Err(NetError::InputShape {
                    network: network.name().into(),
                    input: input.name.clone(),
                    expected: input.shape.to_string(),
                    actual,
                })
            };
            if column.offsets.len() != self.len() + 1 {
                return refuse(format!("{} items", column.offsets.len().saturating_sub(1)));
            }
            for (item, ends) in column.offsets.windows(2).enumerate() {
                let n = ends[1].saturating_sub(ends[0]);
                let fits = match input.shape {
                    Shape::Sequence { numbers, .. } => n > 0 && n % numbers == 0,
                    shape => n == shape.len(),
                };
                if !fits || ends[1] > column.values.len() {
                    return refuse(format!("{n} numbers (item {item})"));
                }
                let values = &column.values[ends[0]..ends[1]];
                if let Some(value) = values.iter().find(|v| !v.is_finite()) {
                    return Err(NetError::NonFinite {
                        input: input.name.clone(),
                        item,
                        value: *value,
                    });
                }
            }
        }
        Ok(())
    }

    /// These items as a batch. They were checked.
    pub fn batch(&self, network: &Network, items: &[usize], padding: Padding) -> Vec<Batch> {
        let one = |(column, shape): (&Column, Shape)| {
            let Shape::Sequence { numbers, .. } = shape else {
                let all = items.iter().flat_map(|&i| column.item(i)).copied().collect();
                return Batch::new(all, shape);
            };
            let lengths: Vec<usize> =
                items.iter().map(|&i| column.item(i).len() / numbers).collect();
            let steps = lengths.iter().copied().max().unwrap_or(0);
            let mut values = Vec::with_capacity(items.len() * steps * numbers);
            for &i in items {
                let end = values.len() + steps * numbers;
                values.extend_from_slice(column.item(i));
                values.resize(end, padding.value());
            }
            let mut batch = Batch::new(values, Shape::Sequence { steps, numbers });
            batch.lengths = (padding == Padding::Masked).then_some(lengths);
            batch
        };
        let shapes = network.inputs().iter().map(|i| i.shape);
        self.columns.iter().zip(shapes).map(one).collect()
    }

    /// These items as the recipe lays them into a batch; `chance` is where random offsets come from.
    pub(crate) fn laid(
        &self,
        network: &Network,
        items: &[usize],
        recipe: &Recipe,
        chance: Stream,
    ) -> Vec<Batch> {
        if recipe.offset == Offset::Start {
            return self.batch(network, items, recipe.padding);
        }
        let steps = Offset::STEPS;
        let one = |(column, shape): (&Column, Shape)| {
            let Shape::Sequence { numbers, .. } = shape else {
                let all = items.iter().flat_map(|&i| column.item(i)).copied().collect();
                return Batch::new(all, shape);
            };
            let mut values = vec![0.0; items.len() * steps * numbers];
            for (&i, place) in items.iter().zip(values.chunks_exact_mut(steps * numbers)) {
                let item = column.item(i);
                let item = &item[..item.len().min(steps * numbers)];
                let free = steps - item.len() / numbers;
                let begin = chance.below(i as u64, free + 1) * numbers;
                place[begin..begin + item.len()].copy_from_slice(item);
            }
            Batch::new(values, Shape::Sequence { steps, numbers })
        };
        let shapes = network.inputs().iter().map(|i| i.shape);
        self.columns.iter().zip(shapes).map(one).collect()
    }

    /// Numbers of an item in one of its inputs.
    pub(crate) fn numbers(&self, column: usize, item: usize) -> usize {
        let ends = &self.columns[column].offsets;
        ends[item + 1] - ends[item]
    }

    /// Sum of the steps of an item over its inputs, a measure of its work.
    pub(crate) fn work(&self, item: usize) -> usize {
        (0..self.columns.len()).map(|column| self.numbers(column, item)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::networks;

    #[test]
    fn a_sequence_lies_anywhere_among_the_published_steps() {
        let definition = networks::named("m4_level").unwrap();
        let network = definition.build(None, 0).unwrap();
        let long = vec![2.0; 130 * 1024];
        let items = Items { columns: vec![Column::of([&[1.0; 3 * 1024][..], &long])] };
        let recipe = Recipe { offset: Offset::Random, ..definition.recipe };
        let begin = |epoch: u64| {
            let chance = Stream::new(0, "offset").part(epoch);
            let batch = &items.laid(&network, &[0, 1], &recipe, chance)[0];
            assert_eq!((batch.shape.places(), batch.items()), (100, 2));
            assert!(batch.lengths.is_none());
            let values = batch.values.values();
            let (short, long) = values.split_at(100 * 1024);
            assert!(long.iter().all(|&v| v == 2.0));
            assert_eq!(short.iter().sum::<f32>(), 3.0 * 1024.0);
            short.iter().position(|&v| v == 1.0).unwrap() / 1024
        };
        let begins: Vec<usize> = (0..20).map(begin).collect();
        assert!(begins.iter().all(|&b| b <= 97) && begins.iter().any(|&b| b != begins[0]));
        assert_eq!(begins, (0..20).map(begin).collect::<Vec<_>>());
    }
}
