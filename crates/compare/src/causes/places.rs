//! Differences in some frames, coefficients or channels only.

use super::{Cause, CauseKind};
use crate::pair::{Axes, Pair};

/// Where the differing values are.
struct Profile {
    differing: usize,
    /// Whether any value differs, for each place along each axis.
    touched: [Vec<bool>; 3],
    /// Smallest and largest difference of those that differ.
    least: f64,
    most: f64,
}

/// Differences from this share of the largest one on are larger.
const LARGER: f64 = 0.02;
/// Most frames at one end that padding reaches: a transform of 16 hops, and a delta of width 9.
const EDGE: usize = 32;

/// Where all differences are.
pub(super) fn detect(pair: &Pair, noise: f64) -> Vec<Cause> {
    let profile = Profile::new(pair, noise);
    match steps(&profile, pair, noise) {
        Some(cause) => vec![cause],
        None => confined(&profile, pair),
    }
}

/// Where the larger differences are.
pub(super) fn detect_larger(pair: &Pair, noise: f64) -> Vec<Cause> {
    let threshold = LARGER * Profile::new(pair, noise).most;
    let causes = confined(&Profile::new(pair, threshold.max(noise)), pair);
    let larger = |c: Cause| {
        let evidence = format!("of differences above {threshold:.3}: {}", c.evidence);
        Cause { evidence, ..c }
    };
    causes.into_iter().map(larger).collect()
}

fn confined(profile: &Profile, pair: &Pair) -> Vec<Cause> {
    if profile.differing == 0 {
        return Vec::new();
    }
    let edges = if pair.axes == Axes::Table { None } else { edges(profile) };
    [edges, bands(profile, pair), channels(profile)].into_iter().flatten().collect()
}

impl Profile {
    fn new(pair: &Pair, noise: f64) -> Self {
        let (channels, coefficients, frames) = pair.a.dim();
        let mut profile = Self {
            differing: 0,
            touched: [vec![false; channels], vec![false; coefficients], vec![false; frames]],
            least: f64::INFINITY,
            most: 0.0,
        };
        for ((place, a), b) in pair.a.indexed_iter().zip(&pair.b) {
            let difference = (a - b).abs();
            let both_missing = a.is_nan() && b.is_nan();
            if a == b || both_missing || difference <= noise {
                continue;
            }
            profile.differing += 1;
            profile.touched[0][place.0] = true;
            profile.touched[1][place.1] = true;
            profile.touched[2][place.2] = true;
            if difference.is_finite() {
                profile.least = profile.least.min(difference);
                profile.most = profile.most.max(difference);
            }
        }
        profile
    }

    /// First and last place touched along an axis, and how many there are.
    fn span(&self, axis: usize) -> (usize, usize, usize) {
        let touched = &self.touched[axis];
        let first = touched.iter().position(|&t| t).unwrap_or(0);
        let last = touched.iter().rposition(|&t| t).unwrap_or(0);
        (first, last, touched.len())
    }
}

fn edges(profile: &Profile) -> Option<Cause> {
    let touched = &profile.touched[2];
    let (frames, half) = (touched.len(), touched.len() / 2);
    let head = touched[..half].iter().rposition(|&t| t).map_or(0, |last| last + 1);
    let tail = touched[half..].iter().position(|&t| t).map_or(0, |first| frames - half - first);
    if head > EDGE || tail > EDGE || 3 * (head + tail) > frames {
        return None;
    }
    // What comes from an end begins there, and reaches frame after frame.
    let dense = |edge: &[bool], at_end: Option<&bool>| {
        let touched = edge.iter().filter(|&&t| t).count();
        edge.is_empty() || (at_end == Some(&true) && 5 * touched >= 4 * edge.len())
    };
    if !dense(&touched[..head], touched.first())
        || !dense(&touched[frames - tail..], touched.last())
    {
        return None;
    }
    let between = frames - head - tail;
    let which = match (head, tail) {
        (0, tail) => format!("last {tail}"),
        (head, 0) => format!("first {head}"),
        (head, tail) => format!("first {head} and the last {tail}"),
    };
    let evidence = format!("only the {which} of {frames} frames differ; the other {between} agree");
    let cause = match (head, tail) {
        (0, _) => {
            "another end: padding, an incomplete last frame, or the last samples of a resampler"
        }
        (_, 0) => "another start: padding, or a first frame without predecessor (deltas, flux)",
        _ => {
            "padding at the ends: zeros (librosa 0.11) against reflection (librosa 0.8) or none, or \
             another treatment of the ends (deltas)"
        }
    };
    Some(Cause::new(CauseKind::EdgeFrames, cause, evidence))
}

fn bands(profile: &Profile, pair: &Pair) -> Option<Cause> {
    let (first, last, coefficients) = profile.span(1);
    let word = pair.axes.word(1);
    if pair.axes == Axes::Table || coefficients < 4 || (first == 0 && last + 1 == coefficients) {
        return None;
    }
    // A block of coefficients, not single ones here and there.
    let touched = profile.touched[1].iter().filter(|&&t| t).count();
    if 5 * touched < 4 * (last + 1 - first) {
        return None;
    }
    let evidence = format!("only {word}s {first} to {last} of 0 to {} differ", coefficients - 1);
    let cause = if (first, last) == (0, 0) {
        let evidence = format!("only {word} 0 of {coefficients} differs");
        let cause = match constant_offset(pair) {
            Some(offset) => format!(
                "another level: of MFCC, {offset:.4} in {word} 0 is {:.4} dB over 128 bands (offset / \
                 sqrt(bands)); a reference, gain or scale of the samples",
                offset / 128f64.sqrt()
            ),
            None => format!("{word} 0 is something else: log energy instead, or the DC bin"),
        };
        return Some(Cause::new(CauseKind::Bands, cause, evidence));
    } else if 2 * first >= coefficients && last + 2 >= coefficients {
        "the top of the spectrum: another resampler (kaiser_best against soxr_hq), fmax, or a low-pass \
         (lossy compression)"
    } else if first == 0 && 2 * last < coefficients {
        "the bottom of the spectrum: a constant offset of the samples, fmin, or a high-pass \
         (pre-emphasis)"
    } else if 2 * touched > coefficients {
        return None;
    } else {
        "only some coefficients: filters with other edges"
    };
    Some(Cause::new(CauseKind::Bands, cause, evidence))
}

/// The difference in coefficient 0, where it is the same in all frames up to a thousandth.
fn constant_offset(pair: &Pair) -> Option<f64> {
    let zero = ndarray::Axis(1);
    let (a, b) = (pair.a.index_axis(zero, 0), pair.b.index_axis(zero, 0));
    let offset = b.mean()? - a.mean()?;
    let constant = a.iter().zip(&b).all(|(a, b)| (b - a - offset).abs() <= 1e-3 * offset.abs());
    constant.then_some(offset)
}

fn channels(profile: &Profile) -> Option<Cause> {
    let touched = &profile.touched[0];
    let which: Vec<String> =
        (0..touched.len()).filter(|&c| touched[c]).map(|c| c.to_string()).collect();
    if which.len() == touched.len() {
        return None;
    }
    let evidence = format!("only channels {} of {} differ", which.join(", "), touched.len());
    let cause = "other signals in these channels, or a statistic over all channels (top_db below \
                 the maximum of all) that affects quiet ones";
    Some(Cause::new(CauseKind::Channels, cause, evidence))
}

/// Values that count something (bins, crossings) flip by whole steps where rounding decides.
fn steps(profile: &Profile, pair: &Pair, noise: f64) -> Option<Cause> {
    let share = profile.differing as f64 / pair.a.len() as f64;
    let step = profile.least;
    let whole = |v: f64| (v / step - (v / step).round()).abs() <= 1e-3;
    let differing = || pair.values().filter(|(a, b)| (a - b).abs() > noise);
    if profile.differing == 0
        || share > 0.05
        || !step.is_finite()
        || !differing().all(|(a, b)| whole(a) && whole(b))
    {
        return None;
    }
    let evidence = format!(
        "{} values ({:.2} %) differ, by whole multiples of {step:.6}, at most {:.0}",
        profile.differing,
        100.0 * share,
        profile.most / step
    );
    let cause = "single counts flip (a bin of a rolloff, a zero crossing): rounding at a threshold";
    Some(Cause::new(CauseKind::Steps, cause, evidence))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_comes_from_an_end_begins_there() {
        let cause = |differing: &[usize]| {
            let mut frames = vec![false; 118];
            differing.iter().for_each(|&at| frames[at] = true);
            let touched = [vec![true; 2], vec![true; 5], frames];
            let profile = Profile { differing: differing.len(), touched, least: 0.1, most: 1.0 };
            edges(&profile).map(|cause| cause.evidence)
        };
        for apart in [&[7][..], &[60], &[20], &[110], &[0, 7], &[0, 1, 110], &[116]] {
            assert_eq!(cause(apart), None, "{apart:?}");
        }
        for (edge, which) in [
            (&[0][..], "first 1 "),
            (&[0, 1, 2, 4, 5], "first 6 "),
            (&[117], "last 1 "),
            (&[0, 1, 116, 117], "first 2 and the last 2 "),
        ] {
            assert!(cause(edge).is_some_and(|said| said.contains(which)), "{edge:?}");
        }
    }
}
