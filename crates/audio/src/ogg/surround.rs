//! Vorbis that symphonia does not decode rightly, by lewton.

use lewton::audio::{PreviousWindowRight, read_audio_packet_generic};
use lewton::header::{IdentHeader, SetupHeader, read_header_ident, read_header_setup};

use super::order;
use crate::codec::{Decoded, PacketDecoder, Refusal, guarded};

/// A decoder of Vorbis for any arrangement of channels.
pub(super) struct Surround {
    identification: IdentHeader,
    setup: SetupHeader,
    window: PreviousWindowRight,
    /// Where in a frame each channel goes.
    order: Vec<usize>,
}

impl Surround {
    /// From the identification and the setup packet.
    pub(super) fn new(first: &[u8], setup: &[u8]) -> Result<Self, Refusal> {
        let broken = |_| Refusal::Corrupt("broken headers of Vorbis".into());
        guarded(|| {
            let identification = read_header_ident(first).map_err(broken)?;
            let blocks = (identification.blocksize_0, identification.blocksize_1);
            let channels = identification.audio_channels;
            let setup = read_header_setup(setup, channels, blocks).map_err(broken)?;
            let order = order::of(channels.into());
            Ok(Self { identification, setup, window: PreviousWindowRight::new(), order })
        })?
    }
}

impl PacketDecoder for Surround {
    fn decode(&mut self, packet: &[u8], samples: &mut Vec<f32>) -> Result<Decoded, Refusal> {
        samples.clear();
        let Self { identification, setup, window, order } = self;
        let decoded = guarded(|| {
            read_audio_packet_generic::<Vec<Vec<f32>>>(identification, setup, packet, window)
        })?;
        let Ok(planes) = decoded else {
            self.reset();
            return Ok(Decoded::Damaged);
        };
        let frames = planes.first().map_or(0, Vec::len);
        let channels = order.len();
        samples.resize(frames * channels, 0.0);
        for (plane, &channel) in planes.iter().zip(order.iter()) {
            for (frame, &sample) in samples.chunks_exact_mut(channels).zip(plane) {
                frame[channel] = sample;
            }
        }
        Ok(Decoded::Frames(frames))
    }

    fn reset(&mut self) {
        self.window = PreviousWindowRight::new();
    }
}
