//! Vectors of `f32` or `f64` lanes in generic code.

use pulp::{Simd, bytemuck::Pod};

use crate::real::Real;

/// A sample type with a vector form on every instruction set that [`pulp::Arch`] selects at run
/// time.
pub trait Lane: Real + Pod {
    /// One register of this type.
    type V<S: Simd>: Copy + Pod;
    /// Lanes of a register.
    fn lanes<S: Simd>() -> usize {
        size_of::<Self::V<S>>() / size_of::<Self>()
    }
    /// The first lanes of `from`, zero beyond its end.
    fn load<S: Simd>(simd: S, from: &[Self]) -> Self::V<S>;
    /// Writes the first `to.len()` lanes.
    fn store<S: Simd>(simd: S, to: &mut [Self], v: Self::V<S>);
    /// The same value in every lane.
    fn splat<S: Simd>(simd: S, value: Self) -> Self::V<S>;
    /// `a * b + c`, with one rounding where that is faster.
    fn multiply_add<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>, c: Self::V<S>) -> Self::V<S>;
    /// `a * b + c` with one rounding, on every machine.
    fn fused<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>, c: Self::V<S>) -> Self::V<S>;
    /// Smaller value per lane.
    fn lower<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>) -> Self::V<S>;
    /// Larger value per lane.
    fn higher<S: Simd>(simd: S, a: Self::V<S>, b: Self::V<S>) -> Self::V<S>;
    /// `x` where `a < b`, else `y`.
    fn select_lt<S: Simd>(
        simd: S,
        a: Self::V<S>,
        b: Self::V<S>,
        x: Self::V<S>,
        y: Self::V<S>,
    ) -> Self::V<S>;
}

macro_rules! lane {
    ($t:ident, $v:ident, $view:ident, $view_mut:ident, $load:ident, $store:ident, $splat:ident, $mul_add:ident, $fused:ident, $min:ident, $max:ident, $less:ident, $select:ident) => {
        impl Lane for $t {
            type V<S: Simd> = S::$v;
            #[inline(always)]
            fn load<S: Simd>(simd: S, from: &[Self]) -> S::$v {
                match S::$view(from).0.first() {
                    Some(v) => *v,
                    None => simd.$load(from),
                }
            }
            #[inline(always)]
            fn store<S: Simd>(simd: S, to: &mut [Self], v: S::$v) {
                match S::$view_mut(to) {
                    ([first, ..], _) => *first = v,
                    (_, rest) => simd.$store(rest, v),
                }
            }
            #[inline(always)]
            fn splat<S: Simd>(simd: S, value: Self) -> S::$v {
                simd.$splat(value)
            }
            #[inline(always)]
            fn multiply_add<S: Simd>(simd: S, a: S::$v, b: S::$v, c: S::$v) -> S::$v {
                simd.$mul_add(a, b, c)
            }
            #[inline(always)]
            fn fused<S: Simd>(simd: S, a: S::$v, b: S::$v, c: S::$v) -> S::$v {
                simd.$fused(a, b, c)
            }
            #[inline(always)]
            fn lower<S: Simd>(simd: S, a: S::$v, b: S::$v) -> S::$v {
                simd.$min(a, b)
            }
            #[inline(always)]
            fn higher<S: Simd>(simd: S, a: S::$v, b: S::$v) -> S::$v {
                simd.$max(a, b)
            }
            #[inline(always)]
            fn select_lt<S: Simd>(simd: S, a: S::$v, b: S::$v, x: S::$v, y: S::$v) -> S::$v {
                simd.$select(simd.$less(a, b), x, y)
            }
        }
    };
}

lane!(
    f32,
    f32s,
    as_simd_f32s,
    as_mut_simd_f32s,
    partial_load_f32s,
    partial_store_f32s,
    splat_f32s,
    mul_add_e_f32s,
    mul_add_f32s,
    min_f32s,
    max_f32s,
    less_than_f32s,
    select_f32s
);
lane!(
    f64,
    f64s,
    as_simd_f64s,
    as_mut_simd_f64s,
    partial_load_f64s,
    partial_store_f64s,
    splat_f64s,
    mul_add_e_f64s,
    mul_add_f64s,
    min_f64s,
    max_f64s,
    less_than_f64s,
    select_f64s
);
