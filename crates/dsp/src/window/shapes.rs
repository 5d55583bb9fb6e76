//! The formulas of the windows, symmetric, as `scipy.signal.windows` has them.

use std::f64::consts::PI;

use num_complex::Complex;
use rustfft::FftPlanner;

use super::Window;

/// The symmetric window of `m` points, at least 2.
pub(super) fn symmetric(window: &Window, m: usize) -> Vec<f64> {
    let last = (m - 1) as f64;
    let each = |value: &dyn Fn(f64) -> f64| (0..m).map(|i| value(i as f64)).collect();
    // Distance from the middle in samples.
    let away = |i: f64| (i - last / 2.0).abs();
    match *window {
        Window::Hann => cosines(&[0.5, 0.5], m),
        Window::Hamming => cosines(&[0.54, 0.46], m),
        Window::Blackman => cosines(&[0.42, 0.50, 0.08], m),
        Window::BlackmanHarris => cosines(&[0.35875, 0.48829, 0.14128, 0.01168], m),
        Window::Nuttall => cosines(&[0.3635819, 0.4891775, 0.1365995, 0.0106411], m),
        Window::FlatTop => {
            cosines(&[0.21557895, 0.41663158, 0.277263158, 0.083578947, 0.006947368], m)
        }
        Window::GeneralHamming(alpha) => cosines(&[alpha, 1.0 - alpha], m),
        Window::GeneralCosine(ref terms) => cosines(terms, m),
        Window::Bartlett => each(&|i| {
            let x = 2.0 * i / last;
            if x <= 1.0 { x } else { 2.0 - x }
        }),
        Window::Triang => each(&|i| {
            let n = i.min(last - i) + 1.0;
            let m = last + 1.0;
            if m % 2.0 == 0.0 { (2.0 * n - 1.0) / m } else { 2.0 * n / (m + 1.0) }
        }),
        Window::Cosine => each(&|i| (PI / (last + 1.0) * (i + 0.5)).sin()),
        Window::Boxcar => vec![1.0; m],
        Window::Parzen => each(&|i| {
            let (n, half) = (away(i), m as f64 / 2.0);
            let x = n / half;
            if n <= last / 4.0 {
                1.0 - 6.0 * x.powi(2) + 6.0 * x.powi(3)
            } else {
                2.0 * (1.0 - x).powi(3)
            }
        }),
        Window::Bohman => each(&|i| {
            if i == 0.0 || i == last {
                return 0.0;
            }
            let x = (-1.0 + 2.0 * i / last).abs();
            (1.0 - x) * (PI * x).cos() + (PI * x).sin() / PI
        }),
        Window::BartHann => each(&|i| {
            let x = (i / last - 0.5).abs();
            0.62 - 0.48 * x + 0.38 * (2.0 * PI * x).cos()
        }),
        Window::Lanczos => each(&|i| {
            let x = PI * (2.0 * i / last - 1.0);
            if 2.0 * i == last { 1.0 } else { x.sin() / x }
        }),
        Window::Kaiser(beta) => kaiser(beta, m),
        Window::KaiserBesselDerived(beta) => {
            let mut sum = 0.0;
            let running: Vec<f64> = kaiser(beta, m / 2 + 1)
                .into_iter()
                .map(|w| {
                    sum += w;
                    sum
                })
                .collect();
            let half: Vec<f64> = running[..m / 2].iter().map(|s| (s / sum).sqrt()).collect();
            half.iter().chain(half.iter().rev()).copied().collect()
        }
        Window::Tukey(alpha) if alpha <= 0.0 => vec![1.0; m],
        Window::Tukey(alpha) if alpha >= 1.0 => cosines(&[0.5, 0.5], m),
        Window::Tukey(alpha) => {
            let width = (alpha * last / 2.0).floor();
            let taper = |phase: f64| 0.5 * (1.0 + (PI * phase).cos());
            each(&|i| {
                if i <= width {
                    taper(-1.0 + 2.0 * i / alpha / last)
                } else if i >= last - width {
                    taper(-2.0 / alpha + 1.0 + 2.0 * i / alpha / last)
                } else {
                    1.0
                }
            })
        }
        Window::Gaussian(std) => each(&|i| (-away(i).powi(2) / (2.0 * std * std)).exp()),
        Window::GeneralGaussian(p, sig) => each(&|i| (-0.5 * (away(i) / sig).powf(2.0 * p)).exp()),
        Window::Exponential(center, tau) => {
            let center = center.unwrap_or(last / 2.0);
            each(&|i| (-(i - center).abs() / tau).exp())
        }
        Window::Chebyshev(db) => chebyshev(db, m),
        Window::Taylor(nbar, sll, norm) => taylor(nbar, sll, norm, m),
        Window::Dpss(nw) => dpss(nw, m),
        Window::Samples(ref values) => values.to_vec(),
    }
}

fn cosines(terms: &[f64], m: usize) -> Vec<f64> {
    let value = |i: usize| {
        let x = -PI + 2.0 * PI * i as f64 / (m - 1) as f64;
        terms.iter().enumerate().map(|(k, a)| a * (k as f64 * x).cos()).sum()
    };
    (0..m).map(value).collect()
}

fn kaiser(beta: f64, m: usize) -> Vec<f64> {
    let alpha = (m - 1) as f64 / 2.0;
    let value = |i: usize| {
        let r = (i as f64 - alpha) / alpha;
        bessel_i0(beta * (1.0 - r * r).max(0.0).sqrt()) / bessel_i0(beta)
    };
    (0..m).map(value).collect()
}

/// Modified Bessel function of the first kind, order zero (power series; exact to rounding for the
/// arguments that filter design uses).
pub fn bessel_i0(x: f64) -> f64 {
    let q = x * x / 4.0;
    let (mut term, mut sum, mut k) = (1.0, 1.0, 1.0);
    while term > sum * 1e-17 {
        term *= q / (k * k);
        sum += term;
        k += 1.0;
    }
    sum
}

/// The transform of a Chebyshev polynomial.
fn chebyshev(db: f64, m: usize) -> Vec<f64> {
    let order = (m - 1) as f64;
    let beta = ((10.0_f64.powf(db.abs() / 20.0)).acosh() / order).cosh();
    let odd = m % 2 == 1;
    let mut p: Vec<Complex<f64>> = (0..m)
        .map(|k| {
            let angle = PI * k as f64 / m as f64;
            let x = beta * angle.cos();
            let value = if x > 1.0 {
                (order * x.acosh()).cosh()
            } else if x < -1.0 {
                (if odd { 1.0 } else { -1.0 }) * (order * (-x).acosh()).cosh()
            } else {
                (order * x.acos()).cos()
            };
            if odd { value.into() } else { Complex::from_polar(1.0, angle) * value }
        })
        .collect();
    FftPlanner::new().plan_fft_forward(m).process(&mut p);
    let (first, count) = if odd { (0, m.div_ceil(2)) } else { (1, m / 2 + 1) };
    let right: Vec<f64> = p[first..count].iter().map(|z| z.re).collect();
    let left = right[1 - first..].iter().rev();
    let mut values: Vec<f64> = left.chain(&right).copied().collect();
    let peak = values.iter().copied().fold(f64::MIN, f64::max);
    values.iter_mut().for_each(|w| *w /= peak);
    values
}

fn taylor(nbar: usize, sll: f64, norm: bool, m: usize) -> Vec<f64> {
    let a2 = (10.0_f64.powf(sll / 20.0).acosh() / PI).powi(2);
    let s2 = (nbar * nbar) as f64 / (a2 + (nbar as f64 - 0.5).powi(2));
    let squared = |k: usize| (k * k) as f64;
    let factor = |k: usize| {
        let sign = if k % 2 == 1 { 1.0 } else { -1.0 };
        let numerator: f64 =
            (1..nbar).map(|j| 1.0 - squared(k) / s2 / (a2 + (j as f64 - 0.5).powi(2))).product();
        let denominator: f64 =
            (1..nbar).filter(|j| *j != k).map(|j| 1.0 - squared(k) / squared(j)).product();
        sign * numerator / (2.0 * denominator)
    };
    let factors: Vec<f64> = (1..nbar).map(factor).collect();
    let size = m as f64;
    let at = |n: f64| {
        let angle = 2.0 * PI * (n - size / 2.0 + 0.5) / size;
        let terms = factors.iter().enumerate().map(|(k, f)| f * ((k + 1) as f64 * angle).cos());
        1.0 + 2.0 * terms.sum::<f64>()
    };
    let scale = if norm { 1.0 / at((size - 1.0) / 2.0) } else { 1.0 };
    (0..m).map(|i| at(i as f64) * scale).collect()
}

/// The first eigenvector of the tridiagonal matrix that commutes with the concentration problem:
/// its eigenvalue by bisection, itself by inverse iteration from just above (where the matrix is
/// definite, so that elimination needs no pivots).
fn dpss(nw: f64, m: usize) -> Vec<f64> {
    let size = m as f64;
    let w = (2.0 * PI * nw / size).cos();
    let diagonal: Vec<f64> =
        (0..m).map(|i| ((size - 1.0 - 2.0 * i as f64) / 2.0).powi(2) * w).collect();
    // Entry i joins i and i + 1.
    let beside: Vec<f64> =
        (1..m).map(|i| i as f64 * (size - i as f64) / 2.0).chain([0.0]).collect();
    // Whether all eigenvalues lie below x: every pivot of the matrix less x is negative.
    let above_all = |x: f64| {
        let mut pivot = diagonal[0] - x;
        (1..m).all(|i| {
            let fits = pivot < 0.0;
            pivot = diagonal[i] - x - beside[i - 1].powi(2) / pivot;
            fits
        }) && pivot < 0.0
    };
    let bound = size * size;
    let (mut low, mut high) = (-bound, bound);
    for _ in 0..80 {
        let middle = f64::midpoint(low, high);
        if above_all(middle) { high = middle } else { low = middle }
    }
    let shift = high + bound * 1e-13;
    let mut vector = vec![1.0; m];
    let (mut pivots, mut right) = (vec![0.0; m], vec![0.0; m]);
    for _ in 0..8 {
        pivots[0] = diagonal[0] - shift;
        right[0] = vector[0];
        for i in 1..m {
            let factor = beside[i - 1] / pivots[i - 1];
            pivots[i] = diagonal[i] - shift - factor * beside[i - 1];
            right[i] = vector[i] - factor * right[i - 1];
        }
        for i in (0..m).rev() {
            let next = if i + 1 < m { beside[i] * vector[i + 1] } else { 0.0 };
            vector[i] = (right[i] - next) / pivots[i];
        }
        let peak = vector.iter().fold(0.0_f64, |peak, x| peak.max(x.abs()));
        vector.iter_mut().for_each(|x| *x = x.abs() / peak);
    }
    if m.is_multiple_of(2) {
        // scipy's approximate norm: the middle of an even window lies between two points.
        let correction = size * size / (size * size + nw);
        vector.iter_mut().for_each(|x| *x *= correction);
    }
    vector
}
