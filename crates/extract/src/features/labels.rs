//! Names of coefficients.

/// Names of `n` coefficients: their indices.
pub fn indices(n: usize) -> Vec<String> {
    (0..n).map(|i| i.to_string()).collect()
}

/// Name of a coefficient by its frequency.
pub fn hertz(frequency: f64) -> String {
    format!("{frequency:.1}Hz")
}

/// Names of the pixels of an image of 96 x 96, row by row: `row,column`.
pub fn pixels() -> Vec<String> {
    (0..96).flat_map(|row| (0..96).map(move |column| format!("{row},{column}"))).collect()
}
