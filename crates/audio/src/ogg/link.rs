//! One logical stream of Ogg: its headers, its decoder and the lengths of its packets.

use super::lazy::Lazy;
use super::opus::{self, Opus};
use super::page::Page;
use super::surround::Surround;
use super::vorbis::{self, Identification, Setup};
use crate::codec::{Codec, Decoded, PacketDecoder, Refusal};
use crate::error::AudioError;
use crate::flac;
use crate::input::Input;
use crate::pcm::{MAX_CHANNELS, MAX_SAMPLE_RATE};
use crate::source::SampleEncoding;

pub(super) const EXPECTED: &str = "Ogg Vorbis, Opus or FLAC of 1 to 64 channels and 1 to 768000 Hz";

/// The codec of a stream.
enum Kind {
    Vorbis {
        identification: Identification,
        modes: Vec<bool>,
        /// Length of the block before; `None` where the decoder starts anew.
        before: Option<u32>,
        /// For lewton: whether the last packet mended was long, where there was one.
        mended: Option<Option<bool>>,
    },
    Flac,
    Opus,
}

/// A stream from its headers on.
pub(super) struct Link {
    pub(super) serial: u32,
    pub(super) sample_rate: u32,
    pub(super) channels: u16,
    pub(super) name: &'static str,
    kind: Kind,
    codec: Box<dyn PacketDecoder>,
    /// Samples per channel to drop at the start.
    pub(super) skip: u64,
}

/// Codecs by the first bytes of their first packet.
const NAMES: [(&[u8], &str); 12] = [
    (b"\x01vorbis", "vorbis"),
    (b"\x7fFLAC", "flac"),
    (b"OpusHead", "opus"),
    (b"Speex   ", "Speex"),
    (b"\x80theora", "Theora (video)"),
    (b"fishead\0", "Skeleton"),
    (b"PCM     ", "OggPCM"),
    (b"CELT    ", "CELT"),
    (b"\x80kate", "Kate (text)"),
    (b"OggMIDI\0", "OggMIDI"),
    (b"BBCD\0", "Dirac (video)"),
    (b"\x01video", "OGM (video)"),
];

fn name_of(packet: &[u8]) -> &'static str {
    let known = NAMES.iter().find(|(mark, _)| packet.starts_with(mark));
    known.map_or("an unknown codec", |(_, name)| name)
}

/// Whether a first page is that of a stream which is read.
pub(super) fn is_read(page: &Page) -> bool {
    ["vorbis", "flac", "opus"].contains(&name_of(page.body()))
}

impl Link {
    /// Reads the headers of the first stream that is read among those that begin with `page` and
    /// the first pages after it. `packets` receives those after the headers; `page` is the one
    /// in which the headers end.
    pub(super) fn open(
        input: &mut Input,
        page: &mut Page,
        partial: &mut Option<Vec<u8>>,
        packets: &mut Vec<Vec<u8>>,
    ) -> Result<Self, AudioError> {
        let at = page.offset;
        let early = || AudioError::corrupt(at, "an Ogg stream that ends in its headers", EXPECTED);
        let mut first: Option<(u32, &str)> = None;
        let mut others = Vec::new();
        packets.clear();
        *partial = None;
        while page.is_first {
            if first.is_none() && is_read(page) {
                first = Some((page.serial, name_of(page.body())));
                page.packets(partial, packets);
            } else {
                let name = name_of(page.body());
                if !others.contains(&name) {
                    others.push(name);
                }
            }
            if !page.read(input)? {
                break;
            }
        }
        let Some((serial, name)) = first else {
            let actual = format!("Ogg with {}", others.join(", "));
            return Err(AudioError::unsupported(at, actual, EXPECTED));
        };
        let headers = match name {
            "vorbis" => 3,
            "opus" => 2,
            _ => 1,
        };
        while packets.len() < headers {
            if page.serial == serial && !page.is_first {
                page.packets(partial, packets);
            }
            if packets.len() < headers && !page.read(input)? {
                return Err(early());
            }
        }
        let rest = packets.split_off(headers);
        let found = std::mem::replace(packets, rest);
        let link = match name {
            "vorbis" => vorbis_link(&found),
            "opus" => opus_link(&found),
            _ => flac_link(&found),
        };
        let link = link.map_err(|refusal| refusal.at(at, EXPECTED))?;
        let (channels, sample_rate) = (link.channels, link.sample_rate);
        if channels > MAX_CHANNELS || !(1..=MAX_SAMPLE_RATE).contains(&sample_rate) {
            let actual = format!("{name} of {channels} channels at {sample_rate} Hz");
            return Err(AudioError::unsupported(at, actual, EXPECTED));
        }
        Ok(Self { serial, ..link })
    }

    /// Samples per channel that a packet will give; `None` where it is none of audio.
    pub(super) fn length(&mut self, packet: &[u8]) -> Option<u32> {
        match &mut self.kind {
            Kind::Vorbis { identification, modes, before, .. } => {
                let is_long = vorbis::is_long(packet, modes)?;
                let block = identification.blocks[usize::from(is_long)];
                Some(before.replace(block).map_or(0, |before| (before + block) / 4))
            }
            Kind::Flac => flac::block_of(packet),
            Kind::Opus => opus::length(packet),
        }
    }

    pub(super) fn encoding(&self) -> SampleEncoding {
        match self.kind {
            Kind::Vorbis { .. } | Kind::Opus => SampleEncoding::Lossy,
            Kind::Flac => SampleEncoding::Lossless,
        }
    }

    /// Forgets the packets before.
    pub(super) fn reset(&mut self) {
        self.codec.reset();
        if let Kind::Vorbis { before, mended, .. } = &mut self.kind {
            *before = None;
            *mended = mended.map(|_| None);
        }
    }

    /// Makes packets that follow each other say of their neighbours what these are: lewton believes
    /// them, and encoders have it wrong at the end of a stream.
    pub(super) fn mend(&mut self, packets: &mut [Vec<u8>]) {
        let Kind::Vorbis { modes, mended: Some(before), .. } = &mut self.kind else { return };
        for i in 0..packets.len() {
            let next = packets.get(i + 1).and_then(|packet| vorbis::is_long(packet, modes));
            vorbis::set_neighbours(&mut packets[i], modes, *before, next);
            *before = vorbis::is_long(&packets[i], modes);
        }
    }

    /// See [`Codec::decode`].
    pub(super) fn decode(
        &mut self,
        packet: &[u8],
        samples: &mut Vec<f32>,
    ) -> Result<Decoded, Refusal> {
        self.codec.decode(packet, samples)
    }
}

fn vorbis_link(headers: &[Vec<u8>]) -> Result<Link, Refusal> {
    let broken = || Refusal::Corrupt("broken headers of Vorbis".into());
    let [first, _, setup_packet] = headers else { return Err(broken()) };
    let identification = Identification::parse(first).ok_or_else(broken)?;
    let Identification { channels, sample_rate, .. } = identification;
    let Setup { modes, is_simple } = Setup::parse(setup_packet, channels).ok_or_else(broken)?;
    let (first, setup_packet) = (first.clone(), setup_packet.clone());
    let codec = Lazy::new(move || -> Result<Box<dyn PacketDecoder>, Refusal> {
        if !is_simple {
            return Ok(Box::new(Surround::new(&first, &setup_packet)?));
        }
        let headers = [first.as_slice(), &setup_packet].concat();
        Ok(Box::new(Codec::vorbis(&headers, channels.into(), sample_rate)?))
    });
    let mended = (!is_simple).then_some(None);
    let kind = Kind::Vorbis { identification, modes, before: None, mended };
    let (channels, name) = (channels.into(), "ogg vorbis");
    Ok(Link { serial: 0, sample_rate, channels, name, kind, codec: Box::new(codec), skip: 0 })
}

fn opus_link(headers: &[Vec<u8>]) -> Result<Link, Refusal> {
    let broken = || Refusal::Corrupt("a broken header of Opus".into());
    let (codec, channels, skip) =
        headers.first().and_then(|h| Opus::new(h)).ok_or_else(broken)??;
    let (sample_rate, name, kind) = (opus::SAMPLE_RATE, "ogg opus", Kind::Opus);
    Ok(Link { serial: 0, sample_rate, channels, name, kind, codec: Box::new(codec), skip })
}

/// The first packet holds a mark, a version, a count of headers, then the start of a FLAC file.
fn flac_link(headers: &[Vec<u8>]) -> Result<Link, Refusal> {
    let broken = || Refusal::Corrupt("a broken header of FLAC in Ogg".into());
    let body = headers.first().and_then(|packet| packet.get(9..));
    let (codec, channels, sample_rate) = body.and_then(flac::codec_of).ok_or_else(broken)??;
    let (name, kind) = ("ogg flac", Kind::Flac);
    Ok(Link { serial: 0, sample_rate, channels, name, kind, codec: Box::new(codec), skip: 0 })
}
