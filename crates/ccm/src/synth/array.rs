//! The microphone array in a room.

use std::f64::consts::TAU;

use rand::Rng;

use super::physics::{SAMPLE_RATE, SOUND, gaussian};

/// Number of microphones.
pub(super) const MICROPHONES: usize = 8;

/// Radius in m of the circle they stand on (15 cm across).
const RADIUS: f64 = 0.075;

/// Height in m of the source above the array.
const ABOVE: f64 = 0.12;

/// Delays in samples and gains of the direct sound and the wall reflections for one microphone.
struct Paths(Vec<(f64, f64)>);

/// Plays a sound at `distance` metres from the array's centre and returns interleaved PCM16.
pub(super) fn record(samples: &[f32], distance: f64, noise: f64, rng: &mut impl Rng) -> Vec<i16> {
    let direction = rng.gen_range(0.0..TAU);
    // Image sources: the sound mirrored by four walls and the ceiling.
    let mut images = vec![(position(distance, direction, ABOVE), 1.0)];
    for wall in 0..5 {
        let away = rng.gen_range(2.5..5.0);
        let angle = direction + TAU * (wall as f64 + rng.gen_range(0.2..0.8)) / 5.0;
        images.push((position(away, angle, rng.gen_range(-0.5..1.5)), 0.35));
    }
    let paths: Vec<_> = (0..MICROPHONES)
        .map(|m| {
            let microphone = position(RADIUS, TAU * m as f64 / MICROPHONES as f64, 0.0);
            let gain = 1.0 + 0.04 * gaussian(rng);
            Paths(
                images
                    .iter()
                    .map(|&(image, strength)| {
                        let d = separation(image, microphone).max(0.05);
                        (d / SOUND * SAMPLE_RATE as f64, gain * strength / d)
                    })
                    .collect(),
            )
        })
        .collect();

    let mut pcm = vec![0i16; samples.len() * MICROPHONES];
    let mut channel = vec![0.0f32; samples.len()];
    for (m, paths) in paths.iter().enumerate() {
        channel.fill(0.0);
        for &(delay, gain) in &paths.0 {
            add_delayed(&mut channel, samples, delay, gain as f32);
        }
        // Room noise: a slow rumble and a little hiss, independent per microphone.
        let mut rumble = 0.0f64;
        for (n, &value) in channel.iter().enumerate() {
            let white = uniform(rng);
            rumble += 0.02 * (white - rumble);
            let noisy = f64::from(value) + noise * (4.0 * rumble + 0.3 * white);
            pcm[n * MICROPHONES + m] = (noisy * 6000.0).clamp(-32767.0, 32767.0).round() as i16;
        }
    }
    pcm
}

/// Adds `samples` delayed by a fraction of samples (linear interpolation).
fn add_delayed(out: &mut [f32], samples: &[f32], delay: f64, gain: f32) {
    let whole = delay as usize;
    let part = (delay - whole as f64) as f32;
    let (now, before) = (gain * (1.0 - part), gain * part);
    let mut previous = 0.0;
    for (y, &x) in out.iter_mut().skip(whole).zip(samples) {
        *y += now * x + before * previous;
        previous = x;
    }
}

/// White noise of variance one, cheap: uniform.
fn uniform(rng: &mut impl Rng) -> f64 {
    3f64.sqrt() * rng.gen_range(-1.0..1.0)
}

fn position(distance: f64, angle: f64, height: f64) -> [f64; 3] {
    [distance * angle.cos(), distance * angle.sin(), height]
}

fn separation(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).powi(2)).sum::<f64>().sqrt()
}
