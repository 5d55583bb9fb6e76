//! Densities of the fillings by container.

use std::collections::{BTreeMap, HashMap};

use crate::dataset::{Annotations, FillingType};

/// Average density in g/mL of pasta and rice in the training containers, of October 2020:
/// annotated mass over filled volume, rounded to two decimals. Water is 1.
const AVERAGE_2020: [[f64; 2]; 9] = [
    [0.42, 0.85],
    [0.38, 0.82],
    [0.36, 0.81],
    [0.30, 0.82],
    [0.39, 0.80],
    [0.34, 0.83],
    [0.45, 0.93],
    [0.43, 0.97],
    [0.38, 0.82],
];

/// Density of each filling type in each container.
#[derive(Clone, Debug)]
pub struct DensityTable(BTreeMap<u8, [f64; 4]>);

impl DensityTable {
    /// The published table of the training containers.
    pub fn average_2020() -> Self {
        let row = |[pasta, rice]: [f64; 2]| [0.0, pasta, rice, 1.0];
        Self((1..).zip(AVERAGE_2020).map(|(c, d)| (c, row(d))).collect())
    }

    /// The published table, and for other containers the average of annotated mass over filled
    /// volume; a type that a container was never filled with gets the mean over the published
    /// containers.
    pub fn with_annotations(annotations: &Annotations) -> Self {
        let mut table = Self::average_2020();
        let mut sums: HashMap<u8, [(f64, f64); 4]> = HashMap::new();
        for row in &annotations.rows {
            let Some(filling) = row.filling else { continue };
            let volume = filling.level().fraction() * row.capacity_ml;
            if row.filling_mass_g >= 0.0 && volume > 0.0 {
                let sum = &mut sums.entry(row.container).or_default()[filling.kind() as usize];
                *sum = (sum.0 + row.filling_mass_g / volume, sum.1 + 1.0);
            }
        }
        let means = FillingType::ALL.map(|kind| {
            table.0.values().map(|row| row[kind as usize]).sum::<f64>() / table.0.len() as f64
        });
        for row in &annotations.rows {
            table.0.entry(row.container).or_insert_with(|| {
                let sums = sums.get(&row.container).copied().unwrap_or_default();
                std::array::from_fn(|k| match sums[k] {
                    (_, 0.0) => means[k],
                    (sum, n) => sum / n,
                })
            });
        }
        table
    }

    /// Density in g/mL, `None` for a container that the table does not have.
    pub fn density(&self, container: u8, kind: FillingType) -> Option<f64> {
        self.0.get(&container).map(|row| row[kind as usize])
    }
}
