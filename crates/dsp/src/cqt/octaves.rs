//! The octaves of a constant-Q transform before their filters are made, and how much work they may be.

use std::ops::Range;

use super::CqtParams;
use super::basis::{Basis, Wavelets};
use crate::error::{DspError, Result};
use crate::resample::ResType;

/// Most work for each sample of the signal, in numbers that a frame touches. The default bins take
/// 200, and 100,000 with a hop of 1.
const MOST_WORK: f64 = (1 << 17) as f64;
/// Most values of all filters before the small ones are left out.
const MOST_VALUES: usize = 1 << 26;

/// One octave.
pub(super) struct Layout {
    /// Its bins in the result.
    pub bins: Range<usize>,
    /// Rate at which it works.
    pub sr: f64,
    /// Samples at that rate from one frame to the next.
    pub hop: usize,
    /// Whether the next octave works at half the rate.
    pub halve: bool,
    /// Length of its transform.
    pub n_fft: usize,
    /// Whether the filters of the octave above serve it.
    pub as_above: bool,
}

/// Share of the Nyquist frequency that octaves may fill; librosa up to 0.9 took the pass band of its
/// converter.
pub(super) fn pass_band(res_type: ResType) -> f64 {
    match res_type {
        ResType::SoxrHq => 1.0,
        ResType::KaiserBest | ResType::KaiserFast => 0.85,
    }
}

/// Halvings of the rate that the highest filter and the hop allow before the first octave.
pub(super) fn early_halvings(nyquist: f64, cutoff: f64, hop: usize, n_octaves: usize) -> u32 {
    let by_rate = ((nyquist / cutoff).log2().ceil() - 2.0).max(0.0) as u32;
    let by_hop = (hop.trailing_zeros() + 1).saturating_sub(n_octaves as u32);
    by_rate.min(by_hop)
}

/// The octaves from the highest down, the first of them at a rate of `base` and with that hop.
///
/// # Errors
/// More work than can be done in sensible time, as far as the transforms alone tell: filters take
/// seconds to make. More values of filters than memory should hold.
pub(super) fn layouts(
    p: &CqtParams,
    wavelets: &Wavelets,
    (base, hop): (f64, usize),
) -> Result<Vec<Layout>> {
    let (mut sr, mut hop, mut end) = (base, hop, p.n_bins);
    let (mut values, mut work) = (0_usize, 0.0);
    let mut layouts: Vec<Layout> = Vec::new();
    while end > 0 {
        let bins = end.saturating_sub(p.bins_per_octave)..end;
        end = bins.start;
        let above = layouts.last().filter(|above| same_lengths(wavelets, &bins, sr, above, base));
        let as_above = above.is_some();
        let n_fft = match above {
            Some(above) => above.n_fft,
            None => Basis::transform_length(wavelets, bins.clone(), sr, p)?,
        };
        work += n_fft as f64 * (sr / p.sr / hop as f64);
        require_work(work, p)?;
        if !as_above {
            values = values.saturating_add(bins.len().saturating_mul(n_fft));
        }
        if values > MOST_VALUES {
            let allowed =
                format!("so few that their filters have at most {MOST_VALUES} values together");
            return Err(DspError::parameter("n_bins", p.n_bins, allowed));
        }
        let halve = hop % 2 == 0;
        layouts.push(Layout { bins, sr, hop, halve, n_fft, as_above });
        if halve {
            hop /= 2;
            sr /= 2.0;
        }
    }
    Ok(layouts)
}

/// Refuses more than [`MOST_WORK`].
pub(super) fn require_work(work: f64, p: &CqtParams) -> Result<()> {
    if work <= MOST_WORK {
        return Ok(());
    }
    let allowed = format!(
        "larger or divisible by a higher power of two (or use fewer bins: n_bins = {} with \
         bins_per_octave = {} takes more than {MOST_WORK} steps per sample)",
        p.n_bins, p.bins_per_octave
    );
    Err(DspError::parameter("hop_length", p.hop_length, allowed))
}

/// Whether the filters `bins` at `sr` have the lengths of the octave above, so that its basis serves
/// them: frequencies and rate have both halved.
fn same_lengths(
    wavelets: &Wavelets,
    bins: &Range<usize>,
    sr: f64,
    above: &Layout,
    base: f64,
) -> bool {
    above.halve
        && above.bins.len() == bins.len()
        && !bins.is_empty()
        && base > sr
        && bins.clone().zip(above.bins.clone()).all(|(k, above)| {
            let length = wavelets.length(above, 2.0 * sr);
            (wavelets.length(k, sr) - length).abs() <= 1e-9 * length
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Filters of the first took 40 seconds to make; what they and the transforms take is known before.
    #[test]
    fn too_much_work_is_refused_before_any_filter_is_made() {
        for (n_bins, bins_per_octave, named) in [(4000, 600, "n_bins"), (672, 96, "hop_length")] {
            let p = CqtParams { hop_length: 1, n_bins, bins_per_octave, ..CqtParams::new(22050.0) };
            let refused = layouts(&p, &Wavelets::new(&p), (p.sr, 1)).err().map(|e| e.to_string());
            assert!(refused.as_ref().is_some_and(|e| e.contains(named)), "{refused:?}");
        }
        let usual = CqtParams::new(22050.0);
        let octaves = layouts(&usual, &Wavelets::new(&usual), (usual.sr, usual.hop_length));
        assert_eq!(octaves.map(|octaves| octaves.len()).ok(), Some(7));
    }
}
