//! FLAC, Ogg Vorbis and MP3, demultiplexed and decoded by symphonia.

use std::io::{self, Cursor, Read, Seek, SeekFrom};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use symphonia::core::codecs::audio::well_known::CODEC_ID_VORBIS;
use symphonia::core::codecs::audio::{AudioCodecParameters, AudioDecoder, AudioDecoderOptions};
use symphonia::core::errors::Error;
use symphonia::core::formats::probe::Hint;
use symphonia::core::formats::{FormatOptions, FormatReader, TrackType};
use symphonia::core::io::{MediaSource, MediaSourceStream};
use symphonia::core::meta::MetadataOptions;
use symphonia::core::units::Timestamp;

use crate::error::AudioError;
use crate::input::{Input, Medium};
use crate::report::{ReadReport, Repair};
use crate::source::{AudioSpec, BlockSource};
use crate::wav::{MAX_CHANNELS, MAX_SAMPLE_RATE};

const CODECS: &str = "FLAC, MP3, Vorbis of 1 or 2 channels; 1 to 768000 Hz";

/// Whether the first bytes are those of FLAC, Ogg, an ID3 tag or an MPEG audio frame.
pub(crate) fn is_known(start: &[u8]) -> bool {
    let mpeg = |b: &[u8]| match *b {
        // Sync word, then neither the reserved version nor the reserved layer.
        [0xff, b, ..] => b & 0xe0 == 0xe0 && b & 0x18 != 0x08 && b & 0x06 != 0,
        _ => false,
    };
    start.starts_with(b"fLaC")
        || start.starts_with(b"OggS")
        || start.starts_with(b"ID3")
        || mpeg(start)
}

/// The input as symphonia wants it: seekable where it is, and shareable between threads, which
/// the mutex (never contended) provides.
struct Bytes {
    /// What was read of a pipe before it came here.
    prefix: Cursor<Vec<u8>>,
    medium: Mutex<Box<dyn Medium>>,
    len: Option<u64>,
    position: Arc<AtomicU64>,
}

impl Read for Bytes {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let mut n = self.prefix.read(out)?;
        if n == 0 {
            n = self.medium.get_mut().map_err(|_| io::ErrorKind::Other)?.read(out)?;
        }
        self.position.fetch_add(n as u64, Ordering::Relaxed);
        Ok(n)
    }
}

impl Seek for Bytes {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let len = self.len.ok_or(io::ErrorKind::Unsupported)?;
        let target = match to {
            SeekFrom::Start(n) => Some(n),
            SeekFrom::End(d) => len.checked_add_signed(d),
            SeekFrom::Current(d) => self.position.load(Ordering::Relaxed).checked_add_signed(d),
        };
        let target = target.ok_or(io::ErrorKind::InvalidInput)?;
        self.medium.get_mut().map_err(|_| io::ErrorKind::Other)?.jump(target)?;
        self.position.store(target, Ordering::Relaxed);
        Ok(target)
    }
}

impl MediaSource for Bytes {
    fn is_seekable(&self) -> bool {
        self.len.is_some()
    }

    fn byte_len(&self) -> Option<u64> {
        self.len
    }
}

/// Most channels of Vorbis: symphonia 0.6.1 undoes the coupling of channels in the wrong order
/// (Vorbis I specification, 4.3.5: last step first), so that more than one pair comes out mixed up.
const MAX_VORBIS_CHANNELS: u16 = 2;

/// Demultiplexer and decoder of the first audio track.
struct Track {
    format: Box<dyn FormatReader>,
    decoder: Box<dyn AudioDecoder>,
    id: u32,
    /// Time stamp that the next packet should have, in frames.
    expected: Option<Timestamp>,
}

/// Streams the samples of one compressed recording.
pub(crate) struct CompressedSource {
    /// `None` once the end or an error was met.
    track: Option<Track>,
    spec: AudioSpec,
    /// Decoded samples, interleaved; those from `start` on are not handed out yet.
    block: Vec<f32>,
    start: usize,
    position: Arc<AtomicU64>,
    /// Damaged or missing frames so far.
    lost: u64,
    /// An Ogg stream stopped without its last page.
    unfinished: bool,
    report: ReadReport,
}

impl CompressedSource {
    /// Reads headers from the start of `input`, of which nothing was consumed.
    pub(crate) fn new(input: Input) -> Result<Self, AudioError> {
        let position = Arc::new(AtomicU64::new(0));
        let bytes = {
            let len = input.len();
            let (prefix, medium) = input.into_unread()?;
            let medium = Mutex::new(medium);
            Bytes { prefix: Cursor::new(prefix), medium, len, position: position.clone() }
        };
        let (track, spec) = guarded(|| open_track(bytes))
            .map_err(|failure| failure.at(position.load(Ordering::Relaxed)))?;
        Ok(Self {
            track: Some(track),
            spec,
            block: Vec::new(),
            start: 0,
            position,
            lost: 0,
            unfinished: false,
            report: ReadReport::default(),
        })
    }

    /// Decodes the next packet into `block`; false at the end.
    fn refill(&mut self) -> Result<bool, Failure> {
        self.block.clear();
        self.start = 0;
        let Some(track) = self.track.as_mut() else {
            return Ok(false);
        };
        loop {
            let packet = match track.format.next_packet() {
                Ok(Some(packet)) => packet,
                Ok(None) => return Ok(false),
                Err(Error::IoError(e)) if e.kind() == io::ErrorKind::UnexpectedEof => {
                    self.unfinished = true;
                    return Ok(false);
                }
                Err(Error::ResetRequired) => {
                    // Another link of a chained Ogg file.
                    track.restart()?;
                    continue;
                }
                Err(e) => return Err(e.into()),
            };
            if packet.track_id != track.id {
                continue;
            }
            if let Some(gap) = track.expected.and_then(|t| packet.pts.duration_from(t)) {
                self.lost += gap.get();
            }
            track.expected = packet.pts.checked_add(packet.block_dur());
            let audio = match track.decoder.decode(&packet) {
                Ok(audio) if audio.is_empty() => continue,
                Ok(audio) => audio,
                Err(Error::DecodeError(_)) => {
                    self.lost += packet.dur.get();
                    continue;
                }
                Err(e) => return Err(e.into()),
            };
            let (rate, planes) = (audio.spec().rate(), audio.num_planes());
            if rate != self.spec.sample_rate || planes != usize::from(self.spec.channels) {
                let actual = format!("change to {planes} channels at {rate} Hz");
                return Err(Failure::Unsupported(actual));
            }
            audio.copy_to_vec_interleaved(&mut self.block);
            return Ok(true);
        }
    }

    /// Notes what is only known at the end.
    fn end(&mut self) {
        self.track = None;
        if self.lost > 0 {
            self.report.repairs.push(Repair::LostFrames { count: self.lost });
        }
        let (declared, actual) = (self.spec.declared_frames, self.report.decoded_frames);
        if self.unfinished || declared.is_some_and(|n| actual.saturating_add(self.lost) < n) {
            self.report.truncated = true;
            self.report.repairs.push(Repair::Truncated { declared, actual });
        }
    }
}

impl BlockSource for CompressedSource {
    fn spec(&self) -> &AudioSpec {
        &self.spec
    }

    fn read(&mut self, out: &mut [f32]) -> Result<usize, AudioError> {
        let channels = usize::from(self.spec.channels);
        let wanted = out.len() / channels * channels;
        let mut done = 0;
        while done < wanted {
            if self.start == self.block.len() {
                if self.track.is_none() {
                    break;
                }
                match guarded(|| self.refill()) {
                    Ok(true) => {}
                    Ok(false) => {
                        self.report.decoded_frames += (done / channels) as u64;
                        self.end();
                        return Ok(done / channels);
                    }
                    Err(failure) => {
                        self.track = None;
                        return Err(failure.at(self.position.load(Ordering::Relaxed)));
                    }
                }
            }
            let n = (self.block.len() - self.start).min(wanted - done);
            out[done..done + n].copy_from_slice(&self.block[self.start..self.start + n]);
            self.start += n;
            done += n;
        }
        self.report.decoded_frames += (done / channels) as u64;
        Ok(done / channels)
    }

    fn seekable(&self) -> bool {
        false
    }

    fn seek(&mut self, _: u64) -> Result<(), AudioError> {
        Err(AudioError::NotSeekable)
    }

    fn health(&self) -> &ReadReport {
        &self.report
    }
}

/// An error that does not know its byte yet.
enum Failure {
    Io(io::Error),
    Unsupported(String),
    Corrupt(String),
}

impl Failure {
    /// The byte up to which symphonia has read; the cause lies at or shortly before it.
    fn at(self, offset: u64) -> AudioError {
        match self {
            Self::Io(source) => AudioError::Io { offset, source },
            Self::Unsupported(actual) => AudioError::unsupported(offset, actual, CODECS),
            Self::Corrupt(actual) => AudioError::corrupt(offset, actual, "a decodable stream"),
        }
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        match error {
            Error::IoError(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
                Self::Corrupt("the file ends too early".into())
            }
            // The stream reports its own inconsistencies in this way, too.
            Error::IoError(e) if e.kind() == io::ErrorKind::Other => Self::Corrupt(e.to_string()),
            Error::IoError(e) => Self::Io(e),
            Error::Unsupported(what) => Self::Unsupported(what.into()),
            other => Self::Corrupt(other.to_string()),
        }
    }
}

/// Runs foreign code; a panic in it is a corrupt file to us.
fn guarded<T>(f: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(f))
        .unwrap_or_else(|_| Err(Failure::Corrupt("the decoder gave up (panicked)".into())))
}

fn open_track(bytes: Bytes) -> Result<(Track, AudioSpec), Failure> {
    let stream = MediaSourceStream::new(Box::new(bytes), Default::default());
    let format = symphonia::default::get_probe().probe(
        &Hint::new(),
        stream,
        FormatOptions::default(),
        MetadataOptions::default(),
    )?;
    let container = format.format_info().short_name;
    let (id, decoder, params) = first_audio(format.as_ref())?;
    let codec = decoder.codec_info().short_name;
    let channels = params.channels.as_ref().map_or(0, |c| c.count());
    let spec = AudioSpec {
        sample_rate: params.sample_rate.unwrap_or(0),
        channels: u16::try_from(channels).unwrap_or(u16::MAX),
        format: if container == codec { codec.into() } else { format!("{container} {codec}") },
        declared_frames: format.default_track(TrackType::Audio).and_then(|t| t.num_frames),
    };
    let fits = (1..=MAX_SAMPLE_RATE).contains(&spec.sample_rate)
        && (1..=MAX_CHANNELS).contains(&spec.channels)
        && (params.codec != CODEC_ID_VORBIS || spec.channels <= MAX_VORBIS_CHANNELS);
    if !fits {
        let AudioSpec { sample_rate, channels, format, .. } = spec;
        let actual = format!("{format} of {channels} channels at {sample_rate} Hz");
        return Err(Failure::Unsupported(actual));
    }
    Ok((Track { format, decoder, id, expected: None }, spec))
}

impl Track {
    /// Goes on with the track that the demultiplexer has now.
    fn restart(&mut self) -> Result<(), Failure> {
        (self.id, self.decoder, _) = first_audio(self.format.as_ref())?;
        self.expected = None;
        Ok(())
    }
}

/// The first audio track with a decoder for it.
fn first_audio(
    format: &dyn FormatReader,
) -> Result<(u32, Box<dyn AudioDecoder>, AudioCodecParameters), Failure> {
    let track = format
        .default_track(TrackType::Audio)
        .ok_or_else(|| Failure::Unsupported("no audio track".into()))?;
    let params = track.codec_params.as_ref().and_then(|p| p.audio());
    let params = params.ok_or_else(|| Failure::Unsupported("an unknown codec".into()))?;
    let decoder = symphonia::default::get_codecs()
        .make_audio_decoder(params, &AudioDecoderOptions::default())?;
    Ok((track.id, decoder, params.clone()))
}
