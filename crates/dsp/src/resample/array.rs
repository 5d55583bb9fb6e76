//! Conversion of whole arrays.

use std::borrow::Cow;

use ndarray::{Array2, ArrayView2, ArrayViewMut2};
use rayon::prelude::*;

use super::check::check_rates;
use super::converter::Converter;
use super::sinc::{SincPlan, resample_sinc};
use super::{ResType, ResamplePlan};
use crate::error::{DspError, Result};
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
    let n = resampled_len(y.ncols(), orig_sr, target_sr, res_type, fix)?;
    let mut out = Array2::zeros((y.nrows(), n));
    resample_into(y, orig_sr, target_sr, res_type, scale, out.view_mut())?;
    Ok(out)
}

/// Samples that [`resample`] gives for `n`.
///
/// # Errors
/// Impossible rates.
pub fn resampled_len(
    n: usize,
    orig_sr: f64,
    target_sr: f64,
    res_type: ResType,
    fix: bool,
) -> Result<usize> {
    check_rates(orig_sr, target_sr)?;
    if orig_sr == target_sr {
        return Ok(n);
    }
    if fix {
        return Ok((n as f64 * (target_sr / orig_sr)).ceil() as usize);
    }
    Ok(match Converter::shared(orig_sr, target_sr, res_type)? {
        Converter::Soxr(plan) => plan.filtered_len(n as u64) as usize,
        Converter::Sinc(plan) => plan.filtered_len(n as u64) as usize,
    })
}

/// [`resample`] written into `out [channels, samples]`: what the filters give beyond its samples is left out, and
/// what they lack is zero.
///
/// # Errors
/// As [`resample`], or an array of other channels or not in C order.
pub fn resample_into<T: Lane>(
    y: ArrayView2<T>,
    orig_sr: f64,
    target_sr: f64,
    res_type: ResType,
    scale: bool,
    mut out: ArrayViewMut2<T>,
) -> Result<()> {
    check_rates(orig_sr, target_sr)?;
    let y = planar(y);
    if !all_finite(y.as_slice().expect("contiguous")) {
        require_finite("y", &y)?;
    }
    let (channels, width) = out.dim();
    if channels != y.nrows() || !out.is_standard_layout() {
        let expected = format!("{} channels in C order", y.nrows());
        return Err(DspError::Shape { name: "out", expected, actual: vec![channels, width] });
    }
    let n = y.ncols();
    let slots = out.as_slice_mut().expect("in C order");
    if slots.is_empty() || n == 0 {
        slots.fill(T::zero());
        return Ok(());
    }
    let samples = y.as_slice().expect("contiguous");
    if orig_sr == target_sr {
        let channels = samples.chunks_exact(n);
        let rows = beginnings(slots, width, n as u64);
        rows.zip(channels).for_each(|(row, y)| row.copy_from_slice(&y[..row.len()]));
        return Ok(());
    }
    match Converter::shared(orig_sr, target_sr, res_type)? {
        Converter::Soxr(plan) => {
            let rows = beginnings(slots, width, plan.filtered_len(n as u64));
            resample_hq(samples, n, &plan, rows);
        }
        Converter::Sinc(plan) => {
            let rows = beginnings(slots, width, plan.filtered_len(n as u64));
            if let Some(single) = T::as_f32(samples) {
                resample_sinc(single, n, &plan, rows.filter_map(T::as_f32_mut));
            } else {
                let fast = res_type == ResType::KaiserFast;
                let plan = SincPlan::<T>::new(orig_sr, target_sr, fast)?;
                resample_sinc(samples, n, &plan, rows);
            }
        }
    }
    if scale {
        let divisor = (target_sr / orig_sr).sqrt();
        out.mapv_inplace(|v| T::of(v.wide() / divisor));
    }
    Ok(())
}

/// The first `length` values, or all, of every row of `width` values; the rest becomes zero.
fn beginnings<T: Real>(
    rows: &mut [T],
    width: usize,
    length: u64,
) -> impl Iterator<Item = &mut [T]> {
    let length = (length as usize).min(width);
    rows.chunks_exact_mut(width).map(move |row| {
        let (first, rest) = row.split_at_mut(length);
        rest.fill(T::zero());
        first
    })
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

/// Channels of `n` samples one after another into `rows`.
fn resample_hq<'a, T: Lane>(
    y: &[T],
    n: usize,
    plan: &ResamplePlan,
    rows: impl Iterator<Item = &'a mut [T]>,
) {
    let span = plan.span();
    let spans = rows.zip(y.chunks_exact(n)).flat_map(|(row, signal)| {
        let spans = row.chunks_mut(span).enumerate();
        spans.map(move |(i, out)| (i * span, out, signal))
    });
    let spans: Vec<_> = spans.collect();
    spans.into_par_iter().for_each(|(first, out, signal)| {
        let range = first as u64..(first + out.len()) as u64;
        let needed = plan.input_range(range.clone());
        let start = needed.start.clamp(0, n as i64) as usize;
        let signal = &signal[start..(needed.end.max(0) as usize).clamp(start, n)];
        let single = || Cow::Owned(signal.iter().map(|v| v.wide() as f32).collect());
        let samples = T::as_f32(signal).map_or_else(single, Cow::Borrowed);
        if let Some(out) = T::as_f32_mut(out) {
            return plan.segment_into(1, range, &samples, start as u64, out);
        }
        let mut made = vec![0.0; out.len()];
        plan.segment_into(1, range, &samples, start as u64, &mut made);
        out.iter_mut().zip(made).for_each(|(slot, v)| *slot = T::of(f64::from(v)));
    });
}
