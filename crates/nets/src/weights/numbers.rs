//! Numbers and how they are stored.

/// Names, shapes and numbers of a network or a part of one.
pub type State = Vec<(String, Vec<usize>, Vec<f32>)>;

/// Largest file of weights read.
pub const MAX_FILE: u64 = 8 << 30;

/// Little-endian numbers of PyTorch's types in single precision.
pub(super) fn numbers(kind: Kind, bytes: &[u8]) -> Vec<f32> {
    match kind {
        Kind::F16 => each(bytes, |b| half::f16::from_le_bytes(b).to_f32()),
        Kind::Bf16 => each(bytes, |b| half::bf16::from_le_bytes(b).to_f32()),
        Kind::F32 => each(bytes, f32::from_le_bytes),
        Kind::F64 => each(bytes, |b| f64::from_le_bytes(b) as f32),
        Kind::I64 => each(bytes, |b| i64::from_le_bytes(b) as f32),
        Kind::I32 => each(bytes, |b| i32::from_le_bytes(b) as f32),
    }
}

fn each<const N: usize>(bytes: &[u8], number: impl Fn([u8; N]) -> f32) -> Vec<f32> {
    bytes.as_chunks::<N>().0.iter().map(|b| number(*b)).collect()
}

/// Types of numbers that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Kind {
    F16,
    Bf16,
    F32,
    F64,
    I64,
    I32,
}

impl Kind {
    /// Bytes of a number.
    pub(super) fn size(self) -> usize {
        match self {
            Self::F16 | Self::Bf16 => 2,
            Self::F32 | Self::I32 => 4,
            Self::F64 | Self::I64 => 8,
        }
    }
}
