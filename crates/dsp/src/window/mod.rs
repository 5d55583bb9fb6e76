//! Window functions with scipy's names and definitions (`scipy.signal.get_window`).

mod points;
mod shapes;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::error::{DspError, Result};

pub use points::{MAX_LENGTH, get_window, padded_window};
pub use shapes::bessel_i0;

/// A window function, by scipy's name and with scipy's parameters.
#[derive(Debug, Clone, PartialEq, Default)]
#[non_exhaustive]
pub enum Window {
    /// 0.5 - 0.5 cos
    #[default]
    Hann,
    /// 0.54 - 0.46 cos
    Hamming,
    /// Three-term Blackman.
    Blackman,
    /// Four-term minimum Blackman-Harris.
    BlackmanHarris,
    /// Four-term Nuttall.
    Nuttall,
    /// Five-term flat top.
    FlatTop,
    /// Triangle with zero end points.
    Bartlett,
    /// Triangle with non-zero end points.
    Triang,
    /// Half a sine.
    Cosine,
    /// All ones.
    Boxcar,
    /// Piecewise cubic.
    Parzen,
    /// Bohman.
    Bohman,
    /// Bartlett-Hann.
    BartHann,
    /// The main lobe of a sinc.
    Lanczos,
    /// Kaiser window with its shape parameter beta.
    Kaiser(f64),
    /// Kaiser-Bessel derived window, symmetric and of even length only.
    KaiserBesselDerived(f64),
    /// Tapered cosine: the fraction of the window inside the tapers.
    Tukey(f64),
    /// Gaussian with its standard deviation in samples.
    Gaussian(f64),
    /// Generalised Gaussian: shape and standard deviation in samples.
    GeneralGaussian(f64, f64),
    /// `alpha - (1 - alpha) cos`
    GeneralHamming(f64),
    /// Weighted sum of cosines.
    GeneralCosine(Arc<[f64]>),
    /// Exponential: centre in samples (`None`: the middle) and decay in samples.
    Exponential(Option<f64>, f64),
    /// Dolph-Chebyshev with its attenuation in dB.
    Chebyshev(f64),
    /// Taylor: nearly constant side lobes, their level in dB, and whether the middle is 1.
    Taylor(usize, f64, bool),
    /// First discrete prolate spheroidal sequence with its half bandwidth.
    Dpss(f64),
    /// These values, whatever they are.
    Samples(Arc<[f64]>),
}

const NAMES: &str = "hann, hamming, blackman, blackmanharris, nuttall, flattop, bartlett, triang, \
    cosine, boxcar, parzen, bohman, barthann, lanczos, tukey, exponential, taylor, kaiser:BETA, \
    kaiser_bessel_derived:BETA, gaussian:STD, general_gaussian:P,SIG, general_hamming:ALPHA, \
    general_cosine:A0,A1,..., chebwin:DB, dpss:NW or another of scipy's names";

impl FromStr for Window {
    type Err = DspError;

    /// A name, with its parameters after a colon, such as `kaiser:8.6` or `general_gaussian:1.5,7`.
    fn from_str(text: &str) -> Result<Self> {
        let (name, parameters) = text.split_once(':').unwrap_or((text, ""));
        let number = |word: &str| match word {
            "none" => Some(f64::NAN),
            word => word.parse().ok().filter(|x| f64::is_finite(*x)),
        };
        let words = parameters.split(',').filter(|word| !word.is_empty());
        let values: Option<Vec<f64>> = words.map(number).collect();
        values
            .and_then(|values| Self::named(name, &values))
            .filter(Self::is_possible)
            .ok_or_else(|| DspError::parameter("window", text, format!("one of {NAMES}")))
    }
}

impl Window {
    fn named(name: &str, values: &[f64]) -> Option<Self> {
        Some(match (name, values) {
            ("hann" | "hanning" | "han", []) => Self::Hann,
            ("hamming" | "hamm" | "ham", []) => Self::Hamming,
            ("blackman" | "black" | "blk", []) => Self::Blackman,
            ("blackmanharris" | "blackharr" | "bkh", []) => Self::BlackmanHarris,
            ("nuttall" | "nutl" | "nut", []) => Self::Nuttall,
            ("flattop" | "flat" | "flt", []) => Self::FlatTop,
            ("bartlett" | "bart" | "brt", []) => Self::Bartlett,
            ("triang" | "triangle" | "tri", []) => Self::Triang,
            ("cosine" | "halfcosine", []) => Self::Cosine,
            ("boxcar" | "box" | "ones" | "rectangular" | "rect", []) => Self::Boxcar,
            ("parzen" | "parz" | "par", []) => Self::Parzen,
            ("bohman" | "bman" | "bmn", []) => Self::Bohman,
            ("barthann" | "brthan" | "bth", []) => Self::BartHann,
            ("lanczos" | "sinc", []) => Self::Lanczos,
            ("kaiser" | "ksr", &[beta]) => Self::Kaiser(beta),
            ("kaiser_bessel_derived" | "kaiser bessel derived" | "kbd", &[beta]) => {
                Self::KaiserBesselDerived(beta)
            }
            ("tukey" | "tuk", []) => Self::Tukey(0.5),
            ("tukey" | "tuk", &[alpha]) => Self::Tukey(alpha),
            ("gaussian" | "gauss" | "gss", &[std]) => Self::Gaussian(std),
            (
                "general_gaussian" | "general gaussian" | "general_gauss" | "general gauss" | "ggs",
                &[p, sig],
            ) => Self::GeneralGaussian(p, sig),
            ("general_hamming" | "general hamming", &[alpha]) => Self::GeneralHamming(alpha),
            ("general_cosine" | "general cosine", terms @ [_, ..]) => {
                Self::GeneralCosine(terms.into())
            }
            ("exponential" | "poisson", []) => Self::Exponential(None, 1.0),
            ("exponential" | "poisson", &[center]) => {
                Self::Exponential(Some(center).filter(|c| !c.is_nan()), 1.0)
            }
            ("exponential" | "poisson", &[center, tau]) => {
                Self::Exponential(Some(center).filter(|c| !c.is_nan()), tau)
            }
            ("chebwin" | "cheb", &[db]) => Self::Chebyshev(db),
            ("taylor" | "taylorwin", rest @ ([] | [_] | [_, _] | [_, _, _])) => {
                let value = |i: usize, default| rest.get(i).copied().unwrap_or(default);
                Self::Taylor(value(0, 4.0) as usize, value(1, 30.0), value(2, 1.0) != 0.0)
            }
            ("dpss", &[nw]) => Self::Dpss(nw),
            _ => return None,
        })
    }

    /// Whether the parameters lie where the window is defined.
    fn is_possible(&self) -> bool {
        let positive = |x: f64| x > 0.0;
        match *self {
            Self::Kaiser(beta) | Self::KaiserBesselDerived(beta) => (0.0..=700.0).contains(&beta),
            Self::Tukey(alpha) | Self::GeneralHamming(alpha) => alpha.is_finite(),
            Self::Gaussian(std) => positive(std),
            Self::GeneralGaussian(p, sig) => positive(p) && positive(sig),
            Self::GeneralCosine(ref terms) => terms.iter().all(|a| a.is_finite()),
            Self::Exponential(_, tau) => positive(tau),
            Self::Chebyshev(db) => (1.0..=300.0).contains(&db.abs()),
            Self::Taylor(nbar, sll, _) => (1..=1000).contains(&nbar) && (1.0..300.0).contains(&sll),
            Self::Dpss(nw) => positive(nw),
            _ => true,
        }
    }
}

impl fmt::Display for Window {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::Hann => "hann",
            Self::Hamming => "hamming",
            Self::Blackman => "blackman",
            Self::BlackmanHarris => "blackmanharris",
            Self::Nuttall => "nuttall",
            Self::FlatTop => "flattop",
            Self::Bartlett => "bartlett",
            Self::Triang => "triang",
            Self::Cosine => "cosine",
            Self::Boxcar => "boxcar",
            Self::Parzen => "parzen",
            Self::Bohman => "bohman",
            Self::BartHann => "barthann",
            Self::Lanczos => "lanczos",
            Self::Kaiser(beta) => return write!(f, "kaiser:{beta}"),
            Self::KaiserBesselDerived(beta) => return write!(f, "kaiser_bessel_derived:{beta}"),
            Self::Tukey(alpha) => return write!(f, "tukey:{alpha}"),
            Self::Gaussian(std) => return write!(f, "gaussian:{std}"),
            Self::GeneralGaussian(p, sig) => return write!(f, "general_gaussian:{p},{sig}"),
            Self::GeneralHamming(alpha) => return write!(f, "general_hamming:{alpha}"),
            Self::GeneralCosine(terms) => {
                let terms: Vec<String> = terms.iter().map(f64::to_string).collect();
                return write!(f, "general_cosine:{}", terms.join(","));
            }
            Self::Exponential(None, tau) => return write!(f, "exponential:none,{tau}"),
            Self::Exponential(Some(center), tau) => return write!(f, "exponential:{center},{tau}"),
            Self::Chebyshev(db) => return write!(f, "chebwin:{db}"),
            Self::Taylor(nbar, sll, norm) => {
                return write!(f, "taylor:{nbar},{sll},{}", u8::from(*norm));
            }
            Self::Dpss(nw) => return write!(f, "dpss:{nw}"),
            Self::Samples(values) => return write!(f, "{} values", values.len()),
        };
        f.write_str(name)
    }
}

impl Serialize for Window {
    fn serialize<S: serde::Serializer>(&self, s: S) -> std::result::Result<S::Ok, S::Error> {
        if let Self::Samples(_) = self {
            return Err(serde::ser::Error::custom("a window given as values has no name"));
        }
        s.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Window {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> std::result::Result<Self, D::Error> {
        let name = std::borrow::Cow::<str>::deserialize(d)?;
        name.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for name in [
            "hann",
            "hamming",
            "nuttall",
            "kaiser:8.6",
            "tukey:0.25",
            "general_gaussian:1.5,7",
            "general_cosine:0.5,0.3,0.2",
            "exponential:none,3",
            "exponential:4,3",
            "taylor:4,30,1",
            "chebwin:100",
            "dpss:2.5",
        ] {
            assert_eq!(name.parse::<Window>().unwrap().to_string(), name);
        }
        for bad in ["hanny", "kaiser", "kaiser:-1", "kaiser:nan", "hann:1", "gaussian:0", "dpss:x"]
        {
            assert!(bad.parse::<Window>().is_err(), "{bad}");
        }
    }
}
