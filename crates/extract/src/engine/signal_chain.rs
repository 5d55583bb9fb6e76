//! The signal chain: decoded blocks to the signal that features see, in the order of
//! [`SignalConfig`].

use corsmal_dsp::corsmal::downmix_71_weights;
use corsmal_dsp::resample::{Converter, ConverterStream};
use corsmal_dsp::simd::vectorized;

use crate::config::{Channels, Normalize, SignalConfig};

/// Samples of silence handed on at a time, all channels together.
const SILENCE: usize = 1 << 16;

/// Channels that features see of a recording with `channels` channels.
///
/// # Errors
/// A sentence, where the rule does not fit the recording.
pub fn channels_out(rule: &Channels, channels: usize) -> Result<usize, String> {
    match rule {
        Channels::All => Ok(channels),
        Channels::Mean => Ok(1),
        Channels::Downmix71 if channels == 8 => Ok(1),
        Channels::Downmix71 => Err(format!(
            "signal.channels = downmix-7.1 needs 8 channels; the recording has {channels} \
             (signal.channels=mean takes any number)"
        )),
        Channels::List(list) => match list.iter().find(|c| **c >= channels) {
            None => Ok(list.len()),
            Some(c) => Err(format!(
                "signal.channels asks for channel {c}; the recording has {channels}, counted from 0"
            )),
        },
    }
}

/// Channels, resampling, pre-emphasis and length, block by block.
pub struct SignalChain {
    rule: Channels,
    channels_in: usize,
    channels: usize,
    resample: Option<ConverterStream>,
    preemphasis: f32,
    /// The frame before, for pre-emphasis; empty before the first.
    before: Vec<f32>,
    /// The signal so far, where it is to be brought to a common level.
    held: Option<(Normalize, Vec<f32>)>,
    /// Frames still to be given, where a length is configured.
    remaining: Option<u64>,
    /// Whether any sample came: nothing is not filled up with silence.
    begun: bool,
    mixed: Vec<f32>,
}

impl SignalChain {
    /// The chain for recordings of `channels_in` channels whose features run at `sample_rate`.
    ///
    /// # Errors
    /// A sentence, where the configuration does not fit the recording.
    pub fn new(
        config: &SignalConfig,
        channels_in: usize,
        resample: Option<Converter>,
        sample_rate: f64,
    ) -> Result<Self, String> {
        let channels = channels_out(&config.channels, channels_in)?;
        let resample = resample
            .map(|converter| converter.stream(channels))
            .transpose()
            .map_err(|e| e.to_string())?;
        Ok(Self {
            rule: config.channels.clone(),
            channels_in,
            channels,
            resample,
            preemphasis: config.preemphasis as f32,
            before: Vec::new(),
            held: (config.normalize != Normalize::None).then(|| (config.normalize, Vec::new())),
            remaining: (config.length > 0.0).then(|| (config.length * sample_rate).round() as u64),
            begun: false,
            mixed: Vec::new(),
        })
    }

    /// Whether blocks pass unchanged.
    pub fn is_identity(&self) -> bool {
        self.rule == Channels::All
            && self.resample.is_none()
            && self.preemphasis == 0.0
            && self.held.is_none()
            && self.remaining.is_none()
    }

    /// Whether every output frame depends on one input frame at the same position and the one before it
    /// only, so that a stretch can be computed apart. The stretches that are read begin earlier than
    /// features need (see `reading::compute`): their first frame, which has none before it, is not used.
    pub fn is_local(config: &SignalConfig, resampled: bool) -> bool {
        !resampled && Self::piece_refusal(config).is_none()
    }

    /// Why a stretch of a signal cannot be computed apart, whatever its sample rate.
    pub fn piece_refusal(config: &SignalConfig) -> Option<&'static str> {
        if config.normalize != Normalize::None {
            Some("signal.normalize needs the level of the whole recording")
        } else if config.length != 0.0 {
            Some("signal.length cuts or fills the whole recording")
        } else {
            None
        }
    }

    /// Takes interleaved input frames, appends interleaved output frames.
    pub fn push(&mut self, input: &[f32], out: &mut Vec<f32>) {
        let from = out.len();
        self.begun |= !input.is_empty();
        match self.resample.take() {
            None => mix(&self.rule, self.channels_in, input, out),
            Some(mut stream) => {
                self.mixed.clear();
                mix(&self.rule, self.channels_in, input, &mut self.mixed);
                stream.push(&self.mixed, out).expect("whole frames");
                self.resample = Some(stream);
            }
        }
        self.emphasize(&mut out[from..]);
        match &mut self.held {
            Some((_, held)) => held.extend(out.drain(from..)),
            None => self.cut(out, from),
        }
    }

    /// Hands what remains at the end of the recording to `push`, in blocks, with the silence of a
    /// configured length that the recording does not have. Whether it came to its end: `push` says
    /// whether to go on.
    ///
    /// # Errors
    /// Those of `push`.
    pub fn finish<E>(mut self, mut push: impl FnMut(&[f32]) -> Result<bool, E>) -> Result<bool, E> {
        let mut rest = Vec::new();
        if let Some(stream) = self.resample.take() {
            stream.finish(&mut rest);
        }
        self.emphasize(&mut rest);
        if let Some((rule, mut held)) = self.held.take() {
            held.append(&mut rest);
            normalize(rule, &mut held);
            rest = held;
        }
        self.cut(&mut rest, 0);
        if !push(&rest)? {
            return Ok(false);
        }
        let mut silence = self.remaining.filter(|_| self.begun).unwrap_or(0);
        let room = (SILENCE / self.channels).max(1);
        rest.clear();
        rest.resize(room.min(usize::try_from(silence).unwrap_or(room)) * self.channels, 0.0);
        while silence > 0 {
            let frames = silence.min(room as u64);
            if !push(&rest[..frames as usize * self.channels])? {
                return Ok(false);
            }
            silence -= frames;
        }
        Ok(true)
    }

    /// Pre-emphasis of whole frames.
    fn emphasize(&mut self, frames: &mut [f32]) {
        if self.preemphasis != 0.0 {
            for frame in frames.chunks_exact_mut(self.channels) {
                if self.before.is_empty() {
                    self.before.extend_from_slice(frame);
                    continue;
                }
                for (x, before) in frame.iter_mut().zip(&mut self.before) {
                    let current = *x;
                    *x -= self.preemphasis * *before;
                    *before = current;
                }
            }
        }
    }

    /// Cuts the frames after `from` to the configured length.
    fn cut(&mut self, out: &mut Vec<f32>, from: usize) {
        if let Some(remaining) = &mut self.remaining {
            let given = ((out.len() - from) / self.channels) as u64;
            let kept = given.min(*remaining);
            out.truncate(from + kept as usize * self.channels);
            *remaining -= kept;
        }
    }
}

/// Brings a whole signal to a common level; silence stays as it is.
fn normalize(rule: Normalize, signal: &mut [f32]) {
    let level = match rule {
        Normalize::None => return,
        Normalize::Peak => signal.iter().fold(0.0, |m: f32, x| m.max(x.abs())),
        Normalize::Rms => {
            let sum: f64 = signal.iter().map(|x| f64::from(*x) * f64::from(*x)).sum();
            (sum / signal.len().max(1) as f64).sqrt() as f32
        }
    };
    if level > 0.0 {
        signal.iter_mut().for_each(|x| *x /= level);
    }
}

/// Applies a channel rule to interleaved frames.
fn mix(rule: &Channels, channels: usize, input: &[f32], out: &mut Vec<f32>) {
    let kept = match rule {
        Channels::All => return out.extend_from_slice(input),
        Channels::Mean if channels == 1 => return out.extend_from_slice(input),
        Channels::Mean | Channels::Downmix71 => 1,
        Channels::List(list) => list.len(),
    };
    let from = out.len();
    out.resize(from + input.len() / channels * kept, 0.0);
    let out = &mut out[from..];
    vectorized(
        #[inline(always)]
        || match rule {
            // Summed channel by channel in single precision, as numpy's mean over axis 0.
            Channels::Mean if channels == 8 => {
                for (out, frame) in out.iter_mut().zip(input.as_chunks::<8>().0) {
                    *out = frame.iter().fold(0.0, |sum, x| sum + x) / 8.0;
                }
            }
            Channels::All | Channels::Mean => {
                for (out, frame) in out.iter_mut().zip(input.chunks_exact(channels)) {
                    *out = frame.iter().fold(0.0, |sum, x| sum + x) / channels as f32;
                }
            }
            Channels::Downmix71 => {
                let weights = downmix_71_weights();
                for (out, frame) in out.iter_mut().zip(input.as_chunks::<8>().0) {
                    let weighted = frame.iter().zip(&weights).map(|(x, w)| f64::from(*x) * w);
                    *out = weighted.sum::<f64>() as f32;
                }
            }
            Channels::List(list) => {
                for (i, channel) in list.iter().enumerate() {
                    let frames = input.chunks_exact(channels).map(|frame| frame[*channel]);
                    let slots = out.iter_mut().skip(i).step_by(kept);
                    slots.zip(frames).for_each(|(out, x)| *out = x);
                }
            }
        },
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(config: &SignalConfig, channels: usize, input: &[f32], block: usize) -> Vec<f32> {
        let plan = (config.sample_rate > 0.0)
            .then(|| Converter::new(44100.0, config.sample_rate, config.res_type).unwrap());
        let mut front = SignalChain::new(config, channels, plan, 100.0).unwrap();
        let mut out = Vec::new();
        input.chunks(block * channels).for_each(|b| front.push(b, &mut out));
        let whole = front.finish(|block| {
            out.extend_from_slice(block);
            Ok::<_, ()>(true)
        });
        assert_eq!(whole, Ok(true));
        out
    }

    #[test]
    fn channel_rules() {
        let frame: Vec<f32> = (1..=8).map(|i| i as f32).collect();
        let with = |channels| SignalConfig { channels, ..SignalConfig::default() };
        assert_eq!(run(&with(Channels::Mean), 8, &frame, 1), [4.5]);
        assert_eq!(run(&with(Channels::List(vec![7, 0])), 8, &frame, 1), [8.0, 1.0]);
        let h = std::f32::consts::FRAC_1_SQRT_2;
        let want = (h + 2.0 * h + 3.0 + 0.5 * (5.0 + 6.0 + 7.0 + 8.0)) / (2.0 * h + 3.0);
        assert!((run(&with(Channels::Downmix71), 8, &frame, 1)[0] - want).abs() < 1e-6);
        assert!(channels_out(&Channels::Downmix71, 2).is_err());
        assert!(channels_out(&Channels::List(vec![2]), 2).is_err());
    }

    #[test]
    fn the_level_is_set_before_the_length() {
        let with = |normalize| SignalConfig { normalize, length: 0.04, ..SignalConfig::default() };
        for block in 1..3 {
            assert_eq!(run(&with(Normalize::Rms), 1, &[3.0, -3.0], block), [1.0, -1.0, 0.0, 0.0]);
            let cut = run(&with(Normalize::Peak), 1, &[1.0, 2.0, 0.0, 1.0, 4.0], block);
            assert_eq!(cut, [0.25, 0.5, 0.0, 0.25]);
        }
        assert_eq!(run(&with(Normalize::Peak), 1, &[0.0; 5], 2), [0.0; 4]);
    }

    #[test]
    fn nothing_is_not_filled_up() {
        let config = SignalConfig { length: 0.12, ..SignalConfig::default() };
        assert!(run(&config, 1, &[], 1).is_empty());
        assert_eq!(run(&config, 1, &[0.5], 1).len(), 12);
    }

    #[test]
    fn pre_emphasis_and_length_do_not_depend_on_blocks() {
        let config = SignalConfig { preemphasis: 0.5, length: 0.12, ..SignalConfig::default() };
        let input: Vec<f32> = (0..10).map(|i| (i * i) as f32).collect();
        let whole = run(&config, 1, &input, 10);
        assert_eq!(whole.len(), 12);
        assert_eq!(whole[..3], [0.0, 1.0, 3.5]);
        assert_eq!(whole[10..], [0.0, 0.0]);
        for block in 1..10 {
            assert_eq!(run(&config, 1, &input, block), whole);
        }
    }
}
