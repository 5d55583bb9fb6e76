//! Data for the tests.

use ndarray::Array2;
use rand::{Rng, SeedableRng};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Overlapping clouds, one per class: `[rows, features]` and labels, classes in turn.
pub fn clouds(
    rows: usize,
    features: usize,
    classes: usize,
    seed: u64,
) -> (Array2<f64>, Vec<usize>) {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let centres = Array2::from_shape_fn((classes, features), |_| rng.gen_range(-1.0..1.0));
    let y: Vec<usize> = (0..rows).map(|row| row % classes).collect();
    let x = Array2::from_shape_fn((rows, features), |(row, f)| {
        centres[[y[row], f]] + 1.2 * rng.gen_range(-1.0..1.0)
    });
    (x, y)
}
