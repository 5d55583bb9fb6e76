//! Complex values of one register, and the small transforms over them.

use pulp::Simd;

use super::Lanes;
use crate::real::Real;

/// A complex value of one register.
#[derive(Clone, Copy)]
pub(super) struct C<V> {
    pub re: V,
    pub im: V,
}

/// Real and imaginary rows of a complex value.
pub(super) type Pair<R> = [R; 2];

#[inline(always)]
pub(super) fn load<R: Lanes, S: Simd>(pair: &Pair<R>, v: usize) -> C<R::Register<S>> {
    C { re: pair[0].load::<S>(v), im: pair[1].load::<S>(v) }
}

#[inline(always)]
pub(super) fn store<R: Lanes, S: Simd>(pair: &mut Pair<R>, v: usize, x: C<R::Register<S>>) {
    pair[0].store::<S>(v, x.re);
    pair[1].store::<S>(v, x.im);
}

#[inline(always)]
pub(super) fn add<R: Lanes, S: Simd>(
    simd: S,
    a: C<R::Register<S>>,
    b: C<R::Register<S>>,
) -> C<R::Register<S>> {
    C { re: R::add(simd, a.re, b.re), im: R::add(simd, a.im, b.im) }
}

#[inline(always)]
pub(super) fn sub<R: Lanes, S: Simd>(
    simd: S,
    a: C<R::Register<S>>,
    b: C<R::Register<S>>,
) -> C<R::Register<S>> {
    C { re: R::sub(simd, a.re, b.re), im: R::sub(simd, a.im, b.im) }
}

/// `a * (re + i im)`.
#[inline(always)]
pub(super) fn mul<R: Lanes, S: Simd>(
    simd: S,
    a: C<R::Register<S>>,
    [re, im]: [R::Value; 2],
) -> C<R::Register<S>> {
    let (wr, wi) = (R::splat(simd, re), R::splat(simd, im));
    C {
        re: R::negate_mul_add_e(simd, a.im, wi, R::mul(simd, a.re, wr)),
        im: R::mul_add_e(simd, a.re, wi, R::mul(simd, a.im, wr)),
    }
}

/// The transform of `N` points, written out: arrays filled in a loop would go through memory.
pub(super) trait Dft<const N: usize> {
    /// `[f(0), f(1), ...]`.
    fn list<T>(f: impl FnMut(usize) -> T) -> [T; N];

    /// `X[k] = sum of x[n] exp(-2 pi i k n / N)`.
    fn of<R: Lanes, S: Simd>(simd: S, x: [C<R::Register<S>>; N]) -> [C<R::Register<S>>; N];
}

/// Holder of the transforms.
pub(super) struct Points;

impl Dft<4> for Points {
    #[inline(always)]
    fn list<T>(mut f: impl FnMut(usize) -> T) -> [T; 4] {
        [f(0), f(1), f(2), f(3)]
    }

    #[inline(always)]
    fn of<R: Lanes, S: Simd>(simd: S, x: [C<R::Register<S>>; 4]) -> [C<R::Register<S>>; 4] {
        let (even, odd) = (add::<R, S>(simd, x[0], x[2]), sub::<R, S>(simd, x[0], x[2]));
        let (cross, turned) = (add::<R, S>(simd, x[1], x[3]), sub::<R, S>(simd, x[1], x[3]));
        // `turned` counts times -i.
        [
            add::<R, S>(simd, even, cross),
            C { re: R::add(simd, odd.re, turned.im), im: R::sub(simd, odd.im, turned.re) },
            sub::<R, S>(simd, even, cross),
            C { re: R::sub(simd, odd.re, turned.im), im: R::add(simd, odd.im, turned.re) },
        ]
    }
}

impl Dft<8> for Points {
    #[inline(always)]
    fn list<T>(mut f: impl FnMut(usize) -> T) -> [T; 8] {
        [f(0), f(1), f(2), f(3), f(4), f(5), f(6), f(7)]
    }

    /// Two four-point transforms. Odd values are turned by eighths, `sqrt(1/2) (1 - i)` and
    /// `-sqrt(1/2) (1 + i)`: sums and differences, their factor joined to the last addition.
    #[inline(always)]
    fn of<R: Lanes, S: Simd>(simd: S, x: [C<R::Register<S>>; 8]) -> [C<R::Register<S>>; 8] {
        let h = R::splat(simd, R::Value::of(std::f64::consts::FRAC_1_SQRT_2));
        let e = Self::of::<R, S>(simd, [x[0], x[2], x[4], x[6]]);
        let o = Self::of::<R, S>(simd, [x[1], x[3], x[5], x[7]]);
        let (sum1, diff1) = (R::add(simd, o[1].re, o[1].im), R::sub(simd, o[1].im, o[1].re));
        let (sum3, diff3) = (R::add(simd, o[3].re, o[3].im), R::sub(simd, o[3].im, o[3].re));
        [
            add::<R, S>(simd, e[0], o[0]),
            C {
                re: R::mul_add_e(simd, sum1, h, e[1].re),
                im: R::mul_add_e(simd, diff1, h, e[1].im),
            },
            C { re: R::add(simd, e[2].re, o[2].im), im: R::sub(simd, e[2].im, o[2].re) },
            C {
                re: R::mul_add_e(simd, diff3, h, e[3].re),
                im: R::negate_mul_add_e(simd, sum3, h, e[3].im),
            },
            sub::<R, S>(simd, e[0], o[0]),
            C {
                re: R::negate_mul_add_e(simd, sum1, h, e[1].re),
                im: R::negate_mul_add_e(simd, diff1, h, e[1].im),
            },
            C { re: R::sub(simd, e[2].re, o[2].im), im: R::add(simd, e[2].im, o[2].re) },
            C {
                re: R::negate_mul_add_e(simd, diff3, h, e[3].re),
                im: R::mul_add_e(simd, sum3, h, e[3].im),
            },
        ]
    }
}
