//! The decoder of frames, and what it cannot decode.

use super::frame::Header;
use super::info::Info;
use crate::codec::{Codec, Decoded, PacketDecoder, Refusal};

/// Bits that symphonia reads of a sample at most.
const MOST_BITS: u32 = 32;

/// A decoder of symphonia for the frames of one recording.
pub(crate) struct FlacCodec {
    codec: Codec,
    /// bits per sample
    bits: u32,
}

impl FlacCodec {
    pub(super) fn new(info: &Info) -> Result<Self, Refusal> {
        let codec = Codec::flac(&info.repaired(), info.channels.into(), info.sample_rate)?;
        Ok(Self { codec, bits: info.bits })
    }
}

impl PacketDecoder for FlacCodec {
    fn decode(&mut self, packet: &[u8], samples: &mut Vec<f32>) -> Result<Decoded, Refusal> {
        // The difference of two channels has one bit more; symphonia would give wrong samples.
        let has_side = Header::parse(packet).is_some_and(|header| header.has_side);
        if has_side && self.bits + 1 > MOST_BITS {
            return Err(Refusal::Unsupported(
                "FLAC of 32 bits that stores the difference of two channels (33 bits); `flac \
                 --no-mid-side` stores both, and a WAV is read"
                    .into(),
            ));
        }
        self.codec.decode(packet, samples)
    }

    fn reset(&mut self) {
        self.codec.reset();
    }
}
