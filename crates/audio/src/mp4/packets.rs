//! The packets of a track, from its table and from fragments.

use super::boxes;
use super::fragments::Fragments;
use super::table::{Packet, Packets};
use crate::error::AudioError;
use crate::input::Input;

/// Largest packet: 8 channels of 32 bits in the largest frame of ALAC, and more.
const MAX_PACKET: u32 = 4 << 20;

/// Where packets come from.
pub(super) struct Source {
    pub(super) packets: Packets,
    /// Whether the packets of the table follow each other, from `floor` on.
    pub(super) is_in_order: bool,
    pub(super) floor: u64,
    pub(super) base: u64,
    pub(super) fragments: Option<Fragments>,
}

/// What became of the bytes of a packet.
pub(super) enum Found {
    Bytes(Vec<u8>),
    /// They cannot be a packet.
    Senseless,
    /// The file ends before them.
    Missing,
}

impl Source {
    pub(super) fn next(&mut self, input: &mut Input) -> Result<Option<Packet>, AudioError> {
        if let Some(packet) = self.packets.next() {
            return Ok(Some(packet));
        }
        match &mut self.fragments {
            Some(fragments) => {
                let packet = fragments.next(input)?;
                // From here on, bytes are counted as in the file.
                self.base = 0;
                Ok(packet)
            }
            None => Ok(None),
        }
    }

    /// Takes the bytes of a packet.
    pub(super) fn bytes(
        &mut self,
        input: &mut Input,
        packet: &Packet,
    ) -> Result<Found, AudioError> {
        let offset = packet.offset.saturating_add(self.base);
        if !packet.is_described || packet.size == 0 || packet.size > MAX_PACKET {
            return Ok(Found::Senseless);
        }
        if offset < self.floor {
            return Ok(Found::Senseless);
        }
        let is_there = match (&mut self.fragments, offset.checked_sub(input.position())) {
            (Some(fragments), _) => {
                if offset < input.position() {
                    return Ok(Found::Senseless);
                }
                fragments.reach(input, offset)?
            }
            (None, Some(ahead)) => input.skip(ahead)?,
            (None, None) if input.len().is_some() => {
                input.seek(offset)?;
                true
            }
            (None, None) => return Ok(Found::Senseless),
        };
        if !is_there {
            return Ok(Found::Missing);
        }
        let size = packet.size as usize;
        let bytes = boxes::take(input, size)?;
        Ok(if bytes.len() == size { Found::Bytes(bytes) } else { Found::Missing })
    }
}
