//! Conversion of whole arrays.

use std::borrow::Cow;

use ndarray::{Array2, ArrayView2};
use rayon::prelude::*;

use super::check::check_rates;
use super::converter::Converter;
use super::sinc::{SincPlan, resample_sinc};
use super::{ResType, ResamplePlan};
use crate::error::Result;
use crate::real::{Real, all_finite, part_finite, require_finite};
use crate::tiles::planar;
use crate::vector::Lane;

/// `y [channels, samples]` at another rate (librosa 0.11 `resample`). Equal rates copy `y`.
///
/// `fix` makes the length `ceil(samples * target_sr / orig_sr)`, by a final zero where the filters
/// give one sample less; `scale` divides by the square root of the ratio. The filters run in single
/// precision for `f64` input too, as libsoxr's do.
///
/// # Errors
/// Impossible rates, or non-finite samples.
pub fn resample<T: Lane>(
    y: ArrayView2<T>,
    orig_sr: f64,
    target_sr: f64,
    res_type: ResType,
    fix: bool,
    scale: bool,
) -> Result<Array2<T>> {
    check_rates(orig_sr, target_sr)?;
    let y = planar(y);
    if !all_finite(y.as_slice().expect("contiguous")) {
        require_finite("y", &y)?;
    }
    if orig_sr == target_sr {
        return Ok(y.into_owned());
    }
    let ratio = target_sr / orig_sr;
    let samples = y.as_slice().expect("contiguous");
    let mut out = match Converter::shared(orig_sr, target_sr, res_type)? {
        Converter::Soxr(plan) => resample_hq(y.view(), &plan),
        Converter::Sinc(plan) => {
            let n = y.ncols();
            let mut out = Array2::zeros((y.nrows(), plan.filtered_len(n as u64) as usize));
            let slots = out.as_slice_mut().expect("made in C order");
            match (T::as_f32(samples), T::as_f32_mut(slots)) {
                (Some(samples), Some(slots)) => resample_sinc(samples, n, &plan, slots),
                _ => {
                    let fast = res_type == ResType::KaiserFast;
                    let plan = SincPlan::<T>::new(orig_sr, target_sr, fast)?;
                    resample_sinc(samples, n, &plan, slots);
                }
            }
            out
        }
    };
    let n_out = (y.ncols() as f64 * ratio).ceil() as usize;
    if fix && out.ncols() != n_out {
        let mut fixed = Array2::zeros((out.nrows(), n_out));
        let common = n_out.min(out.ncols());
        fixed.slice_mut(ndarray::s![.., ..common]).assign(&out.slice(ndarray::s![.., ..common]));
        out = fixed;
    }
    if scale {
        out.mapv_inplace(|v| T::of(v.wide() / ratio.sqrt()));
    }
    Ok(out)
}

/// The last `count` samples of [`resample`] of one channel by libsoxr's filters, or all of them
/// where there are fewer: no others are computed.
///
/// # Errors
/// Impossible rates, or non-finite samples.
pub(crate) fn resample_last(
    y: &[f32],
    orig_sr: f64,
    target_sr: f64,
    count: usize,
) -> Result<Vec<f32>> {
    if !part_finite(y) {
        require_finite("y", y)?;
    }
    let plan = match Converter::shared(orig_sr, target_sr, ResType::SoxrHq)? {
        Converter::Soxr(plan) => plan,
        Converter::Sinc(_) => unreachable!("another converter was asked for"),
    };
    let n = y.len() as u64;
    let (filtered, total) = (plan.filtered_len(n), plan.output_len(n));
    let first = total.saturating_sub(count as u64);
    let range = first.min(filtered)..filtered.min(total);
    let needed = plan.input_range(range.clone());
    let start = needed.start.clamp(0, n as i64) as usize;
    let end = (needed.end.max(0) as usize).clamp(start, y.len());
    let mut out = plan.segment(1, range, &y[start..end], start as u64)?;
    // The length that librosa gives may have one zero more.
    out.resize((total - first) as usize, 0.0);
    Ok(out)
}

/// How many of the first of `frames` frames [`resample_last`] of `count` may do without: with the rest alone
/// it gives the same bits.
///
/// # Errors
/// Impossible rates.
pub(crate) fn before_last(orig_sr: f64, target_sr: f64, frames: u64, count: usize) -> Result<u64> {
    check_rates(orig_sr, target_sr)?;
    let Converter::Soxr(plan) = Converter::shared(orig_sr, target_sr, ResType::SoxrHq)? else {
        unreachable!("another converter was asked for")
    };
    let Some((inputs, outputs)) = plan.repeats() else { return Ok(0) };
    let first = plan.output_len(frames).saturating_sub(count as u64);
    let needed = plan.input_range(first..first + count as u64).start.max(0) as u64;
    let periods = needed.min(frames) / inputs;
    let left_out = periods * inputs;
    // Lengths are rounded: one that came out otherwise would shift all.
    let shifted = |len: fn(&ResamplePlan, u64) -> u64| {
        len(&plan, frames) == len(&plan, frames - left_out) + periods * outputs
    };
    let same = shifted(ResamplePlan::output_len) && shifted(ResamplePlan::filtered_len);
    Ok(if same { left_out } else { 0 })
}

/// `y` has contiguous channels.
fn resample_hq<T: Real>(y: ArrayView2<T>, plan: &ResamplePlan) -> Array2<T> {
    let ((channels, n), span) = (y.dim(), plan.span());
    let mut out = Array2::zeros((channels, plan.filtered_len(n as u64) as usize));
    let rows = out.outer_iter_mut().zip(y.outer_iter()).flat_map(|(row, signal)| {
        let signal = signal.to_slice().expect("contiguous");
        let spans = row.into_slice().expect("made in C order").chunks_mut(span).enumerate();
        spans.map(move |(i, out)| (i * span, out, signal))
    });
    let spans: Vec<_> = rows.collect();
    spans.into_par_iter().for_each(|(first, out, signal)| {
        let range = first as u64..(first + out.len()) as u64;
        let needed = plan.input_range(range.clone());
        let start = needed.start.clamp(0, n as i64) as usize;
        let signal = &signal[start..(needed.end.max(0) as usize).clamp(start, n)];
        let single = || Cow::Owned(signal.iter().map(|v| v.wide() as f32).collect());
        let samples = T::as_f32(signal).map_or_else(single, Cow::Borrowed);
        let converted = plan.segment(1, range, &samples, start as u64);
        let converted = converted.expect("one channel is whole frames");
        out.iter_mut().zip(converted).for_each(|(slot, v)| *slot = T::of(f64::from(v)));
    });
    out
}
