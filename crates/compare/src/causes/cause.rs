//! What a likely cause is.

use serde::Serialize;

/// Kinds of causes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum CauseKind {
    /// Equal but for the rounding of single precision.
    Rounding,
    /// One side was stored with fewer digits.
    Precision,
    /// One side has the same value everywhere.
    Constant,
    /// The same values in another order of axes.
    Axes,
    /// The same channels in another order.
    ChannelOrder,
    /// One channel, or their mean, against all.
    ChannelCount,
    /// Frames are shifted, or there are more of them.
    Frames,
    /// Coefficients are shifted, rolled, or there are more of them.
    Coefficients,
    /// A constant added.
    Offset,
    /// A constant factor.
    Ratio,
    /// A constant factor and a constant added.
    Affine,
    /// A logarithm, a power or a root.
    Transform,
    /// Only frames at the ends differ.
    EdgeFrames,
    /// Only values at a lower limit differ.
    Floor,
    /// Only some coefficients differ.
    Bands,
    /// Only some channels differ.
    Channels,
    /// Single values differ by whole steps.
    Steps,
    /// HTK's mel scale against Slaney's.
    MelScale,
    /// Other recordings under the same names.
    Recordings,
    /// Other values in the configurations.
    Configuration,
}

/// A likely cause.
#[derive(Debug, Clone, Serialize)]
pub struct Cause {
    /// Its kind.
    pub kind: CauseKind,
    /// What probably happened.
    pub cause: String,
    /// What in the values says so.
    pub evidence: String,
}

impl Cause {
    pub(super) fn new(
        kind: CauseKind,
        cause: impl Into<String>,
        evidence: impl Into<String>,
    ) -> Self {
        Self { kind, cause: cause.into(), evidence: evidence.into() }
    }
}
