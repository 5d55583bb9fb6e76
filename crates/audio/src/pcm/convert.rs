//! Stored samples to `f32`, a block at a time. Every loop is branch-free over fixed-size chunks so
//! that the compiler vectorises it.

use super::companding::{ALAW, MULAW};
use super::format::{Encoding, Endian};

/// Converts `bytes` into `out`; both hold the same number of samples.
pub(crate) fn convert(encoding: Encoding, endian: Endian, bytes: &[u8], out: &mut [f32]) {
    debug_assert_eq!(bytes.len(), out.len() * usize::from(encoding.bytes()));
    let big = endian == Endian::Big;
    match encoding {
        Encoding::U8 => each(bytes, out, |[b]| (f32::from(b) - 128.0) * (1.0 / 128.0)),
        Encoding::ALaw => each(bytes, out, |[b]| ALAW[usize::from(b)]),
        Encoding::MuLaw => each(bytes, out, |[b]| MULAW[usize::from(b)]),
        Encoding::Int(1) => each(bytes, out, |b| f32::from(i8::from_le_bytes(b)) * (1.0 / 128.0)),
        Encoding::Int(2) if big => each(bytes, out, |b| int16(i16::from_be_bytes(b))),
        Encoding::Int(2) => each(bytes, out, |b| int16(i16::from_le_bytes(b))),
        Encoding::Int(3) if big => {
            each(bytes, out, |[a, b, c]| int32(i32::from_be_bytes([a, b, c, 0])));
        }
        Encoding::Int(3) => {
            each(bytes, out, |[a, b, c]| int32(i32::from_le_bytes([0, a, b, c])));
        }
        Encoding::Int(4) if big => each(bytes, out, |b| int32(i32::from_be_bytes(b))),
        Encoding::Int(4) => each(bytes, out, |b| int32(i32::from_le_bytes(b))),
        Encoding::Int(n) => wide(usize::from(n), big, bytes, out),
        Encoding::F32 if big => each(bytes, out, f32::from_be_bytes),
        Encoding::F32 => each(bytes, out, f32::from_le_bytes),
        Encoding::F64 if big => each(bytes, out, |b| f64::from_be_bytes(b) as f32),
        Encoding::F64 => each(bytes, out, |b| f64::from_le_bytes(b) as f32),
        // Blocks are decoded by `adpcm`.
        Encoding::Adpcm(_) => out.fill(0.0),
    }
}

fn each<const N: usize>(bytes: &[u8], out: &mut [f32], f: impl Fn([u8; N]) -> f32) {
    let (samples, _) = bytes.as_chunks::<N>();
    for (y, &b) in out.iter_mut().zip(samples) {
        *y = f(b);
    }
}

fn int16(v: i16) -> f32 {
    f32::from(v) * (1.0 / 32768.0)
}

/// `v` is left-justified, whatever the number of significant bits.
fn int32(v: i32) -> f32 {
    v as f32 * (1.0 / 2_147_483_648.0)
}

/// Integers of 5 to 8 bytes: rare, so one loop for all of them.
fn wide(width: usize, big: bool, bytes: &[u8], out: &mut [f32]) {
    for (y, b) in out.iter_mut().zip(bytes.chunks_exact(width)) {
        let mut full = [0; 8];
        if big {
            full[..width].copy_from_slice(b);
        } else {
            for (to, from) in full.iter_mut().zip(b.iter().rev()) {
                *to = *from;
            }
        }
        *y = i64::from_be_bytes(full) as f32 * (1.0 / 9_223_372_036_854_775_808.0);
    }
}
