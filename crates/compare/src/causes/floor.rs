//! Differences only where one side stands at its lower limit.

use ndarray::{ArrayView2, Axis};

use super::{Cause, CauseKind};
use crate::pair::{Axes, Pair};

/// Range of one channel.
struct Range {
    least: f64,
    most: f64,
    /// Values at the lower end.
    at_least: usize,
}

/// Fewest equal minima that make a limit.
const FEWEST: usize = 3;
/// `power_to_db(amin = 1e-10)` and `amplitude_to_db(amin = 1e-5)` of silence.
const AMIN: f64 = -100.0;

pub(super) fn detect(pair: &Pair, noise: f64) -> Option<Cause> {
    if pair.axes != Axes::Frames {
        return None;
    }
    let channels = |values: &ndarray::Array3<f64>| -> Vec<Range> {
        values.axis_iter(Axis(0)).map(|channel| range(&channel, noise)).collect()
    };
    let (a, b) = (channels(&pair.a), channels(&pair.b));
    let mut differing = 0usize;
    for (channel, (x, y)) in pair.a.axis_iter(Axis(0)).zip(pair.b.axis_iter(Axis(0))).enumerate() {
        // Of two limits the higher one shows wherever they matter.
        let (values, limit) =
            if a[channel].least > b[channel].least { (x, &a[channel]) } else { (y, &b[channel]) };
        for ((x, y), value) in x.iter().zip(&y).zip(&values) {
            if (x - y).abs() > noise {
                differing += 1;
                if limit.at_least < FEWEST || (value - limit.least).abs() > noise {
                    return None;
                }
            }
        }
    }
    if differing == 0 {
        return None;
    }
    let share = 100.0 * differing as f64 / pair.a.len() as f64;
    let [limits_a, limits_b] = [&a, &b].map(|ranges| describe(ranges));
    let evidence =
        format!("the {share:.1} % that differ are at a lower limit; a {limits_a}; b {limits_b}");
    Some(Cause::new(CauseKind::Floor, cause(&a, &b, noise), evidence))
}

fn range(channel: &ArrayView2<'_, f64>, noise: f64) -> Range {
    let least = channel.iter().copied().fold(f64::INFINITY, f64::min);
    let most = channel.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let at_least = channel.iter().filter(|&&v| v - least <= noise).count();
    Range { least, most, at_least }
}

/// How far the limits of all channels lie below the loudest channel's maximum, where they are one
/// and that is a whole number: a joint `top_db`.
fn joint(ranges: &[Range], noise: f64) -> Option<f64> {
    let loudest = ranges.iter().fold(f64::NEG_INFINITY, |most, r| most.max(r.most));
    let limits: Vec<f64> = limited(ranges).map(|r| r.least).collect();
    let first = *limits.first()?;
    let quieter = limited(ranges).any(|r| loudest - r.most > 10.0 * noise);
    let one = limits.iter().all(|limit| (limit - first).abs() <= 2.0 * noise);
    (quieter && one && whole(loudest - first, noise)).then_some(loudest - first)
}

/// Whether the limit of each channel lies the same whole number below its own maximum.
fn separate(ranges: &[Range], noise: f64) -> bool {
    let depths: Vec<f64> = limited(ranges).map(|r| r.most - r.least).collect();
    let same = |depth: &f64| (depth - depths[0]).abs() <= 4.0 * noise && whole(*depth, noise);
    !depths.is_empty() && depths.iter().all(same)
}

/// Channels that reach their limit.
fn limited(ranges: &[Range]) -> impl Iterator<Item = &Range> {
    ranges.iter().filter(|r| r.at_least >= FEWEST)
}

fn whole(depth: f64, noise: f64) -> bool {
    (depth - depth.round()).abs() <= 1e-3 + noise
}

fn cause(a: &[Range], b: &[Range], noise: f64) -> String {
    let at_amin = |ranges: &[Range]| limited(ranges).any(|r| (r.least - AMIN).abs() < 1e-3);
    let sides = [(a, b, "a", "b"), (b, a, "b", "a")];
    for (x, y, side, other) in sides {
        let Some(depth) = joint(x, noise).filter(|_| joint(y, noise).is_none()) else { continue };
        let (title, rest) = if separate(y, noise) {
            ("joint against separate top_db", "clamps below that of each".to_string())
        } else if at_amin(y) {
            ("joint top_db", format!("ends at {AMIN} dB (only amin)"))
        } else {
            ("joint top_db", "does not".to_string())
        };
        return format!(
            "{title}: {side} clamps {depth:.0} dB below the maximum of all channels (librosa), {other} \
             {rest}"
        );
    }
    match sides.into_iter().find(|(x, ..)| at_amin(x)) {
        Some((.., side, _)) => format!(
            "another lower limit: {side} ends at {AMIN} dB (only amin), the other is clamped \
             differently (top_db, amin)"
        ),
        None => "another lower limit: top_db, amin, or a small constant in the logarithm".into(),
    }
}

fn describe(ranges: &[Range]) -> String {
    let (first, rest) = ranges.split_first().expect("arrays with differing values have a channel");
    let depth = first.most - first.least;
    if rest.is_empty() {
        return format!("ends at {:.4}, {depth:.4} below its maximum", first.least);
    }
    let ends: Vec<String> = ranges.iter().take(4).map(|r| format!("{:.2}", r.least)).collect();
    let depths: Vec<String> =
        ranges.iter().take(4).map(|r| format!("{:.2}", r.most - r.least)).collect();
    let more = if ranges.len() > 4 { ", …" } else { "" };
    format!(
        "ends at {}{more} in its channels, {}{more} below their maxima",
        ends.join(", "),
        depths.join(", ")
    )
}
