//! One side has a single value everywhere.

use super::{Cause, CauseKind};
use crate::pair::Pair;

/// Fewest values that a constant shows in.
const FEWEST: usize = 8;

pub(super) fn detect(pair: &Pair) -> Option<Cause> {
    if pair.a.len() < FEWEST {
        return None;
    }
    let range = |values: &ndarray::Array3<f64>| {
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values {
            // Of NaN nothing is larger or smaller.
            if value.is_nan() {
                return None;
            }
            (least, most) = (least.min(*value), most.max(*value));
        }
        Some((least, most))
    };
    let (a, b) = (range(&pair.a)?, range(&pair.b)?);
    let (side, value, other, (least, most)) = match (a.0 == a.1, b.0 == b.1) {
        (true, false) => ("a", a.0, "b", b),
        (false, true) => ("b", b.0, "a", a),
        _ => return None,
    };
    let cause = format!("{side} has one value everywhere: silence, or an array never filled");
    let all = pair.a.len();
    let evidence =
        format!("all {all} values of {side} are {value}, those of {other} {least:.4} to {most:.4}");
    Some(Cause::new(CauseKind::Constant, cause, evidence))
}
