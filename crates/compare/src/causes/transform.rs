//! A power, a root or a logarithm of the other side.

use ndarray::Array3;

use super::fit::{Fit, Group, Model, fit};
use super::{Cause, CauseKind, factor};
use crate::pair::Pair;

struct Change {
    name: &'static str,
    meaning: &'static str,
    of: fn(f64) -> f64,
    model: Model,
}

const CHANGES: [Change; 4] = [
    Change {
        name: "square",
        meaning: "powers against magnitudes (power = 2 or 1)",
        of: |v| v * v,
        model: Model::Ratio,
    },
    Change {
        name: "10 log10",
        meaning: "decibels of powers (power_to_db) against the powers themselves",
        of: |v| 10.0 * v.log10(),
        model: Model::Offset,
    },
    Change {
        name: "20 log10",
        meaning: "decibels of magnitudes (amplitude_to_db) against the magnitudes themselves",
        of: |v| 20.0 * v.log10(),
        model: Model::Offset,
    },
    Change {
        name: "ln",
        meaning: "natural logarithms against the values themselves",
        of: f64::ln,
        model: Model::Offset,
    },
];

/// The change that makes one side of the other, with the first array brought to the second.
pub(super) fn detect(pair: &Pair, noise: f64) -> Option<(Cause, Array3<f64>)> {
    CHANGES.iter().find_map(|change| {
        forward(change, &pair.a, &pair.b, noise, ["a", "b"]).or_else(|| {
            let largest =
                pair.a.iter().filter(|v| v.is_finite()).fold(0.0f64, |m, v| m.max(v.abs()));
            // The other direction leaves nothing to look at in terms of b.
            let (cause, _) = forward(change, &pair.b, &pair.a, 1e-5 * largest, ["b", "a"])?;
            Some((cause, pair.b.clone()))
        })
    })
}

fn forward(
    change: &Change,
    from: &Array3<f64>,
    to: &Array3<f64>,
    noise: f64,
    [side, other]: [&str; 2],
) -> Option<(Cause, Array3<f64>)> {
    if from.iter().any(|&v| v < 0.0) {
        return None;
    }
    // Logarithms of zero are infinite, and so left out of the fit: the other side has its lowest values there.
    let changed = from.mapv(change.of);
    let finite = || changed.iter().zip(to).filter(|(x, _)| x.is_finite());
    let lowest = finite().map(|(_, y)| *y).fold(f64::INFINITY, f64::min);
    let is_low = |(x, y): (&f64, &f64)| x.is_finite() || *y <= lowest + noise;
    if finite().count() * 10 < to.len() || !changed.iter().zip(to).all(is_low) {
        return None;
    }
    let found = fit(&changed, to, noise, Group::Whole, change.model).or_else(|| {
        // The same thing exactly has no differences left to fit.
        let apart = finite().filter(|(x, y)| (*x - *y).abs() > noise).count();
        (apart * 10 < finite().count()).then(Fit::identity)
    })?;
    let [slope, offset] = found.lines[0];
    let name = change.name;
    let (detail, constant) = match change.model {
        Model::Ratio if slope == 1.0 => (format!("{other} = {name} of {side}"), None),
        Model::Ratio => {
            (format!("{other} = {slope:.6} times the {name} of {side}"), factor::name(slope))
        }
        _ if offset == 0.0 => (format!("{other} = {name} of {side}"), None),
        _ => (format!("{other} = {name} of {side} + {offset:.6}"), factor::name_decibels(offset)),
    };
    let evidence = match constant {
        Some(constant) => format!("{detail} (factor {constant})"),
        None => detail,
    };
    Some((Cause::new(CauseKind::Transform, change.meaning, evidence), found.apply(&changed)))
}
