//! Opus (RFC 6716, RFC 7845), by opus-pure.

use opus_pure::OpusDecoder;

use super::order;
use crate::codec::{Decoded, PacketDecoder, Refusal, guarded};

/// Opus is always decoded at this rate.
pub(super) const SAMPLE_RATE: u32 = 48_000;
/// Samples per channel of the longest packet, 120 ms.
const LONGEST: usize = 5760;

/// A decoder of Opus: of one stream or, with more than two channels, of several side by side.
pub(super) struct Opus {
    streams: Vec<OpusDecoder>,
    /// So many of the streams, the first ones, have two channels.
    coupled: usize,
    /// For each channel, the decoded one that it takes; 255: silence.
    mapping: Vec<u8>,
    /// Where in a frame each channel goes.
    order: Vec<usize>,
    /// Factor that the header asks for.
    gain: f32,
    decoded: Vec<f32>,
}

impl Opus {
    /// From the first packet, with the number of channels and the samples per channel to drop at the
    /// start.
    ///
    /// ```text
    /// 0 "OpusHead"  8 u8 version  9 u8 channels  10 u16 to drop  12 u32 rate before encoding
    /// 16 i16 gain in dB / 256  18 u8 family of mappings; other than 0: streams, coupled, mapping
    /// ```
    pub(super) fn new(head: &[u8]) -> Option<Result<(Self, u16, u64), Refusal>> {
        let fixed: &[u8; 19] = head.first_chunk()?;
        let channels = usize::from(fixed[9]);
        let skip = u16::from_le_bytes([fixed[10], fixed[11]]);
        let gain = i16::from_le_bytes([fixed[16], fixed[17]]);
        let family = fixed[18];
        let (streams, coupled, mapping) = match family {
            0 => (1, channels.checked_sub(1)?, [0, 1].get(..channels)?),
            _ => {
                let mapping = head.get(21..21 + channels)?;
                (usize::from(*head.get(19)?), usize::from(*head.get(20)?), mapping)
            }
        };
        let is_known = |&slot: &u8| slot == 255 || usize::from(slot) < streams + coupled;
        if streams == 0 || coupled > streams || channels == 0 || !mapping.iter().all(is_known) {
            return None;
        }
        let order = if family == 1 { order::of(channels) } else { (0..channels).collect() };
        let decoder = |i| OpusDecoder::new(SAMPLE_RATE as i32, width(i, coupled)).ok();
        let streams = match guarded(|| (0..streams).map(decoder).collect::<Option<Vec<_>>>()) {
            Ok(streams) => streams?,
            Err(refusal) => return Some(Err(refusal)),
        };
        let gain = 10f32.powf(f32::from(gain) / (20.0 * 256.0));
        let (mapping, decoded) = (mapping.to_vec(), vec![0.0; 2 * LONGEST]);
        let opus = Self { streams, coupled, mapping, order, gain, decoded };
        Some(Ok((opus, channels as u16, skip.into())))
    }

    /// Puts the decoded samples of a stream where the mapping wants them.
    fn place(&self, stream: usize, frames: usize, samples: &mut [f32]) {
        let width = width(stream, self.coupled);
        let first = stream + stream.min(self.coupled);
        for (slot, &channel) in self.mapping.iter().zip(&self.order) {
            let Some(from) = usize::from(*slot).checked_sub(first).filter(|c| *c < width) else {
                continue;
            };
            let decoded = self.decoded[..frames * width].chunks_exact(width);
            for (frame, decoded) in samples.chunks_exact_mut(self.order.len()).zip(decoded) {
                frame[channel] = decoded[from] * self.gain;
            }
        }
    }
}

impl PacketDecoder for Opus {
    fn decode(&mut self, packet: &[u8], samples: &mut Vec<f32>) -> Result<Decoded, Refusal> {
        samples.clear();
        let Some(frames) = length(packet).map(|n| n as usize) else { return Ok(Decoded::Damaged) };
        let Some(packets) = split(packet, self.streams.len()) else { return Ok(Decoded::Damaged) };
        samples.resize(frames * self.order.len(), 0.0);
        for (stream, packet) in packets.iter().enumerate() {
            let decoded = &mut self.decoded[..frames * width(stream, self.coupled)];
            let decoder = &mut self.streams[stream];
            match guarded(|| decoder.decode(packet, frames, decoded))? {
                Ok(n) if n == frames => self.place(stream, frames, samples),
                _ => return Ok(Decoded::Damaged),
            }
        }
        Ok(Decoded::Frames(frames))
    }

    fn reset(&mut self) {
        for stream in &mut self.streams {
            // Fails for no decoder that could be made.
            let _ = stream.reset_state();
        }
    }
}

/// Channels of a stream, of which the first `coupled` have two.
fn width(stream: usize, coupled: usize) -> usize {
    if stream < coupled { 2 } else { 1 }
}

/// The packets of the streams in one packet: all but the last tell their own length (RFC 6716,
/// appendix B), which is taken out of them.
fn split(packet: &[u8], streams: usize) -> Option<Vec<Vec<u8>>> {
    let mut rest = packet;
    let mut packets = Vec::with_capacity(streams);
    for _ in 1..streams {
        let (packet, length) = undelimited(rest)?;
        packets.push(packet);
        rest = &rest[length..];
    }
    packets.push(rest.to_vec());
    Some(packets)
}

/// A packet that tells its length as one that does not, and how many bytes it was.
fn undelimited(bytes: &[u8]) -> Option<(Vec<u8>, usize)> {
    let &first = bytes.first()?;
    let mut at = 1;
    let mut sizes = 0;
    // How many lengths stand before the one that the other form leaves out, and how often that counts.
    let (before, times) = match first & 3 {
        0 => (0, 1),
        1 => (0, 2),
        2 => (1, 1),
        _ => {
            let &counts = bytes.get(1)?;
            at = 2;
            if counts & 0x40 != 0 {
                loop {
                    let &n = bytes.get(at)?;
                    at += 1;
                    sizes += usize::from(n.min(254));
                    if n < 255 {
                        break;
                    }
                }
            }
            let frames = usize::from(counts & 63);
            if counts & 0x80 != 0 { (frames.checked_sub(1)?, 1) } else { (0, frames) }
        }
    };
    let mut take = || {
        let &n = bytes.get(at)?;
        let (size, used) = if n < 252 {
            (usize::from(n), 1)
        } else {
            (usize::from(n) + 4 * usize::from(*bytes.get(at + 1)?), 2)
        };
        at += used;
        Some((size, used))
    };
    for _ in 0..before {
        sizes += take()?.0;
    }
    let (last, used) = take()?;
    let (data, end) = (at, at + sizes + last * times);
    let packet = [&bytes[..data - used], bytes.get(data..end)?].concat();
    Some((packet, end))
}

/// Samples per channel of a packet, by its first byte (RFC 6716, section 3.1): the configuration
/// says how long its frames are, the code how many there are.
pub(super) fn length(packet: &[u8]) -> Option<u32> {
    let first = *packet.first()?;
    let frame = match first >> 3 {
        config @ 0..=11 => [480, 960, 1920, 2880][usize::from(config & 3)],
        config @ 12..=15 => [480, 960][usize::from(config & 1)],
        config => 120 << (config & 3),
    };
    let frames = match first & 3 {
        0 => 1,
        1 | 2 => 2,
        _ => u32::from(*packet.get(1)? & 63),
    };
    Some(frame * frames).filter(|n| *n as usize <= LONGEST)
}
