//! Items to train on or to classify: one array for each input of a network.

use crate::batch::{Batch, Shape};
use crate::error::{NetError, Result};
use crate::network::Network;
use crate::recipe::Padding;

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
        let (mut values, mut offsets) = (Vec::new(), vec![0]);
        for item in items {
            values.extend_from_slice(item);
            offsets.push(values.len());
        }
        Self { values, offsets }
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
            let item = |i: usize| &column.values[column.offsets[i]..column.offsets[i + 1]];
            let Shape::Sequence { numbers, .. } = shape else {
                return Batch::new(items.iter().flat_map(|&i| item(i)).copied().collect(), shape);
            };
            let lengths: Vec<usize> = items.iter().map(|&i| item(i).len() / numbers).collect();
            let steps = lengths.iter().copied().max().unwrap_or(0);
            let mut values = Vec::with_capacity(items.len() * steps * numbers);
            for &i in items {
                let end = values.len() + steps * numbers;
                values.extend_from_slice(item(i));
                values.resize(end, padding.value());
            }
            let mut batch = Batch::new(values, Shape::Sequence { steps, numbers });
            batch.lengths = (padding == Padding::Masked).then_some(lengths);
            batch
        };
        let shapes = network.inputs().iter().map(|i| i.shape);
        self.columns.iter().zip(shapes).map(one).collect()
    }

    /// Sum of the steps of an item over its inputs, a measure of its work.
    pub(crate) fn work(&self, item: usize) -> usize {
        self.columns.iter().map(|c| c.offsets[item + 1] - c.offsets[item]).sum()
    }
}
