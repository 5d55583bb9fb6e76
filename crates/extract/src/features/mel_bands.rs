//! What mel features share: the filter bank on rows, decibels, and the clamp below the maximum.

use corsmal_dsp::DspError;
use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::lanes::{Row, power_to_decibel};
use corsmal_dsp::mel::{MelParams, SparseBank, empty_filters, mel_filter};
use ndarray::Array2;

use super::kernel::{Finish, SpectrumKernel};
use crate::params::{DbSpec, Scale, at_most};

/// Values to a unit, before any clamp; `db` is for powers.
pub fn power_rows_to_scale(scale: Scale, db: &Decibel, rows: &mut [Row]) {
    let (amin, offset) = (db.amin, db.offset());
    match scale {
        Scale::Linear => {}
        Scale::PowerToDb => {
            power_to_decibel(rows, amin as f32, offset as f32);
        }
        Scale::AmplitudeToDb => {
            for x in rows.iter_mut().flat_map(|row| &mut row.0) {
                *x *= *x;
            }
            power_to_decibel(rows, amin as f32, offset as f32);
        }
    }
}

/// `bank @ spectrum`, then a unit.
pub struct MelKernel {
    bank: SparseBank,
    scale: Scale,
    db: Decibel,
    empty: Option<String>,
}

/// More bands than any use has; bounds the memory of filter bank and cosine transform.
const MAX_MELS: usize = 4096;

/// Most values of a filter bank, which is made with its zeros (256 MiB).
const MAX_VALUES: usize = 1 << 26;

/// Refuses filter banks larger than that.
pub fn check_bank(params: &MelParams) -> corsmal_dsp::Result<()> {
    at_most("n_mels", params.n_mels, MAX_MELS)?;
    let bins = params.n_fft / 2 + 1;
    if bins.saturating_mul(params.n_mels) > MAX_VALUES {
        let allowed = format!("at most {} with n_fft = {}", MAX_VALUES / bins, params.n_fft);
        return Err(DspError::parameter("n_mels", params.n_mels, allowed));
    }
    Ok(())
}

impl MelKernel {
    /// The kernel for a filter bank.
    pub fn new(params: &MelParams, scale: Scale, db: Decibel) -> corsmal_dsp::Result<Self> {
        check_bank(params)?;
        let bank = mel_filter(params)?;
        Ok(Self { bank: SparseBank::new(&bank), scale, db, empty: empty(&bank) })
    }
}

impl SpectrumKernel for MelKernel {
    fn rows(&self, spectrum: &[Row], out: &mut [Row]) {
        self.bank.apply_rows(spectrum, out);
        power_rows_to_scale(self.scale, &self.db, out);
    }

    fn warning(&self) -> Option<String> {
        self.empty.clone()
    }
}

/// That filters pass nothing, as librosa warns.
pub fn empty(bank: &Array2<f32>) -> Option<String> {
    let empty = empty_filters(bank);
    let (first, last) = (empty.first()?, empty.last()?);
    Some(format!(
        "{} of {} mel filters are empty (between {first} and {last}): use fewer n_mels or a longer n_fft",
        empty.len(),
        bank.nrows()
    ))
}

/// The reference of `"max"` and the `top_db` clamp.
pub struct DecibelFinish {
    db: DbSpec,
    rows: usize,
}

impl DecibelFinish {
    /// The finish, where this scale and these parameters need the maximum of the recording.
    pub fn of(scale: Scale, db: &DbSpec, rows: usize) -> Option<Box<dyn Finish>> {
        let needed = scale != Scale::Linear && db.needs_peak();
        needed.then(|| Box::new(Self { db: *db, rows }) as Box<dyn Finish>)
    }
}

impl Finish for DecibelFinish {
    fn peaks(&self) -> Vec<(std::ops::Range<usize>, bool)> {
        vec![(0..self.rows, self.db.joint)]
    }

    fn without_peaks(&self) -> Option<&'static str> {
        Some(DbSpec::WITHOUT_PEAK)
    }

    fn frame(&self, raw: &[f32], peaks: &[f32], channels: usize, out: &mut [f32]) {
        corsmal_dsp::simd::vectorized(
            #[inline(always)]
            || clamp(&self.db, raw, peaks, channels, out),
        );
    }
}

/// `max(x, peak - top_db)`, less the peak where that is the reference.
#[inline(always)]
pub fn clamp(db: &DbSpec, raw: &[f32], peaks: &[f32], channels: usize, out: &mut [f32]) {
    if let Ok(peaks) = <&[f32; 8]>::try_from(peaks) {
        let levels = peaks.map(|p| db.level(p));
        let (raw, out) = (raw.as_chunks::<8>().0, out.as_chunks_mut::<8>().0);
        for (raw, out) in raw.iter().zip(out) {
            for c in 0..8 {
                let floored = if raw[c] > levels[c].1 { raw[c] } else { levels[c].1 };
                out[c] = floored - levels[c].0;
            }
        }
        return;
    }
    for (c, peak) in peaks.iter().enumerate() {
        let (shift, floor) = db.level(*peak);
        let raw = raw[c..].iter().step_by(channels);
        for (x, out) in raw.zip(out[c..].iter_mut().step_by(channels)) {
            *out = x.max(floor) - shift;
        }
    }
}
