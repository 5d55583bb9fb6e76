//! Equal up to the digits that were kept.

use super::{Cause, CauseKind};
use crate::pair::Pair;

/// What librosa's own single and double precision differ by at most, relative to the largest value
/// (measured over 668 cases).
const SINGLE: f64 = 2e-6;
/// Half a unit in the last place of half precision.
const HALF: f64 = 1.0 / 2048.0;

pub(super) fn detect(pair: &Pair, dtypes: [&str; 2], noise: f64) -> Option<Cause> {
    let largest = pair.largest();
    let (mut most, mut most_relative) = (0.0f64, 0.0f64);
    for (a, b) in pair.values() {
        // No rounding makes an infinity of a number, or turns its sign.
        if a.is_finite() != b.is_finite() || (a.is_infinite() && a != b) {
            return None;
        }
        if a.is_finite() && a != b {
            let difference = (a - b).abs();
            most = most.max(difference);
            // Below half precision's normal numbers the relative step grows.
            if a.abs().max(b.abs()) > 6.2e-5 {
                most_relative = most_relative.max(difference / a.abs().max(b.abs()));
            }
        }
    }
    let share = most / largest;
    if share <= SINGLE {
        let evidence = format!("largest difference {share:.1e} of the largest value");
        return Some(Cause::new(CauseKind::Rounding, "the same within float rounding", evidence));
    }
    let half = |dtype: &str| dtype.ends_with("f2");
    if (half(dtypes[0]) != half(dtypes[1])) && most_relative <= 1.01 * HALF {
        let evidence = format!(
            "types {} and {}; largest relative difference {most_relative:.1e}; half a step of \
             half precision is {HALF:.1e}",
            dtypes[0], dtypes[1]
        );
        return Some(Cause::new(CauseKind::Precision, "stored in half precision", evidence));
    }
    (most <= noise).then(|| {
        let evidence =
            format!("largest difference {share:.1e} of the largest value, small everywhere");
        let cause = "rounding of single precision in another order of operations (transform, sums)";
        Cause::new(CauseKind::Rounding, cause, evidence)
    })
}
