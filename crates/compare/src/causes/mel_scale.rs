//! HTK's mel scale against Slaney's: bands at other frequencies.

use corsmal_dsp::mel::{hz_to_mel, mel_frequencies};
use ndarray::{Array2, Array3, Axis};

use super::{Cause, CauseKind};
use crate::pair::{Axes, Pair};

/// Upper ends of mel banks in use, in Hz.
const TOPS: [f64; 8] = [4000.0, 7500.0, 8000.0, 8300.0, 11_025.0, 16_000.0, 22_050.0, 24_000.0];
/// Fewest bands and frames to tell scales apart.
const BANDS: usize = 20;
const FRAMES: usize = 8;
/// Frames looked at.
const LOOKED_AT: usize = 400;
/// By how much moving the bands must lower the residual.
const LOWER: f64 = 0.5;

/// Moves the bands of a from one scale to the other and looks how well they then fit b.
pub(super) fn detect(pair: &Pair) -> Option<Cause> {
    let (_, bands, frames) = pair.a.dim();
    if pair.axes == Axes::Table || bands < BANDS || frames < FRAMES {
        return None;
    }
    let (a, b) = (levels(&pair.a)?, levels(&pair.b)?);
    let unmoved: Vec<f64> = (0..bands).map(|band| band as f64).collect();
    // With another norm of the filters each band has a level of its own, too.
    let (before, (after, top, htk_in_a)) = [false, true].into_iter().find_map(|own| {
        let before = residual(&a, &b, &unmoved, own);
        let moved = TOPS.iter().flat_map(|&top| [(top, true), (top, false)]);
        let after = moved.map(|(top, htk_in_a)| {
            (residual(&a, &b, &positions(bands, top, htk_in_a), own), top, htk_in_a)
        });
        let best = after.min_by(|x, y| x.0.total_cmp(&y.0))?;
        (best.0 <= LOWER * before).then_some((before, best))
    })?;
    let (a, b) = if htk_in_a { ("HTK's", "Slaney's") } else { ("Slaney's", "HTK's") };
    let cause = format!("a has {a} mel scale, b {b} (htk = true or false)");
    let evidence = format!(
        "with the bands of a moved accordingly (0 to {top} Hz fits best), the mean difference of \
         levels falls from {before:.3} to {after:.3}"
    );
    Some(Cause::new(CauseKind::MelScale, cause, evidence))
}

/// Where the centres of b's bands lie among those of a, in bands.
fn positions(bands: usize, top: f64, htk_in_a: bool) -> Vec<f64> {
    let step = hz_to_mel(top, htk_in_a) / (bands + 1) as f64;
    let centres = mel_frequencies(bands + 2, 0.0, top, !htk_in_a);
    centres[1..=bands].iter().map(|&hz| hz_to_mel(hz, htk_in_a) / step - 1.0).collect()
}

/// Levels as `[band, frame]` of the first channel: logarithms where there are only powers.
fn levels(values: &Array3<f64>) -> Option<Array2<f64>> {
    let step = values.len_of(Axis(2)) / LOOKED_AT + 1;
    let levels = values.index_axis(Axis(0), 0);
    let levels = levels.slice(ndarray::s![.., ..;step]).to_owned();
    if levels.iter().any(|v| !v.is_finite()) {
        return None;
    }
    let powers = levels.iter().all(|&v| v >= 0.0);
    Some(if powers { levels.mapv(|v| 10.0 * (v + 1e-10).log10()) } else { levels })
}

/// Mean distance between b's bands and a's at these positions, apart from a constant level, or from
/// one of each band's own.
fn residual(a: &Array2<f64>, b: &Array2<f64>, positions: &[f64], own: bool) -> f64 {
    let last = a.nrows() - 1;
    let mut differences = b.clone();
    for (mut row, &position) in differences.axis_iter_mut(Axis(0)).zip(positions) {
        let position = position.clamp(0.0, last as f64);
        let (below, part) = (position.floor() as usize, position.fract());
        let (low, high) = (a.row(below), a.row((below + 1).min(last)));
        row.zip_mut_with(&low, |d, low| *d -= (1.0 - part) * low);
        row.zip_mut_with(&high, |d, high| *d -= part * high);
    }
    let level = differences.mean().unwrap_or(0.0);
    for mut row in differences.rows_mut() {
        let level = if own { row.mean().unwrap_or(0.0) } else { level };
        row.mapv_inplace(|d| (d - level).abs());
    }
    differences.mean().unwrap_or(0.0)
}
