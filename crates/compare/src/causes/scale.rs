//! A constant added, a constant factor, or both: for the whole, or for each channel, coefficient or
//! frame.

use std::f64::consts::{PI, SQRT_2};

use ndarray::{Array3, ArrayView1, Axis};

use super::fit::{Fit, Group, Model, fit, median};
use super::{Cause, CauseKind, factor};
use crate::pair::{Axes, Pair};

/// A fit that explains this share ends the search; others must be worth it.
const ENOUGH: f64 = 0.995;
/// Two ratios are the same within this.
const SAME: f64 = 1e-3;

/// The simplest change of scale that explains the differences, with the first array so changed.
pub(super) fn detect(pair: &Pair, noise: f64) -> Option<(Cause, Array3<f64>)> {
    let tries = [
        (Group::Whole, Model::Offset),
        (Group::Whole, Model::Ratio),
        (Group::Whole, Model::Affine),
        (Group::Channel, Model::Offset),
        (Group::Channel, Model::Ratio),
        (Group::Coefficient, Model::Offset),
        (Group::Coefficient, Model::Ratio),
        (Group::Frame, Model::Offset),
        (Group::Frame, Model::Ratio),
        (Group::Series, Model::Affine),
    ];
    let mut best: Option<(Group, Model, Fit)> = None;
    for (group, model) in tries {
        let Some(found) = fit(&pair.a, &pair.b, noise, group, model) else { continue };
        // More parameters must leave less than half as much unexplained.
        let better = |fit: &Fit| 2.0 * (1.0 - found.share) < 1.0 - fit.share;
        if best.as_ref().is_none_or(|(.., fit)| better(fit)) {
            let enough = found.share >= ENOUGH;
            best = Some((group, model, found));
            if enough {
                break;
            }
        }
    }
    let (group, model, found) = best?;
    let cause = match (group, model) {
        (Group::Whole, Model::Offset) => offset(pair, found.lines[0][1], noise),
        (Group::Whole, Model::Ratio) => ratio(pair, found.lines[0][0]),
        (Group::Whole, Model::Affine) => affine(pair, found.lines[0]),
        (_, Model::Offset) => offsets(pair, group, &found),
        (_, Model::Ratio) => ratios(pair, group, &found),
        (_, Model::Affine) => standardised(pair),
    };
    let share = percent(found.share);
    let evidence = format!("{} ({share} of the differing values)", cause.evidence);
    Some((Cause { evidence, ..cause }, found.apply(&pair.a)))
}

/// Six digits after the point, or after the first one where there would be too few.
fn number(value: f64) -> String {
    if (1e-3..1e6).contains(&value.abs()) { format!("{value:.6}") } else { format!("{value:.6e}") }
}

fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

fn offset(pair: &Pair, offset: f64, noise: f64) -> Cause {
    let evidence = format!("b - a = {offset:.6} throughout");
    let top = |values: &Array3<f64>| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let (top_a, top_b) = (top(&pair.a), top(&pair.b));
    let cause = if top_b.abs() <= noise || top_a.abs() <= noise {
        let side = if top_b.abs() <= noise { "b" } else { "a" };
        format!("{side} is relative to its own maximum, which is 0 (ref = max)")
    } else if let Some(known) = factor::name_decibels(offset) {
        format!("another reference level; if decibels, powers differ by {known}")
    } else {
        "another reference level (ref), gain or scale of the samples, if these are logarithms"
            .into()
    };
    Cause::new(CauseKind::Offset, cause, evidence)
}

fn ratio(pair: &Pair, ratio: f64) -> Cause {
    let evidence = format!("b / a = {} throughout", number(ratio));
    // Only logarithms are negative and far from symmetric.
    let signed = pair.a.iter().any(|&v| v < 0.0);
    let cause = match (factor::name_logarithms(ratio), factor::name(ratio)) {
        (Some(known), _) if signed => known.to_string(),
        (Some(known), Some(other)) => format!("factor {other}; if logarithms, {known}"),
        (Some(known), None) => known.to_string(),
        (None, Some(known)) => format!("factor {known}"),
        (None, None) => "another normalisation (of window, transform, filters) or gain".into(),
    };
    Cause::new(CauseKind::Ratio, cause, evidence)
}

fn affine(pair: &Pair, [slope, offset]: [f64; 2]) -> Cause {
    let evidence = format!("b = {slope:.6} a + {offset:.6} throughout");
    let range = |values: &Array3<f64>| {
        let finite = || values.iter().copied().filter(|v| v.is_finite());
        (finite().fold(f64::INFINITY, f64::min), finite().fold(f64::NEG_INFINITY, f64::max))
    };
    let unit = |(least, most): (f64, f64)| least.abs() < 1e-4 && (most - 1.0).abs() < 1e-4;
    let whole = |values: &Array3<f64>| standard(values.mean().unwrap_or(f64::NAN), values.std(0.0));
    let cause = if unit(range(&pair.b)) || unit(range(&pair.a)) {
        let side = if unit(range(&pair.b)) { "b" } else { "a" };
        format!("{side} is scaled to the range 0 to 1")
    } else if whole(&pair.b) || whole(&pair.a) {
        let side = if whole(&pair.b) { "b" } else { "a" };
        format!("{side} is standardised (mean 0, deviation 1)")
    } else if let Some(known) = factor::name_logarithms(slope) {
        format!("{known}, and another reference")
    } else {
        "another unit: both scale and reference differ".into()
    };
    Cause::new(CauseKind::Affine, cause, evidence)
}

/// Mean 0 and deviation 1, by n or by n - 1.
fn standard(mean: f64, deviation: f64) -> bool {
    mean.abs() < 1e-3 && (deviation - 1.0).abs() < 1e-2
}

fn standardised(pair: &Pair) -> Cause {
    let word = pair.axes.word(1);
    let each = |values: &Array3<f64>| {
        values.lanes(Axis(2)).into_iter().all(|series| {
            let (mean, deviation) = (series.mean().unwrap_or(f64::NAN), series.std(0.0));
            standard(mean, deviation)
        })
    };
    let cause = match (each(&pair.b), each(&pair.a)) {
        (true, _) => format!("b is standardised: each {word} has mean 0 and deviation 1"),
        (_, true) => format!("a is standardised: each {word} has mean 0 and deviation 1"),
        _ => format!("each {word} has its own scale and reference: a scaler fitted elsewhere"),
    };
    let evidence = format!("a straight line from a to b for each {word}");
    Cause::new(CauseKind::Affine, cause, evidence)
}

/// The word for a group.
fn word(pair: &Pair, group: Group) -> &'static str {
    pair.axes.word(match group {
        Group::Whole | Group::Channel => 0,
        Group::Coefficient | Group::Series => 1,
        Group::Frame => 2,
    })
}

fn offsets(pair: &Pair, group: Group, fit: &Fit) -> Cause {
    let offsets: Vec<f64> = fit.lines.iter().map(|line| line[1]).collect();
    let (least, most) = extremes(&offsets);
    let word = word(pair, group);
    let evidence = format!("b - a is constant in each {word}, {least:.4} to {most:.4}");
    let cause = match group {
        Group::Coefficient if pair.axes == Axes::Table => {
            "columns have other reference levels (means move with a reference, deviations do not)"
        }
        Group::Coefficient
            if bands_narrow(&offsets.iter().map(|o| 10f64.powf(o / 10.0)).collect::<Vec<_>>()) =>
        {
            "mel filters are normalised otherwise (norm slaney against none), in decibels"
        }
        Group::Coefficient => {
            "filters are normalised differently, in decibels, or a fixed equalisation \
             (pre-emphasis)"
        }
        Group::Channel => "each channel has its own reference: its maximum, or its gain",
        _ => "each frame has its own reference: its maximum, or its level",
    };
    Cause::new(CauseKind::Offset, cause, evidence)
}

fn ratios(pair: &Pair, group: Group, fit: &Fit) -> Cause {
    let ratios: Vec<f64> = fit.lines.iter().map(|line| line[0]).collect();
    let (least, most) = extremes(&ratios);
    let word = word(pair, group);
    let evidence =
        format!("b / a is constant in each {word}, {} to {}", number(least), number(most));
    let cause = match group {
        Group::Coefficient => coefficient_ratios(&ratios),
        Group::Channel => {
            "each channel has its own factor: normalised channel by channel, or another gain".into()
        }
        _ => frame_norm(pair),
    };
    Cause::new(CauseKind::Ratio, cause, evidence)
}

fn coefficient_ratios(ratios: &[f64]) -> String {
    let near = |a: f64, b: f64| (a / b - 1.0).abs() <= SAME;
    if ratios.iter().all(|r| near(r.abs(), 1.0)) {
        let flipped = ratios.iter().filter(|r| **r < 0.0).count();
        return format!("{flipped} coefficients have the other sign: signs of PCA components");
    }
    if let [first, second, rest @ ..] = ratios
        && rest.iter().all(|&r| near(r, *second))
    {
        for (root, direction) in
            [(SQRT_2, "ortho in a, none in b"), (1.0 / SQRT_2, "none in a, ortho in b")]
        {
            // Unnormalised, coefficient 0 is 2 sqrt(n) times the orthonormal one, others sqrt(2 n).
            if near(first / second, root) {
                let squared = second * second;
                let bands = if squared > 1.0 { squared / 2.0 } else { 1.0 / (2.0 * squared) };
                let bands = bands.round();
                return format!("norm of the cosine transform: {direction}, over {bands} bands");
            }
        }
    }
    if let Some((lifter, side)) = lifter(ratios) {
        return format!("cepstral liftering: {side} with lifter = {lifter}");
    }
    if bands_narrow(ratios) {
        return "mel filters are normalised otherwise (norm slaney against none)".into();
    }
    "each coefficient has its own factor: filters normalised differently, or a fixed equalisation"
        .into()
}

/// Whether factors of mel bands are those of Slaney's normalisation or its inverse: one value where
/// bands are equally wide (up to 1 kHz), then steadily more or less.
fn bands_narrow(ratios: &[f64]) -> bool {
    let start = ratios.len() / 8;
    let flat = ratios.iter().take(start).skip(1).all(|&r| (r / ratios[0] - 1.0).abs() < 0.05);
    let upper = &ratios[ratios.len() / 2..];
    let steady = |sign: f64| upper.windows(2).all(|w| sign * (w[1] - w[0]) > 0.0);
    start >= 2 && flat && (steady(1.0) || steady(-1.0))
}

/// librosa's liftering, `1 + L / 2 * sin(pi * (k + 1) / L)`, or its inverse.
fn lifter(ratios: &[f64]) -> Option<(usize, &'static str)> {
    let weight = |lifter: usize, k: usize| {
        let lifter = lifter as f64;
        1.0 + lifter / 2.0 * (PI * (k + 1) as f64 / lifter).sin()
    };
    (2..=200).find_map(|lifter| {
        let fits = |inverse: bool| {
            ratios.iter().enumerate().all(|(k, &ratio)| {
                let ratio = if inverse { 1.0 / ratio } else { ratio };
                (ratio - weight(lifter, k)).abs() <= SAME * weight(lifter, k).abs().max(1.0)
            })
        };
        if fits(false) { Some((lifter, "b")) } else { fits(true).then_some((lifter, "a")) }
    })
}

/// One step of a sum or maximum.
type Join = fn(f64, f64) -> f64;

/// What the frames of one side have in common.
fn frame_norm(pair: &Pair) -> String {
    for (side, values) in [("b", &pair.b), ("a", &pair.a)] {
        let norms: [(&str, Join); 3] = [
            ("maximum 1 (norm = inf)", |sum, v| sum.max(v.abs())),
            ("sum 1 (norm = 1)", |sum, v| sum + v.abs()),
            ("length 1 (norm = 2)", |sum, v| sum + v * v),
        ];
        for (name, join) in norms {
            let norm = |frame: ArrayView1<'_, f64>| frame.iter().copied().fold(0.0, join);
            let norms = values.lanes(Axis(1)).into_iter().map(norm).filter(|&n| n > 0.0);
            if median(norms.map(|n| (n - 1.0).abs())).is_some_and(|off| off < 1e-4) {
                return format!("frames of {side} are normalised to {name}");
            }
        }
    }
    "each frame has its own factor: frames are normalised differently".into()
}

fn extremes(values: &[f64]) -> (f64, f64) {
    values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, m), &v| (l.min(v), m.max(v)))
}
