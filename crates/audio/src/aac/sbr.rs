//! Whether packets carry spectral band replication that no header speaks of.
//!
//! It stands in a fill element after the channels, and where those end only their decoder knows. So
//! the fill element is looked for from the end of the packet backwards, and the decoder then says
//! whether the channels end where it begins.

use super::bits::Bits;
use super::config::{Config, FRAME, HE};
use crate::codec::{Codec, Decoded, PacketDecoder, Refusal};

/// Packets that are looked at; each must carry it.
pub(crate) const LOOKED_AT: usize = 3;
const FILL: u32 = 6;
const END: u32 = 7;
/// Largest fill element, in bytes.
const MOST: usize = 269;

/// Refuses packets, the first ones of a stream, that carry it.
pub(crate) fn refuse<'a>(
    packets: impl Iterator<Item = &'a [u8]>,
    config: &Config,
) -> Result<(), Refusal> {
    let mut codec = config.codec()?;
    let mut count = 0;
    for packet in packets.take(LOOKED_AT) {
        if !carries(packet, &mut codec)? {
            return Ok(());
        }
        count += 1;
    }
    if count > 0 { Err(Refusal::Unsupported(HE.into())) } else { Ok(()) }
}

fn carries(packet: &[u8], codec: &mut Codec) -> Result<bool, Refusal> {
    let Some(last) = packet.last().filter(|byte| **byte != 0) else { return Ok(false) };
    // The end mark, then zeros up to the next byte.
    let Some(end) = (8 * packet.len()).checked_sub(last.trailing_zeros() as usize + 3) else {
        return Ok(false);
    };
    if Bits::from(packet, end).take(3) != Some(END) {
        return Ok(false);
    }
    // Another fill element may follow that of the replication.
    let mut ends = vec![end];
    ends.extend(fills(packet, end).map(|(start, _)| start));
    for end in ends {
        for (start, _) in fills(packet, end).filter(|(_, kind)| matches!(kind, 13 | 14)) {
            if ends_at(packet, start, codec)? {
                return Ok(true);
            }
        }
    }
    Ok(false)
}

/// What may be a fill element that ends at bit `end`: where it begins, and the kind of its contents.
fn fills(packet: &[u8], end: usize) -> impl Iterator<Item = (usize, u32)> + '_ {
    (1..=MOST).filter_map(move |count| {
        let head = if count < 15 { 7 } else { 15 };
        let start = end.checked_sub(8 * count + head)?;
        let mut bits = Bits::from(packet, start);
        let is_fill = bits.take(3)? == FILL
            && match bits.take(4)? {
                15 => bits.take(8)? as usize + 14 == count,
                length => length as usize == count,
            };
        let kind = bits.take(4)?;
        is_fill.then_some((start, kind))
    })
}

/// Whether the channels of a packet end at a bit: what stands before it can be decoded.
fn ends_at(packet: &[u8], at: usize, codec: &mut Codec) -> Result<bool, Refusal> {
    let mut head = packet[..at.div_ceil(8)].to_vec();
    head.push(0);
    for bit in 0..16 {
        let place = at + bit;
        if let Some(byte) = head.get_mut(place / 8) {
            let mask = 0x80 >> (place % 8);
            if bit < 3 { *byte |= mask } else { *byte &= !mask }
        }
    }
    head.truncate((at + 3).div_ceil(8));
    codec.reset();
    Ok(codec.decode(&head, &mut Vec::new())? == Decoded::Frames(FRAME as usize))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Appends the lowest bits of a number.
    fn put(bits: &mut Vec<bool>, value: u32, count: usize) {
        bits.extend((0..count).rev().map(|at| value >> at & 1 == 1));
    }

    /// A packet of silence, one channel, with fill elements: kind and length.
    fn packet(fills: &[(u32, u32)]) -> Vec<u8> {
        let mut bits = Vec::new();
        // Single channel, gain, one long window without bands, no pulses, shaping, gain control.
        for (value, count) in
            [(0, 3), (0, 4), (100, 8), (0, 1), (0, 2), (0, 1), (0, 6), (0, 1), (0, 3)]
        {
            put(&mut bits, value, count);
        }
        for (kind, length) in fills {
            put(&mut bits, FILL, 3);
            if *length < 15 {
                put(&mut bits, *length, 4);
            } else {
                put(&mut bits, 15, 4);
                put(&mut bits, length - 14, 8);
            }
            put(&mut bits, *kind, 4);
            (0..8 * length - 4).for_each(|at| bits.push(at % 3 == 1));
        }
        put(&mut bits, END, 3);
        bits.chunks(8)
            .map(|byte| {
                byte.iter().enumerate().fold(0, |n, (at, bit)| n | u8::from(*bit) << (7 - at))
            })
            .collect()
    }

    fn is_refused(packets: &[Vec<u8>]) -> bool {
        let config = Config { sample_rate: 22_050, channels: 1 };
        match refuse(packets.iter().map(Vec::as_slice), &config) {
            Err(Refusal::Unsupported(what)) => what == HE,
            Err(Refusal::Corrupt(what)) => panic!("{what}"),
            Ok(()) => false,
        }
    }

    #[test]
    fn replication_is_found_where_every_packet_has_it() {
        for length in [5, 14, 15, 16, 60, 269] {
            let he = packet(&[(13, length)]);
            assert!(is_refused(std::slice::from_ref(&he)), "{length}");
            assert!(is_refused(&[he.clone(), packet(&[(14, length), (0, 40)]), he.clone()]));
            assert!(!is_refused(&[he.clone(), packet(&[]), he]));
        }
        assert!(!is_refused(&[packet(&[(0, 60)]), packet(&[(1, 14)]), packet(&[(11, 3)])]));
        assert!(!is_refused(&[vec![], vec![0], vec![0xff]]) && !is_refused(&[]));
    }
}
