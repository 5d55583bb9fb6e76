//! Rows: one value of each slot.

use pulp::Simd;

use super::LaneFft;
use super::gather::{channel, turned};
use crate::real::Real;

/// Slots of a [`Row`].
pub const LANES: usize = 16;

/// One value of each slot, aligned to a cache line.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct Row(pub [f32; LANES]);

/// [`Row`] in double precision, of half as many slots.
#[derive(Debug, Clone, Copy, PartialEq)]
#[repr(C, align(64))]
pub struct DoubleRow(pub [f64; LANES / 2]);

impl Row {
    /// All slots zero.
    pub const ZERO: Self = Self([0.0; LANES]);
}

/// [`Row`] or [`DoubleRow`]: a cache line of values, and the operations on the registers in it.
/// Multiplications that a sum follows are fused where the machine can.
pub trait Lanes: Copy + Send + Sync + 'static {
    /// The value of a slot.
    type Value: Real;
    /// What a vector register holds of a row.
    type Register<S: Simd>: Copy;
    /// Slots of a row.
    const SLOTS: usize;
    /// All slots zero.
    const EMPTY: Self;

    /// The values of all slots.
    fn values(&self) -> &[Self::Value];
    /// As [`values`](Self::values), to write.
    fn values_mut(&mut self) -> &mut [Self::Value];
    /// Writes `window[n] * signal[slot * hop + n]` into `rows[n]` for every slot: successive frames
    /// of one channel.
    fn gather<T: Real>(signal: &[T], hop: usize, window: &[Self::Value], rows: &mut [Self]);
    /// [`LaneFft::power`]. Here, so that only this crate compiles it.
    fn power(plan: &LaneFft<Self>, frames: &mut [Self], power: &mut [Self]);
    /// [`LaneFft::complex`], likewise.
    fn complex(plan: &LaneFft<Self>, frames: &mut [Self], spectrum: &mut [Self]);
    /// Registers in a row.
    fn registers<S: Simd>() -> usize;
    /// Register `v` of the row.
    fn load<S: Simd>(&self, v: usize) -> Self::Register<S>;
    /// Replaces register `v` of the row.
    fn store<S: Simd>(&mut self, v: usize, value: Self::Register<S>);
    /// `x` in every slot.
    fn splat<S: Simd>(simd: S, x: Self::Value) -> Self::Register<S>;
    /// `a + b`.
    fn add<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// `a - b`.
    fn sub<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// `a * b`.
    fn mul<S: Simd>(simd: S, a: Self::Register<S>, b: Self::Register<S>) -> Self::Register<S>;
    /// `-a`.
    fn neg<S: Simd>(simd: S, a: Self::Register<S>) -> Self::Register<S>;
    /// `a * b + c`.
    fn mul_add_e<S: Simd>(
        simd: S,
        a: Self::Register<S>,
        b: Self::Register<S>,
        c: Self::Register<S>,
    ) -> Self::Register<S>;
    /// `c - a * b`.
    fn negate_mul_add_e<S: Simd>(
        simd: S,
        a: Self::Register<S>,
        b: Self::Register<S>,
        c: Self::Register<S>,
    ) -> Self::Register<S>;
}

macro_rules! lanes {
    ($row:ty, $value:ty, $slots:expr, $gather:ident, $register:ident, $width:ident, $as:ident, $as_mut:ident,
     $splat:ident, $add:ident, $sub:ident, $mul:ident, $neg:ident, $mul_add:ident, $negate:ident) => {
        impl Lanes for $row {
            type Value = $value;
            type Register<S: Simd> = S::$register;
            const SLOTS: usize = $slots;
            const EMPTY: Self = Self([0.0; $slots]);

            #[inline(always)]
            fn values(&self) -> &[$value] {
                &self.0
            }
            #[inline(always)]
            fn values_mut(&mut self) -> &mut [$value] {
                &mut self.0
            }
            fn gather<T: Real>(signal: &[T], hop: usize, window: &[$value], rows: &mut [Self]) {
                $gather(signal, hop, window, rows);
            }
            fn power(plan: &LaneFft<Self>, frames: &mut [Self], power: &mut [Self]) {
                plan.power_here(frames, power);
            }
            fn complex(plan: &LaneFft<Self>, frames: &mut [Self], spectrum: &mut [Self]) {
                plan.complex_here(frames, spectrum);
            }
            #[inline(always)]
            fn registers<S: Simd>() -> usize {
                $slots / S::$width
            }
            #[inline(always)]
            fn load<S: Simd>(&self, v: usize) -> S::$register {
                S::$as(&self.0).0[v]
            }
            #[inline(always)]
            fn store<S: Simd>(&mut self, v: usize, value: S::$register) {
                S::$as_mut(&mut self.0).0[v] = value;
            }
            #[inline(always)]
            fn splat<S: Simd>(simd: S, x: $value) -> S::$register {
                simd.$splat(x)
            }
            #[inline(always)]
            fn add<S: Simd>(simd: S, a: S::$register, b: S::$register) -> S::$register {
                simd.$add(a, b)
            }
            #[inline(always)]
            fn sub<S: Simd>(simd: S, a: S::$register, b: S::$register) -> S::$register {
                simd.$sub(a, b)
            }
            #[inline(always)]
            fn mul<S: Simd>(simd: S, a: S::$register, b: S::$register) -> S::$register {
                simd.$mul(a, b)
            }
            #[inline(always)]
            fn neg<S: Simd>(simd: S, a: S::$register) -> S::$register {
                simd.$neg(a)
            }
            #[inline(always)]
            fn mul_add_e<S: Simd>(
                simd: S,
                a: S::$register,
                b: S::$register,
                c: S::$register,
            ) -> S::$register {
                simd.$mul_add(a, b, c)
            }
            #[inline(always)]
            fn negate_mul_add_e<S: Simd>(
                simd: S,
                a: S::$register,
                b: S::$register,
                c: S::$register,
            ) -> S::$register {
                simd.$negate(a, b, c)
            }
        }
    };
}

#[rustfmt::skip]
lanes!(
    Row, f32, LANES, channel, f32s, F32_LANES, as_simd_f32s, as_mut_simd_f32s,
    splat_f32s, add_f32s, sub_f32s, mul_f32s, neg_f32s, mul_add_e_f32s, negate_mul_add_e_f32s
);
#[rustfmt::skip]
lanes!(
    DoubleRow, f64, LANES / 2, turned, f64s, F64_LANES, as_simd_f64s, as_mut_simd_f64s,
    splat_f64s, add_f64s, sub_f64s, mul_f64s, neg_f64s, mul_add_e_f64s, negate_mul_add_e_f64s
);
