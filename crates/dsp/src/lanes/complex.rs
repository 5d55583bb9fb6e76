//! Complex values of one register, and the small transforms over them.

use pulp::Simd;

use super::Row;

/// A complex value of one register.
#[derive(Clone, Copy)]
pub(super) struct C<V> {
    pub re: V,
    pub im: V,
}

/// Real and imaginary rows of a complex value.
pub(super) type Pair = [Row; 2];

#[inline(always)]
pub(super) fn load<S: Simd>(pair: &Pair, v: usize) -> C<S::f32s> {
    C { re: pair[0].load::<S>(v), im: pair[1].load::<S>(v) }
}

#[inline(always)]
pub(super) fn store<S: Simd>(pair: &mut Pair, v: usize, x: C<S::f32s>) {
    pair[0].store::<S>(v, x.re);
    pair[1].store::<S>(v, x.im);
}

#[inline(always)]
pub(super) fn add<S: Simd>(simd: S, a: C<S::f32s>, b: C<S::f32s>) -> C<S::f32s> {
    C { re: simd.add_f32s(a.re, b.re), im: simd.add_f32s(a.im, b.im) }
}

#[inline(always)]
pub(super) fn sub<S: Simd>(simd: S, a: C<S::f32s>, b: C<S::f32s>) -> C<S::f32s> {
    C { re: simd.sub_f32s(a.re, b.re), im: simd.sub_f32s(a.im, b.im) }
}

/// `a * (re + i im)`.
#[inline(always)]
pub(super) fn mul<S: Simd>(simd: S, a: C<S::f32s>, [re, im]: [f32; 2]) -> C<S::f32s> {
    let (wr, wi) = (simd.splat_f32s(re), simd.splat_f32s(im));
    C {
        re: simd.negate_mul_add_e_f32s(a.im, wi, simd.mul_f32s(a.re, wr)),
        im: simd.mul_add_e_f32s(a.re, wi, simd.mul_f32s(a.im, wr)),
    }
}

/// The transform of `N` points, written out: arrays filled in a loop would go through memory.
pub(super) trait Dft<const N: usize> {
    /// `[f(0), f(1), ...]`.
    fn list<T>(f: impl FnMut(usize) -> T) -> [T; N];

    /// `X[k] = sum of x[n] exp(-2 pi i k n / N)`.
    fn of<S: Simd>(simd: S, x: [C<S::f32s>; N]) -> [C<S::f32s>; N];
}

/// Holder of the transforms.
pub(super) struct Points;

impl Dft<4> for Points {
    #[inline(always)]
    fn list<T>(mut f: impl FnMut(usize) -> T) -> [T; 4] {
        [f(0), f(1), f(2), f(3)]
    }

    #[inline(always)]
    fn of<S: Simd>(simd: S, x: [C<S::f32s>; 4]) -> [C<S::f32s>; 4] {
        let (even, odd) = (add(simd, x[0], x[2]), sub(simd, x[0], x[2]));
        let (cross, turned) = (add(simd, x[1], x[3]), sub(simd, x[1], x[3]));
        // `turned` counts times -i.
        [
            add(simd, even, cross),
            C { re: simd.add_f32s(odd.re, turned.im), im: simd.sub_f32s(odd.im, turned.re) },
            sub(simd, even, cross),
            C { re: simd.sub_f32s(odd.re, turned.im), im: simd.add_f32s(odd.im, turned.re) },
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
    fn of<S: Simd>(simd: S, x: [C<S::f32s>; 8]) -> [C<S::f32s>; 8] {
        let h = simd.splat_f32s(std::f32::consts::FRAC_1_SQRT_2);
        let e = Self::of(simd, [x[0], x[2], x[4], x[6]]);
        let o = Self::of(simd, [x[1], x[3], x[5], x[7]]);
        let (sum1, diff1) = (simd.add_f32s(o[1].re, o[1].im), simd.sub_f32s(o[1].im, o[1].re));
        let (sum3, diff3) = (simd.add_f32s(o[3].re, o[3].im), simd.sub_f32s(o[3].im, o[3].re));
        [
            add(simd, e[0], o[0]),
            C {
                re: simd.mul_add_e_f32s(sum1, h, e[1].re),
                im: simd.mul_add_e_f32s(diff1, h, e[1].im),
            },
            C { re: simd.add_f32s(e[2].re, o[2].im), im: simd.sub_f32s(e[2].im, o[2].re) },
            C {
                re: simd.mul_add_e_f32s(diff3, h, e[3].re),
                im: simd.negate_mul_add_e_f32s(sum3, h, e[3].im),
            },
            sub(simd, e[0], o[0]),
            C {
                re: simd.negate_mul_add_e_f32s(sum1, h, e[1].re),
                im: simd.negate_mul_add_e_f32s(diff1, h, e[1].im),
            },
            C { re: simd.sub_f32s(e[2].re, o[2].im), im: simd.add_f32s(e[2].im, o[2].re) },
            C {
                re: simd.negate_mul_add_e_f32s(diff3, h, e[3].re),
                im: simd.mul_add_e_f32s(sum3, h, e[3].im),
            },
        ]
    }
}
