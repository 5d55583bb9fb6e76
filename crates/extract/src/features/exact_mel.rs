//! Mel bands of exact magnitudes, for features that see differences or levels of nearly empty bands,
//! where a transform in single precision would show its rounding.

use corsmal_dsp::decibel::Decibel;
use corsmal_dsp::mel::{MelParams, SparseBank, mel_filter};

use super::kernel::{SlotFn, SlotKernel};
use super::mel_bands::{check_bank, empty};
use super::melspectrogram::quantity_of;

/// `bank @ magnitude^power`, times a factor or in decibels without a clamp.
pub struct ExactMel {
    bank: SparseBank,
    squared: bool,
    unit: Unit,
    empty: Option<String>,
}

/// Unit of the bands.
#[derive(Clone, Copy)]
pub enum Unit {
    /// Times this.
    Factor(f64),
    /// Decibels.
    Decibel(Decibel),
}

impl ExactMel {
    /// The kernel for a filter bank; `power` is 1 or 2.
    pub fn new(params: &MelParams, power: f64, unit: Unit) -> corsmal_dsp::Result<Self> {
        check_bank(params)?;
        quantity_of(power)?;
        let bank = mel_filter(params)?;
        let empty = empty(&bank);
        Ok(Self { bank: SparseBank::new(&bank), squared: power == 2.0, unit, empty })
    }
}

impl SlotKernel for ExactMel {
    fn worker(&self) -> SlotFn<'_> {
        let mut powers = vec![0.0_f32; self.bank.bins()];
        Box::new(move |magnitude, out| {
            for (power, x) in powers.iter_mut().zip(magnitude) {
                *power = if self.squared { x * x } else { *x };
            }
            for ((first, weights), out) in self.bank.bands().iter().zip(out) {
                let products = weights.iter().zip(&powers[*first..]);
                let sum: f64 = products.map(|(w, x)| f64::from(*w) * f64::from(*x)).sum();
                *out = match self.unit {
                    Unit::Factor(factor) => sum * factor,
                    Unit::Decibel(db) => 10.0 * sum.max(db.amin).log10() - db.offset(),
                };
            }
        })
    }

    fn warning(&self) -> Option<String> {
        self.empty.clone()
    }
}
