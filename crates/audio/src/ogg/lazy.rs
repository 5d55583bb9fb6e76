//! A decoder that is made for its first packet: the tables of Vorbis cost more than its headers, which
//! are all that many callers want.

use crate::codec::{Decoded, PacketDecoder, Refusal};

type Make = dyn Fn() -> Result<Box<dyn PacketDecoder>, Refusal> + Send;

/// A decoder, or how to make it.
pub(super) struct Lazy {
    make: Box<Make>,
    made: Option<Box<dyn PacketDecoder>>,
}

impl Lazy {
    pub(super) fn new(
        make: impl Fn() -> Result<Box<dyn PacketDecoder>, Refusal> + Send + 'static,
    ) -> Self {
        Self { make: Box::new(make), made: None }
    }
}

impl PacketDecoder for Lazy {
    fn decode(&mut self, packet: &[u8], samples: &mut Vec<f32>) -> Result<Decoded, Refusal> {
        let decoder = match &mut self.made {
            Some(decoder) => decoder,
            none => none.insert((self.make)()?),
        };
        decoder.decode(packet, samples)
    }

    fn reset(&mut self) {
        if let Some(decoder) = &mut self.made {
            decoder.reset();
        }
    }
}
