//! Health of a recording: levels, clipping, silence, dead and duplicated channels.

use serde::Serialize;

/// Blocks whose peak is below this level (-60 dBFS) count as silent.
const SILENCE: f32 = 1e-3;
/// Shortest run of samples at the peak that counts as clipping.
const CLIPPED_RUN: u64 = 3;
/// Peaks below this (-20 dBFS) are not called clipped: rounding alone makes quiet tops flat.
const CLIPPED_PEAK: f32 = 0.1;

/// Health of one channel. Non-finite samples are counted and otherwise treated as zero.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelHealth {
    /// Largest magnitude, 1 = full scale.
    pub peak: f32,
    /// `peak` in dB relative to full scale; `None` for a channel of zeros.
    pub peak_dbfs: Option<f64>,
    /// Root mean square.
    pub rms: f64,
    /// `rms` in dB relative to full scale (of a square wave); `None` for a channel of zeros.
    pub rms_dbfs: Option<f64>,
    /// Mean.
    pub dc_offset: f64,
    /// Runs of at least three successive samples at the positive or negative peak, whatever its
    /// level: a recording may have been attenuated after it was clipped.
    pub clipped_runs: u64,
    /// Samples in those runs.
    pub clipped_samples: u64,
    /// Fraction of 20 ms blocks whose peak is below -60 dBFS.
    pub silence: f64,
    /// All samples are the same.
    pub dead: bool,
    /// NaN and infinite samples.
    pub non_finite: u64,
}

/// Health of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Health {
    /// Frames measured.
    pub frames: u64,
    /// One entry per channel.
    pub channels: Vec<ChannelHealth>,
    /// Pearson correlation of each channel with each, `[channel][channel]`; 0 with a dead one.
    pub correlation: Vec<Vec<f64>>,
    /// Pairs of channels (first < second, not dead) with exactly the same samples.
    pub duplicates: Vec<(usize, usize)>,
}

/// Samples at the extreme value of one sign.
#[derive(Debug, Clone, Copy, Default)]
struct Extreme {
    value: f32,
    run: u64,
    runs: u64,
    samples: u64,
}

impl Extreme {
    /// `x` is not negative: the sample or its opposite.
    fn push(&mut self, x: f32) {
        if x > self.value {
            *self = Self { value: x, run: 1, ..Self::default() };
        } else if x == self.value && x > 0.0 {
            self.run += 1;
            if self.run == CLIPPED_RUN {
                self.runs += 1;
                self.samples += CLIPPED_RUN;
            } else if self.run > CLIPPED_RUN {
                self.samples += 1;
            }
        } else {
            self.run = 0;
        }
    }
}

#[derive(Debug, Clone, Default)]
struct Channel {
    sum: f64,
    high: Extreme,
    low: Extreme,
    first: f32,
    varies: bool,
    silent_blocks: u64,
    non_finite: u64,
    /// The block being filled.
    block: Vec<f32>,
}

/// Measures [`Health`] from blocks of samples; the result does not depend on how they are split.
#[derive(Debug, Clone)]
pub struct HealthMeter {
    channels: Vec<Channel>,
    /// Sums of products of channels `i <= j`, row by row.
    products: Vec<f64>,
    /// Whether channels `i < j` differ, in the same order.
    differ: Vec<bool>,
    block_frames: usize,
    blocks: u64,
    frames: u64,
}

impl HealthMeter {
    /// A meter for `channels` channels at `sample_rate` Hz.
    pub fn new(channels: usize, sample_rate: u32) -> Self {
        let pairs = channels * (channels + 1) / 2;
        let block_frames = (sample_rate as usize / 50).max(1);
        let channel = Channel { block: Vec::with_capacity(block_frames), ..Channel::default() };
        Self {
            channels: vec![channel; channels],
            products: vec![0.0; pairs],
            differ: vec![false; pairs],
            block_frames,
            blocks: 0,
            frames: 0,
        }
    }

    /// Adds interleaved samples; a trailing incomplete frame is ignored.
    pub fn push(&mut self, interleaved: &[f32]) {
        let n = self.channels.len();
        let mut rest = interleaved;
        while n > 0 && rest.len() >= n {
            let filled = self.channels[0].block.len();
            let take = (self.block_frames - filled).min(rest.len() / n);
            let (now, later) = rest.split_at(take * n);
            rest = later;
            for (c, channel) in self.channels.iter_mut().enumerate() {
                for &x in now[c..].iter().step_by(n) {
                    channel.non_finite += u64::from(!x.is_finite());
                    channel.block.push(if x.is_finite() { x } else { 0.0 });
                }
            }
            if filled + take == self.block_frames {
                self.finish_block();
            }
        }
    }

    fn finish_block(&mut self) {
        let started = self.frames > 0;
        for channel in &mut self.channels {
            if !started {
                channel.first = channel.block[0];
            }
            let mut peak = 0.0f32;
            for &x in &channel.block {
                channel.high.push(x.max(0.0));
                channel.low.push((-x).max(0.0));
                channel.varies |= x != channel.first;
                channel.sum += f64::from(x);
                peak = peak.max(x.abs());
            }
            channel.silent_blocks += u64::from(peak < SILENCE);
        }
        let mut pair = 0;
        for (i, a) in self.channels.iter().enumerate() {
            for b in &self.channels[i..] {
                self.products[pair] += dot(&a.block, &b.block);
                self.differ[pair] = self.differ[pair] || a.block != b.block;
                pair += 1;
            }
        }
        self.blocks += 1;
        self.frames += self.channels[0].block.len() as u64;
        self.channels.iter_mut().for_each(|channel| channel.block.clear());
    }

    /// The health of all samples so far.
    pub fn finish(mut self) -> Health {
        if self.channels.first().is_some_and(|channel| !channel.block.is_empty()) {
            self.finish_block();
        }
        let n = self.channels.len();
        let frames = self.frames.max(1) as f64;
        // Rows before row i hold n, n - 1, ..., n - i + 1 pairs; row i starts with (i, i).
        let pair = |i: usize, j: usize| i * (2 * n + 1 - i) / 2 + (j - i);
        let covariance = |i: usize, j: usize| {
            let means = self.channels[i].sum * self.channels[j].sum / frames;
            self.products[pair(i, j)] - means
        };
        let channels: Vec<_> = (0..n)
            .map(|i| self.channels[i].health(self.products[pair(i, i)], frames, self.blocks))
            .collect();
        let mut correlation = vec![vec![0.0; n]; n];
        let mut duplicates = Vec::new();
        for i in 0..n {
            for j in i..n {
                if channels[i].dead || channels[j].dead {
                    continue;
                }
                let scale = (covariance(i, i) * covariance(j, j)).sqrt();
                let r = if scale > 0.0 { (covariance(i, j) / scale).clamp(-1.0, 1.0) } else { 0.0 };
                (correlation[i][j], correlation[j][i]) = (r, r);
                if i < j && !self.differ[pair(i, j)] {
                    duplicates.push((i, j));
                }
            }
        }
        Health { frames: self.frames, channels, correlation, duplicates }
    }
}

impl Channel {
    fn health(&self, energy: f64, frames: f64, blocks: u64) -> ChannelHealth {
        let db = |x: f64| (x > 0.0).then(|| 20.0 * x.log10());
        let peak = self.high.value.max(self.low.value);
        let rms = (energy / frames).sqrt();
        let dead = !self.varies;
        let tops = [self.high, self.low];
        let clipped = tops.iter().filter(|top| !dead && top.value >= CLIPPED_PEAK);
        let (runs, samples) =
            clipped.fold((0, 0), |(runs, samples), top| (runs + top.runs, samples + top.samples));
        ChannelHealth {
            peak,
            peak_dbfs: db(peak.into()),
            rms,
            rms_dbfs: db(rms),
            dc_offset: self.sum / frames,
            clipped_runs: runs,
            clipped_samples: samples,
            silence: self.silent_blocks as f64 / blocks.max(1) as f64,
            dead,
            non_finite: self.non_finite,
        }
    }
}

/// Sum of products, in eight lanes that the compiler can vectorise.
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let mut lanes = [0.0f64; 8];
    let (a, a_rest) = a.as_chunks::<8>();
    let (b, b_rest) = b.as_chunks::<8>();
    for (a, b) in a.iter().zip(b) {
        for k in 0..8 {
            lanes[k] += f64::from(a[k]) * f64::from(b[k]);
        }
    }
    let rest = a_rest.iter().zip(b_rest).map(|(a, b)| f64::from(*a) * f64::from(*b));
    lanes.iter().sum::<f64>() + rest.sum::<f64>()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measure(channels: &[Vec<f32>], split: usize) -> Health {
        let frames = channels[0].len();
        let interleaved: Vec<f32> =
            (0..frames).flat_map(|t| channels.iter().map(move |c| c[t])).collect();
        let mut meter = HealthMeter::new(channels.len(), 8000);
        for block in interleaved.chunks(split * channels.len()) {
            meter.push(block);
        }
        meter.finish()
    }

    fn sine(hz: f32, amplitude: f32) -> Vec<f32> {
        let w = std::f32::consts::TAU * hz / 8000.0;
        (0..8000).map(|t| amplitude * (w * t as f32).sin()).collect()
    }

    #[test]
    fn levels_of_a_sine_with_an_offset() {
        let x = sine(100.0, 0.5).iter().map(|v| v + 0.25).collect();
        let health = measure(&[x], 8000);
        let c = &health.channels[0];
        assert!((c.peak - 0.75).abs() < 1e-6);
        assert!((c.peak_dbfs.unwrap() - 20.0 * 0.75f64.log10()).abs() < 1e-5);
        assert!((c.dc_offset - 0.25).abs() < 1e-6);
        assert!((c.rms - (0.125f64 + 0.0625).sqrt()).abs() < 1e-6);
        assert_eq!((c.silence, c.dead, c.non_finite, c.clipped_runs), (0.0, false, 0, 0));
        assert_eq!(health.frames, 8000);
    }

    #[test]
    fn clipping_is_found_at_any_level() {
        for gain in [1.0, 0.3] {
            let x: Vec<f32> = sine(100.0, 2.0).iter().map(|v| v.clamp(-1.0, 0.9) * gain).collect();
            let c = &measure(std::slice::from_ref(&x), 333).channels[0];
            assert_eq!(c.clipped_runs, 200, "100 periods, two tops each");
            let tops = [0.9 * gain, -gain].map(|top| x.iter().filter(|v| **v == top).count());
            assert_eq!(c.clipped_samples, (tops[0] + tops[1]) as u64);
        }
    }

    #[test]
    fn silence_counts_blocks_of_20_ms() {
        let mut x = sine(100.0, 0.5);
        x[..1600].fill(0.0005);
        assert_eq!(measure(&[x], 100).channels[0].silence, 0.2);
    }

    #[test]
    fn dead_duplicated_and_inverted_channels() {
        let (a, b) = (sine(100.0, 0.5), sine(300.0, 0.2));
        let inverted = a.iter().map(|v| -v).collect();
        let channels = [a.clone(), b, vec![0.1; 8000], a, inverted];
        let health = measure(&channels, 1234);
        let dead: Vec<bool> = health.channels.iter().map(|c| c.dead).collect();
        assert_eq!(dead, [false, false, true, false, false]);
        assert_eq!(health.duplicates, [(0, 3)]);
        let r = &health.correlation;
        assert!((r[0][3] - 1.0).abs() < 1e-9 && (r[4][0] + 1.0).abs() < 1e-9);
        assert!(r[0][1].abs() < 1e-3 && r[0][2] == 0.0);
    }

    #[test]
    fn the_split_does_not_matter() {
        let channels = [sine(100.0, 0.5), sine(333.0, 0.7), sine(17.0, 0.1)];
        let whole = measure(&channels, 8000);
        for split in [1, 7, 159, 160, 161, 4096] {
            assert_eq!(measure(&channels, split), whole);
        }
    }

    #[test]
    fn non_finite_samples_are_counted_and_spoil_nothing() {
        let mut x = sine(100.0, 0.5);
        x[5] = f32::NAN;
        x[6] = f32::INFINITY;
        let health = measure(&[x], 8000);
        let c = &health.channels[0];
        assert_eq!(c.non_finite, 2);
        assert!(c.rms.is_finite() && c.peak <= 0.5 && c.dc_offset.abs() < 1e-3);
    }

    #[test]
    fn nothing_is_no_failure() {
        let health = HealthMeter::new(2, 8000).finish();
        assert_eq!((health.frames, health.channels.len()), (0, 2));
        assert_eq!(health.channels[0].peak_dbfs, None);
    }
}
