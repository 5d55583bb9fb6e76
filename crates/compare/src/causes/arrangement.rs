//! The same values in other places: axes, channels, frames, coefficients.

use ndarray::{Array3, ArrayD, ArrayView3, Axis, IxDyn, Slice, s};

use super::{Cause, CauseKind};
use crate::pair::{Axes, Pair, cube};

/// Share of the larger values that must agree.
const AGREE: f64 = 0.95;
/// Share that must agree where coefficients go round: all but one of many is a mere shift.
const ROUND: f64 = 0.99;
/// Most frames by which one side may be ahead.
const FRAMES: isize = 16;
/// Most coefficients by which one side may be ahead.
const COEFFICIENTS: isize = 4;

/// Share of the larger values (above 50 times the noise) that agree; `None` of fewer than eight.
fn agreement<'v>(pairs: impl Iterator<Item = (&'v f64, &'v f64)>, noise: f64) -> Option<f64> {
    let (mut large, mut agree) = (0usize, 0usize);
    for (a, b) in pairs.filter(|(a, b)| a.abs().max(b.abs()) > 50.0 * noise) {
        large += 1;
        agree += usize::from((a - b).abs() <= noise);
    }
    (large >= 8).then(|| agree as f64 / large as f64)
}

fn agree(a: &ArrayView3<'_, f64>, b: &ArrayView3<'_, f64>, noise: f64) -> f64 {
    agreement(a.iter().zip(b), noise).unwrap_or(0.0)
}

fn percent(share: f64) -> String {
    format!("{:.1} % of the larger values agree", 100.0 * share)
}

/// Another order within equal shapes.
pub(super) fn same_shape(pair: &Pair, noise: f64) -> Option<Cause> {
    if pair.axes == Axes::Table {
        return None;
    }
    let (a, b) = (pair.a.view(), pair.b.view());
    // Where most agrees as it is, nothing was moved.
    if agree(&a, &b, noise) >= 0.5 {
        return None;
    }
    square(a, b, noise)
        .or_else(|| channel_order(&pair.a, &pair.b, noise))
        .or_else(|| rolled(&pair.a, &pair.b, noise))
        .or_else(|| shifted(&a, &b, 1, noise))
        .or_else(|| shifted(&a, &b, 2, noise))
}

fn square(a: ArrayView3<'_, f64>, b: ArrayView3<'_, f64>, noise: f64) -> Option<Cause> {
    for (one, other) in [(1, 2), (0, 2), (0, 1)] {
        let mut swapped = a;
        swapped.swap_axes(one, other);
        if a.len_of(Axis(one)) > 1 && swapped.dim() == b.dim() {
            let share = agree(&swapped, &b, noise);
            if share >= AGREE {
                let [one, other] = [one, other].map(|axis| Axes::Frames.word(axis));
                let evidence = format!("with {one} and {other} axes exchanged {}", percent(share));
                return Some(Cause::new(CauseKind::Axes, "transposed axes", evidence));
            }
        }
    }
    None
}

fn channel_order(a: &Array3<f64>, b: &Array3<f64>, noise: f64) -> Option<Cause> {
    let count = a.len_of(Axis(0));
    if !(2..=64).contains(&count) {
        return None;
    }
    let mut order = Vec::with_capacity(count);
    for wanted in b.axis_iter(Axis(0)) {
        let same = |&c: &usize| {
            let found = a.index_axis(Axis(0), c);
            agreement(found.iter().zip(&wanted), noise).is_some_and(|share| share >= AGREE)
        };
        order.push((0..count).find(|c| !order.contains(c) && same(c))?);
    }
    let list: Vec<String> = order.iter().map(usize::to_string).collect();
    let evidence =
        format!("channels 0 to {} of b are channels {} of a", count - 1, list.join(", "));
    Some(Cause::new(CauseKind::ChannelOrder, "the channels are in another order", evidence))
}

/// Coefficients that go round: pitch classes from another one on.
fn rolled(a: &Array3<f64>, b: &Array3<f64>, noise: f64) -> Option<Cause> {
    let count = a.len_of(Axis(1));
    if !(3..=48).contains(&count) {
        return None;
    }
    (1..count).find_map(|shift| {
        let (front, back) = a.view().split_at(Axis(1), shift);
        let turned = ndarray::concatenate(Axis(1), &[back, front]).ok()?;
        let share = agree(&turned.view(), &b.view(), noise);
        (share >= ROUND).then(|| {
            let evidence = format!(
                "coefficient k of b is coefficient (k + {shift}) mod {count} of a: {}",
                percent(share)
            );
            let cause =
                "the coefficients begin elsewhere and wrap around (pitch classes from C or from A)";
            Cause::new(CauseKind::Coefficients, cause, evidence)
        })
    })
}

/// The parts of both sides that overlap when place `k` of b is place `k + shift` of a.
fn overlap<'v>(
    a: &ArrayView3<'v, f64>,
    b: &ArrayView3<'v, f64>,
    axis: usize,
    shift: isize,
) -> Option<(ArrayView3<'v, f64>, ArrayView3<'v, f64>)> {
    let (start_a, start_b) = (shift.max(0) as usize, (-shift).max(0) as usize);
    let left = |v: &ArrayView3<'_, f64>, start| v.len_of(Axis(axis)).checked_sub(start);
    let length = left(a, start_a)?.min(left(b, start_b)?);
    let cut = |v: &ArrayView3<'v, f64>, start: usize| {
        let mut v = *v;
        v.slice_axis_inplace(Axis(axis), Slice::from(start..start + length));
        v
    };
    (length > 0).then(|| (cut(a, start_a), cut(b, start_b)))
}

/// One side is ahead along an axis, or longer.
fn shifted<'v>(
    a: &ArrayView3<'v, f64>,
    b: &ArrayView3<'v, f64>,
    axis: usize,
    noise: f64,
) -> Option<Cause> {
    let reach = if axis == 1 { COEFFICIENTS } else { FRAMES };
    let lengths = [a, b].map(|v| v.len_of(Axis(axis)));
    let mut best = (0.0, 0);
    // Small shifts first, so that the smallest of equals is taken.
    for shift in (0..=reach).flat_map(|n| [n, -n]) {
        let Some((x, y)) = overlap(a, b, axis, shift) else { continue };
        let share = agree(&x, &y, noise);
        if 2 * x.len_of(Axis(axis)) >= lengths[0].min(lengths[1]) && share > best.0 {
            best = (share, shift);
        }
    }
    let (share, shift) = best;
    // Edges and clamps leave fewer that agree than a mere change of order.
    if share < 0.8 || (shift == 0 && lengths[0] == lengths[1]) {
        return None;
    }
    let word = Axes::Frames.word(axis);
    let evidence = format!(
        "{word} k of b is {word} k{} of a; a has {}, b {}: {}",
        match shift {
            0 => String::new(),
            shift => format!(" {} {}", if shift > 0 { '+' } else { '-' }, shift.abs()),
        },
        lengths[0],
        lengths[1],
        percent(share)
    );
    let (longer, shorter) = if lengths[0] >= lengths[1] { ("a", "b") } else { ("b", "a") };
    let cause = match (axis, shift) {
        (1, 0) => format!("{longer} keeps more coefficients than {shorter}"),
        (1, shift) => {
            let side = if shift > 0 { "b" } else { "a" };
            format!(
                "{side} begins at coefficient {} of the other (coefficient 0 dropped, as in 12 of 13)",
                shift.abs()
            )
        }
        (_, 0) => format!(
            "{longer} has more frames at the end (padding, an incomplete last frame, one sample more)"
        ),
        (_, shift) => {
            let side = if shift > 0 { "b" } else { "a" };
            format!(
                "{side} begins at frame {} of the other (center = true against false, or a crop)",
                shift.abs()
            )
        }
    };
    let kind = if axis == 1 { CauseKind::Coefficients } else { CauseKind::Frames };
    Some(Cause::new(kind, cause, evidence))
}

/// Why shapes differ.
pub(super) fn other_shape(a: ArrayD<f64>, b: ArrayD<f64>, noise: f64) -> Option<Cause> {
    if let Some(cause) = permuted(&a, &b, noise) {
        return Some(cause);
    }
    let (a, b) = (cube(a), cube(b));
    let differing: Vec<usize> = (0..3).filter(|&k| a.shape()[k] != b.shape()[k]).collect();
    match differing[..] {
        [0] => channel_count(&a, &b, noise),
        [axis] => shifted(&a.view(), &b.view(), axis, noise),
        _ => None,
    }
}

fn permuted(a: &ArrayD<f64>, b: &ArrayD<f64>, noise: f64) -> Option<Cause> {
    let axes = a.ndim();
    if axes != b.ndim() || !(2..=4).contains(&axes) {
        return None;
    }
    orders(axes).into_iter().find_map(|order| {
        let turned = a.view().permuted_axes(IxDyn(&order));
        if turned.shape() != b.shape() {
            return None;
        }
        let share = agreement(turned.iter().zip(b), noise)?;
        (share >= AGREE).then(|| {
            let evidence =
                format!("a.transpose{order:?} has the shape of b, and {}", percent(share));
            let evidence = evidence.replace('[', "(").replace(']', ")");
            Cause::new(CauseKind::Axes, "transposed axes", evidence)
        })
    })
}

/// All orders of `count` axes.
fn orders(count: usize) -> Vec<Vec<usize>> {
    if count == 0 {
        return vec![Vec::new()];
    }
    let shorter = orders(count - 1);
    let insert = |at: usize| {
        shorter.iter().map(move |order| {
            let mut order = order.clone();
            order.insert(at, count - 1);
            order
        })
    };
    (0..count).flat_map(insert).collect()
}

fn channel_count(a: &Array3<f64>, b: &Array3<f64>, noise: f64) -> Option<Cause> {
    let (many, one, sides) = match (a.len_of(Axis(0)), b.len_of(Axis(0))) {
        (_, 1) => (a, b, ["a", "b"]),
        (1, _) => (b, a, ["b", "a"]),
        _ => return None,
    };
    let [many_side, one_side] = sides;
    let only = one.slice(s![0, .., ..]);
    let same = |other: ndarray::ArrayView2<'_, f64>| {
        agreement(other.iter().zip(&only), noise).filter(|&share| share >= AGREE)
    };
    let count = many.len_of(Axis(0));
    for (channel, values) in many.axis_iter(Axis(0)).enumerate() {
        if let Some(share) = same(values) {
            let cause =
                format!("{one_side} has only channel {channel} of the {count} of {many_side}");
            return Some(Cause::new(CauseKind::ChannelCount, cause, percent(share)));
        }
    }
    let mean = many.mean_axis(Axis(0))?;
    let share = same(mean.view())?;
    let cause = format!("{one_side} has the mean over the {count} channels of {many_side}");
    Some(Cause::new(CauseKind::ChannelCount, cause, percent(share)))
}
