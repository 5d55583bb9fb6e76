//! Differences between two feature files, and what probably caused them.
//!
//! One pair of arrays is held at a time. An array is seen as `[channel, coefficient, frame]`: its
//! last axis as frames, the one before as coefficients, all before that as channels; a table of
//! summaries as `[1, column, row]`.
//!
//! ```
//! use corsmal_compare::{Criteria, compare};
//! use corsmal_files::npz::{Compression, NpzWriter};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! # let folder = tempfile::tempdir()?;
//! # let (a, b) = (folder.path().join("a.npz"), folder.path().join("b.npz"));
//! for (path, scale) in [(&a, 1.0), (&b, 2.0)] {
//!     let values: Vec<f32> = (1..=60).map(|i| scale * (i as f32).sqrt()).collect();
//!     let mut writer = NpzWriter::create(path, Compression::Stored)?;
//!     writer.floats("mfcc", &[3, 20], &values)?;
//!     writer.finish()?;
//! }
//! let found = compare(&a, &b, &Criteria::default())?;
//! assert!(!found.within);
//! assert_eq!(found.features[0].differing, 1);
//! assert!(!found.features[0].causes.is_empty(), "a factor of two");
//! # Ok(())
//! # }
//! ```

mod causes;
mod compared_file;
mod comparison;
mod difference;
mod error;
mod matching;
mod pair;
mod pairing;
mod rows;
mod settings;
mod texts;

use std::path::Path;

pub use causes::{Cause, CauseKind};
pub use compared_file::Refused;
pub use comparison::{Comparison, FeatureReport, FileReport, Finding, Shapes, is_complex};
pub use corsmal_files::settings::Setting;
pub use difference::{Difference, Extreme, Tolerance};
pub use error::CompareError;
pub use pairing::PairedBy;
pub use settings::Settings;
pub use texts::{TextDifference, TextReport};

use compared_file::ComparedFile;
use comparison::ComparisonBuilder;
use matching::Matching;
use ndarray::ArrayD;

/// What counts as equal, and which arrays belong together.
#[derive(Debug, Clone, Default)]
pub struct Criteria {
    /// What counts as equal.
    pub tolerance: Tolerance,
    /// Arrays of the first file and their counterparts in the second, where names differ.
    pub map: Vec<(String, String)>,
}

/// Compares two files: `.npz`, `.npy` or Parquet, ours or not.
///
/// # Errors
/// [`CompareError`]: a file cannot be read, or they have nothing in common.
pub fn compare(a: &Path, b: &Path, criteria: &Criteria) -> Result<Comparison, CompareError> {
    let (mut a, mut b) = (ComparedFile::open(a)?, ComparedFile::open(b)?);
    a.spell_out(&b);
    b.spell_out(&a);
    let mut matching = Matching::new(&a, &b, &criteria.map)?;
    let mut builder = ComparisonBuilder::new(criteria.tolerance);
    if matching.rows.is_some() {
        [&mut a, &mut b].into_iter().for_each(ComparedFile::name_rows);
    }
    for mut found in std::mem::take(&mut matching.arrays) {
        let found = &mut found;
        let mut values = (a.load(found.a)?, b.load(found.b)?);
        let dtypes = [&a.arrays()[found.a].dtype, &b.arrays()[found.b].dtype];
        let complex = dtypes.map(|dtype| is_complex(dtype));
        if let Some(rows) = &matching.rows
            && let Some(taken) = rows.taken(&values, complex)
        {
            values = taken;
            found.rows = rows.pairs.iter().map(|(row, _)| *row).collect();
        }
        if beyond_doubles(&values.0)
            && beyond_doubles(&values.1)
            && let (Some(x), Some(y)) = (a.integers(found.a), b.integers(found.b))
        {
            let whole = (x, y);
            let taken = matching.rows.as_ref().and_then(|rows| rows.taken(&whole, complex));
            let (x, y) = taken.unwrap_or(whole);
            if builder.integers(found, &x, &y) {
                continue;
            }
        }
        builder.arrays(found, &a.arrays()[found.a], &b.arrays()[found.b], values);
    }
    for found in &matching.tables {
        builder.table(found, a.table(), b.table());
    }
    Ok(builder.finish(&a, &b, matching))
}

/// Whether doubles may have rounded whole numbers to these.
fn beyond_doubles(values: &ArrayD<f64>) -> bool {
    const EXACT: f64 = (1_u64 << f64::MANTISSA_DIGITS) as f64;
    values.iter().any(|x| x.abs() >= EXACT)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An `.npy` file of two `int64`.
    fn npy(path: &Path, values: [i64; 2]) {
        let dictionary = "{'descr': '<i8', 'fortran_order': False, 'shape': (2,), }";
        let header = format!("{dictionary:<117}\n");
        let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
        bytes.extend(header.as_bytes());
        values.iter().for_each(|value| bytes.extend(value.to_le_bytes()));
        std::fs::write(path, bytes).unwrap();
    }

    #[test]
    fn whole_numbers_that_doubles_round_are_compared_exactly() {
        let folder = tempfile::tempdir().unwrap();
        let (a, b) = (folder.path().join("a.npy"), folder.path().join("b.npy"));
        npy(&a, [1 << 53, (1 << 53) + 1]);
        npy(&b, [1 << 53, 1 << 53]);
        assert!(compare(&a, &a, &Criteria::default()).unwrap().within);
        let found = compare(&a, &b, &Criteria::default()).unwrap();
        assert!(!found.within && found.texts[0].differing == 1, "{found:?}");
    }
}
