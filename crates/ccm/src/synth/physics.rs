//! The sound of filling or shaking a container, by simple physics.
//!
//! Grains are a Poisson process of impacts. An impact on the wall excites the container's modes,
//! whose frequencies fall and whose damping grows with the mass inside; an impact on other grains
//! is a short burst of its own. Water is turbulence filtered by the column of air above it, a
//! quarter-wave resonator that gets shorter and so higher, and bubbles that ring at Minnaert's
//! frequency.

use std::f64::consts::{PI, TAU};

use rand::Rng;

use crate::dataset::{Category, Filling, FillingType};

/// Sample rate of the recordings in Hz.
pub const SAMPLE_RATE: u32 = 44_100;

/// Speed of sound in m/s.
pub(super) const SOUND: f64 = 343.0;

/// Minnaert: a bubble of radius r metres rings at 3.26 / r Hz near the surface.
const MINNAERT: f64 = 3.26;

/// Samples over which the slowly changing modes are held.
const BLOCK: usize = 64;

/// What is being filled or shaken.
pub(super) struct Source {
    pub(super) category: Category,
    pub(super) capacity_ml: f64,
    pub(super) filling: Filling,
    /// Held in a hand, which damps the walls.
    pub(super) held: bool,
}

/// A sound at one metre and when its action starts and ends, in seconds (`None` for empty).
pub(super) struct Sound {
    pub(super) samples: Vec<f32>,
    pub(super) action: Option<(f64, f64)>,
}

/// Size and rate of the grains of a filling.
struct Grains {
    /// Impacts per second.
    rate: f64,
    /// Mean strength of an impact.
    strength: f64,
    /// Contact time in s: the longer, the duller.
    contact: f64,
}

impl Source {
    /// Inner height in m of a cylinder 1.3 times as high as wide.
    fn height(&self) -> f64 {
        1.3 * (4.0 * self.capacity_ml * 1e-6 / (1.3 * PI)).cbrt()
    }

    /// Frequency in Hz, quality and strength of the empty container's modes.
    fn modes(&self) -> [(f64, f64, f64); 4] {
        let scale = 0.09 / self.height();
        let (base, quality, spread): (f64, f64, f64) = match self.category {
            Category::Cup => (950.0, 14.0, 1.55),
            Category::Glass => (2300.0, 70.0, 1.8),
            Category::Box => (520.0, 6.0, 1.35),
        };
        let quality = if self.held { 0.6 * quality } else { quality };
        std::array::from_fn(|k| {
            let frequency = (base * scale * spread.powi(k as i32)).min(0.4 * SAMPLE_RATE as f64);
            (frequency, quality * (1.0 + 0.2 * k as f64), 0.7f64.powi(k as i32))
        })
    }

    /// No two handfuls and hands are alike, hence the spread.
    fn grains(&self, rng: &mut impl Rng) -> Grains {
        let mut grains = match self.filling.kind() {
            FillingType::Pasta => Grains { rate: 140.0, strength: 0.9, contact: 1.8e-4 },
            _ => Grains { rate: 600.0, strength: 0.4, contact: 8e-5 },
        };
        grains.rate *= (0.4 * gaussian(rng)).exp();
        grains.strength *= (0.3 * gaussian(rng)).exp();
        grains.contact *= (0.3 * gaussian(rng)).exp();
        grains
    }

    /// Makes the sound; the generator decides everything random.
    pub(super) fn sound(&self, rng: &mut impl Rng) -> Sound {
        let lead = rng.gen_range(0.15..0.35);
        let fraction = self.filling.level().fraction();
        let per_fill = 0.8 + 0.35 * (1.0 + self.capacity_ml / 200.0).log2();
        let active = if fraction > 0.0 {
            (0.25 + fraction * per_fill) * rng.gen_range(0.75..1.3)
        } else {
            0.9
        };
        let total = ((lead + active + rng.gen_range(0.2..0.4)) * SAMPLE_RATE as f64) as usize;
        let span = (lead, lead + active);
        let mut walls = vec![0.0f64; total];
        let mut direct = vec![0.0f64; total];
        match self.filling.kind() {
            FillingType::None => self.handling(&mut walls, span, rng),
            FillingType::Water => self.water(&mut walls, &mut direct, span, rng),
            _ => self.granular(&mut walls, &mut direct, span, rng),
        }
        let shaken = self.category == Category::Box;
        let fill = |t: f64| {
            let progress = ((t - span.0) / active).clamp(0.0, 1.0);
            fraction * if shaken { 1.0 } else { progress }
        };
        self.ring(&walls, &mut direct, fill);
        let samples = direct.iter().map(|&v| v as f32).collect();
        Sound { samples, action: (fraction > 0.0).then_some(span) }
    }

    /// A few touches of the empty container.
    fn handling(&self, walls: &mut [f64], span: (f64, f64), rng: &mut impl Rng) {
        for _ in 0..rng.gen_range(2..5) {
            let at = rng.gen_range(span.0..span.1);
            impact(walls, at, rng.gen_range(0.3..1.0), 3e-4);
        }
    }

    fn granular(
        &self,
        walls: &mut [f64],
        direct: &mut [f64],
        span: (f64, f64),
        rng: &mut impl Rng,
    ) {
        let grains = self.grains(rng);
        let fraction = self.filling.level().fraction();
        let shaken = self.category == Category::Box;
        let stroke = rng.gen_range(2.6..3.4);
        let mut t = span.0;
        loop {
            // More grains move in a fuller box; a pour has one rate.
            let rate = grains.rate * if shaken { 0.4 + fraction } else { 1.0 };
            t += -rng.gen_range(f64::MIN_POSITIVE..1.0).ln() / rate;
            if t >= span.1 {
                return;
            }
            let progress = (t - span.0) / (span.1 - span.0);
            let (mut strength, fill) = if shaken {
                // Grains hit the walls where a stroke turns.
                let phase = (t - span.0) * stroke * 2.0;
                ((TAU * phase / 2.0).cos().abs().powi(4) * 1.4, fraction)
            } else {
                (1.0, fraction * progress)
            };
            strength *= grains.strength * (0.5 * gaussian(rng)).exp();
            // The fuller, the more grains fall on grains instead of walls.
            impact(walls, t, strength * (1.0 - 0.8 * fill), grains.contact);
            impact(direct, t, 0.35 * strength * (0.3 + fill), 2.0 * grains.contact);
        }
    }

    fn water(&self, walls: &mut [f64], direct: &mut [f64], span: (f64, f64), rng: &mut impl Rng) {
        let fraction = self.filling.level().fraction();
        let height = self.height();
        let mut column = [Resonator::default(); 2];
        let last = direct.len().min((span.1 * SAMPLE_RATE as f64) as usize);
        for n in (span.0 * SAMPLE_RATE as f64) as usize..last {
            let progress = (n as f64 / SAMPLE_RATE as f64 - span.0) / (span.1 - span.0);
            if n % BLOCK == 0 {
                let air = height * (1.0 - fraction * progress) + 0.02;
                let quarter = SOUND / (4.0 * air);
                for (k, resonator) in column.iter_mut().enumerate() {
                    resonator.tune(quarter * (2 * k + 1) as f64, 12.0);
                }
            }
            let edge = (progress * 30.0).min(1.0).min((1.0 - progress) * 20.0).max(0.0);
            let turbulence = gaussian(rng) * 0.05 * edge;
            direct[n] += 3.0 * (column[0].step(turbulence) + 0.5 * column[1].step(turbulence));
            direct[n] += 0.1 * turbulence;
            walls[n] += 0.05 * turbulence;
        }
        let mut t = span.0;
        loop {
            t += -rng.gen_range(f64::MIN_POSITIVE..1.0).ln() / 140.0;
            if t >= span.1 {
                return;
            }
            let radius = 1.1e-3 * (0.5 * gaussian(rng)).exp();
            bubble(direct, t, radius.clamp(4e-4, 6e-3), rng.gen_range(0.05..0.25));
        }
    }

    /// Adds what the walls radiate.
    fn ring(&self, walls: &[f64], out: &mut [f64], fill: impl Fn(f64) -> f64) {
        let modes = self.modes();
        let mut resonators = [Resonator::default(); 4];
        for (n, (&x, y)) in walls.iter().zip(out.iter_mut()).enumerate() {
            if n % BLOCK == 0 {
                let fill = fill(n as f64 / SAMPLE_RATE as f64);
                for (resonator, (frequency, quality, _)) in resonators.iter_mut().zip(modes) {
                    resonator
                        .tune(frequency / (1.0 + 0.9 * fill).sqrt(), quality / (1.0 + 2.0 * fill));
                }
            }
            for (resonator, (_, _, gain)) in resonators.iter_mut().zip(modes) {
                *y += gain * resonator.step(x);
            }
        }
    }
}

/// A two-pole resonance with gain near one at its peak.
#[derive(Clone, Copy, Default)]
struct Resonator {
    a1: f64,
    a2: f64,
    gain: f64,
    y1: f64,
    y2: f64,
}

impl Resonator {
    fn tune(&mut self, frequency: f64, quality: f64) {
        let frequency = frequency.min(0.45 * SAMPLE_RATE as f64);
        let radius = (-PI * frequency / (quality * SAMPLE_RATE as f64)).exp();
        let angle = TAU * frequency / SAMPLE_RATE as f64;
        self.a1 = 2.0 * radius * angle.cos();
        self.a2 = -radius * radius;
        self.gain = (1.0 - radius) * 2.0 * angle.sin();
    }

    fn step(&mut self, x: f64) -> f64 {
        let y = self.gain * x + self.a1 * self.y1 + self.a2 * self.y2;
        self.y2 = self.y1;
        self.y1 = y;
        y
    }
}

/// Adds a force pulse (raised cosine) of unit impulse per strength at `at` seconds.
fn impact(out: &mut [f64], at: f64, strength: f64, contact: f64) {
    let width = (contact * SAMPLE_RATE as f64).max(1.0);
    let centre = at * SAMPLE_RATE as f64;
    let first = (centre - width).ceil().max(0.0) as usize;
    for n in first..out.len().min((centre + width) as usize + 1) {
        let phase = (n as f64 - centre) / width;
        out[n] += strength * (1.0 + (PI * phase).cos()) / width.sqrt();
    }
}

/// Adds a ringing bubble whose pitch rises a little as it nears the surface.
fn bubble(out: &mut [f64], at: f64, radius: f64, strength: f64) {
    let frequency = MINNAERT / radius;
    let decay = 0.13 / radius + 0.0072 * radius.powf(-1.5);
    let first = (at * SAMPLE_RATE as f64) as usize;
    let length = (5.0 / decay * SAMPLE_RATE as f64) as usize;
    for n in first..out.len().min(first + length) {
        let t = (n - first) as f64 / SAMPLE_RATE as f64;
        let pitch = frequency * (1.0 + 0.1 * decay * t);
        out[n] += strength * (-decay * t).exp() * (TAU * pitch * t).sin();
    }
}

/// A normal deviate (Box and Muller).
pub(super) fn gaussian(rng: &mut impl Rng) -> f64 {
    let u: f64 = rng.gen_range(f64::MIN_POSITIVE..1.0);
    let v: f64 = rng.gen_range(0.0..TAU);
    (-2.0 * u.ln()).sqrt() * v.cos()
}
