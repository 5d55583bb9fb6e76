//! Decoders, one packet at a time; here those of symphonia.

use std::panic::{AssertUnwindSafe, catch_unwind};

use symphonia::core::codecs::audio::well_known::{
    CODEC_ID_AAC, CODEC_ID_ALAC, CODEC_ID_FLAC, CODEC_ID_MP1, CODEC_ID_MP2, CODEC_ID_MP3,
    CODEC_ID_VORBIS,
};
use symphonia::core::codecs::audio::{
    AudioCodecId, AudioCodecParameters, AudioDecoder, AudioDecoderOptions,
};
use symphonia::core::errors::Error;
use symphonia::core::packet::PacketRef;
use symphonia::core::units::{Duration, Timestamp};

use crate::error::AudioError;

/// Why there is no decoder, in words; what it said is about the stream, not about a packet.
pub(crate) enum Refusal {
    /// Nothing that symphonia decodes.
    Unsupported(String),
    /// Headers that contradict themselves, or a panic.
    Corrupt(String),
}

impl Refusal {
    /// The same as an error at a byte.
    pub(crate) fn at(self, offset: u64, expected: &'static str) -> AudioError {
        match self {
            Self::Unsupported(what) => AudioError::unsupported(offset, what, expected),
            Self::Corrupt(what) => AudioError::corrupt(offset, what, expected),
        }
    }
}

/// What became of a packet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Decoded {
    /// So many frames; none where the decoder only starts.
    Frames(usize),
    /// It cannot be decoded.
    Damaged,
}

/// A decoder of packets.
pub(crate) trait PacketDecoder: Send {
    /// Replaces the contents of `samples` by the interleaved samples of a packet.
    ///
    /// # Errors
    /// The decoder panicked, or the packet is of a kind that it would decode wrongly.
    fn decode(&mut self, packet: &[u8], samples: &mut Vec<f32>) -> Result<Decoded, Refusal>;

    /// Forgets the packets before.
    fn reset(&mut self);
}

/// A decoder of symphonia.
pub(crate) struct Codec {
    decoder: Box<dyn AudioDecoder>,
    channels: usize,
    sample_rate: u32,
}

impl Codec {
    /// MPEG audio of layer 1, 2 or 3.
    pub(crate) fn mpeg(layer: u8, channels: usize, sample_rate: u32) -> Result<Self, Refusal> {
        let id = match layer {
            1 => CODEC_ID_MP1,
            2 => CODEC_ID_MP2,
            _ => CODEC_ID_MP3,
        };
        Self::new(id, None, channels, sample_rate)
    }

    /// FLAC; `stream_info` is the body of that block.
    pub(crate) fn flac(
        stream_info: &[u8],
        channels: usize,
        sample_rate: u32,
    ) -> Result<Self, Refusal> {
        Self::new(CODEC_ID_FLAC, Some(stream_info), channels, sample_rate)
    }

    /// AAC; `config` is its AudioSpecificConfig.
    pub(crate) fn aac(config: &[u8], channels: usize, sample_rate: u32) -> Result<Self, Refusal> {
        Self::new(CODEC_ID_AAC, Some(config), channels, sample_rate)
    }

    /// ALAC; `cookie` is its description of 24 or 48 bytes.
    pub(crate) fn alac(cookie: &[u8], channels: usize, sample_rate: u32) -> Result<Self, Refusal> {
        Self::new(CODEC_ID_ALAC, Some(cookie), channels, sample_rate)
    }

    /// Vorbis; `headers` are the identification and the setup packet.
    pub(crate) fn vorbis(
        headers: &[u8],
        channels: usize,
        sample_rate: u32,
    ) -> Result<Self, Refusal> {
        Self::new(CODEC_ID_VORBIS, Some(headers), channels, sample_rate)
    }

    fn new(
        id: AudioCodecId,
        extra: Option<&[u8]>,
        channels: usize,
        sample_rate: u32,
    ) -> Result<Self, Refusal> {
        let mut params = AudioCodecParameters::new();
        params.for_codec(id).with_sample_rate(sample_rate);
        if let Some(extra) = extra {
            params.with_extra_data(extra.into());
        }
        let made = guarded(|| {
            symphonia::default::get_codecs()
                .make_audio_decoder(&params, &AudioDecoderOptions::default())
        })?;
        match made {
            Ok(decoder) => Ok(Self { decoder, channels, sample_rate }),
            Err(Error::Unsupported(what)) => Err(Refusal::Unsupported(what.into())),
            Err(error) => Err(Refusal::Corrupt(in_words(&error))),
        }
    }
}

impl PacketDecoder for Codec {
    fn decode(&mut self, packet: &[u8], samples: &mut Vec<f32>) -> Result<Decoded, Refusal> {
        samples.clear();
        let packet = PacketRef::new(0, Timestamp::ZERO, Duration::ZERO, packet);
        let (channels, sample_rate) = (self.channels, self.sample_rate);
        let decoder = &mut self.decoder;
        guarded(|| match decoder.decode_ref(&packet) {
            Ok(audio) if audio.is_empty() => Decoded::Frames(0),
            Ok(audio) => {
                let (rate, planes) = (audio.spec().rate(), audio.num_planes());
                if rate != sample_rate || planes != channels {
                    return Decoded::Damaged;
                }
                audio.copy_to_vec_interleaved(samples);
                Decoded::Frames(samples.len() / channels)
            }
            Err(_) => Decoded::Damaged,
        })
    }

    fn reset(&mut self) {
        self.decoder.reset();
    }
}

fn in_words(error: &Error) -> String {
    match error {
        Error::IoError(_) => "headers that end too early".into(),
        error => error.to_string(),
    }
}

/// Runs foreign code; a panic in it is a corrupt file to us.
pub(crate) fn guarded<T>(f: impl FnOnce() -> T) -> Result<T, Refusal> {
    catch_unwind(AssertUnwindSafe(f))
        .map_err(|_| Refusal::Corrupt("the decoder gave up (panicked)".into()))
}
