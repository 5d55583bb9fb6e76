//! Filter design of the "high quality" recipe (20 bits, linear phase) of libsoxr 0.1.3: which
//! stages a pair of rates needs and the coefficients of each.
//!
//! A conversion is a chain of up to four kinds of linear filter, each delay compensated:
//! half-band decimators (input/output >= 4), a Kaiser-windowed sinc (`L`/`M` small, or at the input
//! rate as anti-alias filter), a short polyphase interpolator, and a sinc that finishes large
//! upsampling. The formulas below are those facts, verified against soxr 1.1.0 to 4e-7.

use std::f64::consts::LN_10;

use super::low_pass::LowPass;

/// One filter of a chain.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Design {
    /// Insert `up - 1` zeros after each sample, filter, keep every `down`-th.
    Fir { up: usize, down: usize, taps: Vec<f64> },
    /// Tabulated interpolator.
    Poly(PolyDesign),
}

/// An interpolator: output `o` sits at `first + o * step` in units of 2^-32 input samples (or of
/// `1 / phases` samples where `order` is 0, which makes it exact).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct PolyDesign {
    /// Taps per output.
    pub taps: usize,
    /// Tabulated phases per input sample; a power of two where `order > 0`.
    pub phases: usize,
    /// Polynomial order of the interpolation between phases.
    pub order: usize,
    pub first: u64,
    pub step: u64,
    /// Prototype filter, `taps * phases` values.
    pub prototype: Vec<f64>,
}

const PRECISION_BITS: f64 = 20.0;
const STOPBAND: f64 = 1.0;
/// 2^32: denominators of fractional positions.
const FRACTION: f64 = 4_294_967_296.0;
/// Largest denominator for which every phase is tabulated exactly.
const MAX_EXACT_PHASES: usize = 2048;
const MAX_TABLE_BYTES: usize = 400_000;

/// Minimax half-band filters (passband to a quarter of the Nyquist frequency), odd-offset taps from
/// the centre outwards, by Remez exchange; the centre tap is 0.5. Stop band -136.5 and -152.3 dB.
const HALF_BAND_136: [f64; 8] = [
    0.311546523653,
    -0.0873449178987,
    0.0368144591079,
    -0.0151892058225,
    0.00545408682156,
    -0.00156438710406,
    0.000318166111063,
    -3.47995235931e-05,
];
const HALF_BAND_152: [f64; 9] = [
    0.312270347553,
    -0.0892215172541,
    0.0391397044082,
    -0.017250559209,
    0.00685894480506,
    -0.00230450557696,
    0.000609637741081,
    -0.000113238159493,
    1.11977921595e-05,
];

fn decibels(x: f64) -> f64 {
    20.0 * x.log10()
}

/// The frequency, as a fraction of the transition band, at which a Kaiser filter of `attenuation`
/// dB has fallen by `drop` dB (empirical fit).
fn transition_at(drop: f64, attenuation: f64) -> f64 {
    let a = attenuation;
    let x = ((2.0517e-07 * a - 1.1303e-04) * a + 0.023154) * a + 0.55924;
    let power = 0.5f64.ln() / (x * 0.5).sin().ln();
    let gain = (drop * LN_10 * 0.05).exp();
    let lower = if gain > 0.5 { 1.0 - gain } else { gain };
    let y = lower.powf(1.0 / power).asin() / x;
    if gain > 0.5 { y } else { 1.0 - y }
}

/// End of the band that is kept, as a fraction of the lower Nyquist frequency: 0.9137.
fn passband() -> f64 {
    1.0 - 0.05 / (1.0 - transition_at(-3.0, PRECISION_BITS * decibels(2.0)))
}

/// A filter of `1 mod modulo` taps: modulo 4, or twice the zero-stuffing factor
/// where that is a power of two.
fn fir(low_pass: &LowPass, up: usize, down: usize) -> Design {
    let whole = up.is_power_of_two() && low_pass.nyquist == up as f64;
    let modulo = if whole { 2 * up } else { 4 };
    let (_, _, needed) = low_pass.shape();
    let len = (needed + modulo - 2) / modulo * modulo + 1;
    let mut taps = low_pass.taps(len);
    for t in &mut taps {
        *t *= up as f64;
    }
    Design::Fir { up, down, taps }
}

fn half_band(attenuation: f64) -> Design {
    let odd: &[f64] = if attenuation > 136.51 { &HALF_BAND_152 } else { &HALF_BAND_136 };
    let centre = 2 * odd.len() - 1;
    let mut taps = vec![0.0; 2 * centre + 1];
    taps[centre] = 0.5;
    for (j, &c) in odd.iter().enumerate() {
        taps[centre + 2 * j + 1] = c;
        taps[centre - 2 * j - 1] = c;
    }
    Design::Fir { up: 1, down: 2, taps }
}

/// Rate changes of the stages: `2^halvings`, then `pre`, `arb` and `post` as up/down factors.
struct Factors {
    halvings: usize,
    upsample: bool,
    pre_up: usize,
    /// 0: a filter without rate change that protects the interpolator.
    pre_down: usize,
    arb_up: usize,
    /// Step of the interpolator in units of `1 / arb_up`; whole if `exact`.
    arb_down: f64,
    exact: bool,
    post_up: usize,
    post_down: usize,
}

/// The smallest fraction of at most [`MAX_EXACT_PHASES`] for `x - floor(x)`, to 32 bits.
fn as_fraction(x: f64) -> Option<(usize, usize)> {
    let fraction = x.fract();
    if fraction == 0.0 {
        return Some((0, 1));
    }
    let tolerance = ((fraction * FRACTION + 0.5).floor() / (fraction * FRACTION) - 1.0).abs();
    (1..=MAX_EXACT_PHASES).find_map(|den| {
        let exact = fraction * den as f64;
        let num = (exact + 0.5).floor();
        ((num / exact - 1.0).abs() <= tolerance).then_some((num as usize, den))
    })
}

fn factors(ratio: f64) -> Factors {
    let mut step = ratio;
    let mut post_up = 1;
    loop {
        let upsample = step < 1.0;
        let mut halvings = 0;
        while step >= 4.0 {
            step *= 0.5;
            halvings += 1;
        }
        let pre_down = usize::from(upsample || (step > 1.5 && step < 2.0));
        let post_down = if step > 1.0 && pre_down == 1 { 2 } else { 1 };
        step /= post_down as f64;
        let pre_up = 1 + usize::from(pre_down == 0 && step < 2.0) + usize::from(upsample);
        step *= pre_up as f64;
        let (mut arb_up, mut arb_down) = (1, step);
        let fraction = as_fraction(step);
        match fraction {
            None | Some((0, 1)) => {}
            Some((num, den)) if num == den => {
                arb_down = step.ceil();
                if arb_down > 3.0 {
                    halvings += 1;
                    arb_down *= 0.5;
                }
            }
            Some((num, den)) => {
                arb_up = den;
                arb_down = den as f64 * step.trunc() + num as f64;
            }
        }
        let rise = pre_up as f64 * arb_up as f64 / arb_down;
        if post_up == 1 && rise > 4.0 && rise != 5.0 {
            // Large upsampling: interpolate at a quarter (or less) of the rate, then a plain filter.
            post_up = 4;
            let mut i = (rise / 16.0) as usize >> 1;
            while i > 0 && post_up < 256 {
                post_up *= 2;
                i >>= 1;
            }
            step = arb_down * post_up as f64 / arb_up as f64 / pre_up as f64;
            continue;
        }
        let exact = fraction.is_some();
        let (mut up, mut down) = (pre_up * arb_up, (arb_down * post_down as f64) as usize);
        if (up | down) & 1 == 0 {
            (up, down) = (up / 2, down / 2);
        }
        let direct = exact && (up.max(down) < 5 || up * down < 6);
        return if direct {
            Factors {
                halvings,
                upsample,
                pre_up: up,
                pre_down: down,
                arb_up: 1,
                arb_down: 1.0,
                exact,
                post_up,
                post_down: 1,
            }
        } else {
            Factors {
                halvings,
                upsample,
                pre_up,
                pre_down,
                arb_up,
                arb_down,
                exact,
                post_up,
                post_down,
            }
        };
    }
}

/// The interpolator after the filters; `pass`, `stop` are the band edges that they leave.
fn interpolator(f: &Factors, pass: f64, stop: f64, attenuation: f64) -> PolyDesign {
    let rise = if f.upsample { 1.0 } else { f.arb_down / f.arb_up as f64 };
    let protected = f.upsample || f.pre_down == 0;
    let (nyquist, stop) = if protected {
        (1.0, 2.0 - (pass + (stop - pass) * 0.7))
    } else {
        (2.0 * rise, 3.0 + (stop - 1.0).abs())
    };
    let pass = stop - (stop - pass) / (1.0 - transition_at(-0.01, attenuation));
    // log2 of the tabulated phases for linear and for quadratic interpolation between them.
    let bits: [f64; 2] = match (f.upsample, f.pre_down) {
        (true, _) => [11.0, 7.0],
        (false, 0) => [12.4, 7.8],
        (false, _) => [10.6, 6.75],
    };
    let length = |phases: usize| {
        let spec = LowPass { pass, stop, nyquist, attenuation, phases: phases.max(19) };
        let taps = spec.prototype_len() / spec.phases + 1;
        if f.pre_down == 0 { taps + taps % 2 } else { taps }
    };
    let fits = |taps: usize, phases: usize, order: usize| {
        let values = taps.next_multiple_of(4) * phases * (order + 1);
        values * size_of::<f32>() / 1000 <= MAX_TABLE_BYTES / 1000
    };
    let prototype = |taps: usize, phases: usize| {
        let spec = LowPass { pass, stop, nyquist, attenuation, phases };
        let mut values = vec![0.0];
        values.extend(spec.taps(taps * phases - 1));
        values
    };
    if f.exact {
        let taps = length(f.arb_up);
        // Half a sample of offset needs an even number of phases.
        let doubled = if taps % 2 == 1 && f.arb_up % 2 == 1 { 2 } else { 1 };
        let phases = f.arb_up * doubled;
        if fits(taps, phases, 0) {
            return PolyDesign {
                taps,
                phases,
                order: 0,
                first: if taps % 2 == 1 { phases as u64 / 2 } else { 0 },
                step: f.arb_down as u64 * doubled as u64,
                prototype: prototype(taps, phases),
            };
        }
    }
    let table = |order: usize| {
        let phases = 1 << (bits[order - 1] - rise.log2()).ceil() as usize;
        (order, length(phases), phases)
    };
    let linear = table(1);
    let (order, taps, phases) = if fits(linear.1, linear.2, 1) { linear } else { table(2) };
    PolyDesign {
        taps,
        phases,
        order,
        first: if taps % 2 == 1 { 1 << 31 } else { 0 },
        step: (f.arb_down / f.arb_up as f64 * FRACTION + 0.5) as u64,
        prototype: prototype(taps, phases),
    }
}

/// The filters for `ratio = input rate / output rate`, in order.
pub(super) fn chain(ratio: f64) -> Vec<Design> {
    let f = factors(ratio);
    let has_pre = f.pre_up * f.pre_down != 1;
    let has_arb = f.arb_up as f64 * f.arb_down != 1.0;
    let has_post = f.post_up * f.post_down != 1;
    let mut attenuation = (PRECISION_BITS + 1.0) * decibels(2.0);
    let mut arb_attenuation = attenuation;
    let mut shared =
        f.halvings + [has_pre, has_arb, has_post].map(usize::from).iter().sum::<usize>();
    if shared > 1 {
        if has_arb {
            attenuation += decibels(2.0);
            arb_attenuation = attenuation;
            shared -= 1;
        }
        attenuation += decibels(shared as f64);
    }
    let mut designs: Vec<Design> = (0..f.halvings).map(|_| half_band(attenuation)).collect();
    let low_pass = |pass, stop, nyquist| LowPass { pass, stop, nyquist, attenuation, phases: 1 };
    let (mut pass, mut stop) = (passband(), STOPBAND);
    if has_pre {
        let nyquist = if f.pre_down > 0 {
            f.pre_up.max(f.pre_down) as f64
        } else {
            f.arb_down / f.arb_up as f64
        };
        designs.push(fir(&low_pass(pass, stop, nyquist), f.pre_up, f.pre_down.max(1)));
        pass /= nyquist;
        stop /= nyquist;
    }
    if has_arb {
        designs.push(Design::Poly(interpolator(&f, pass, stop, arb_attenuation)));
    }
    if has_post {
        let (pass, stop) = if f.upsample {
            let rise = f.post_down as f64 / (ratio * f.post_up as f64);
            (passband() / rise, (2.0 - STOPBAND / rise).max(1.0))
        } else {
            (passband(), STOPBAND)
        };
        let nyquist = f.post_up.max(f.post_down) as f64;
        designs.push(fir(&low_pass(pass, stop, nyquist), f.post_up, f.post_down));
    }
    designs
}
