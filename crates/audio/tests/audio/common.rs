//! Builds WAV files byte by byte and reads sources to their end.

use std::io::Cursor;
use std::path::PathBuf;

use corsmal_audio::{AudioError, BlockSource, ReadReport, from_reader, from_seekable};

/// Format tags of the `fmt ` chunk.
pub mod tag {
    pub const PCM: u16 = 1;
    pub const FLOAT: u16 = 3;
    pub const ALAW: u16 = 6;
    pub const MULAW: u16 = 7;
    pub const EXTENSIBLE: u16 = 0xfffe;
}

/// A WAV file to be written; change the fields that a test is about.
#[derive(Debug, Clone)]
pub struct Wav {
    pub form: &'static [u8; 4],
    pub tag: u16,
    pub channels: u16,
    pub sample_rate: u32,
    pub bits: u16,
    /// `None`: channels times whole bytes.
    pub block_align: Option<u16>,
    /// Tag in the GUID; makes the chunk WAVE_FORMAT_EXTENSIBLE.
    pub sub_format: Option<u16>,
    /// Chunks before the data: name, size field, body exactly as written.
    pub before: Vec<([u8; 4], u32, Vec<u8>)>,
    /// `None`: the length of `data`.
    pub data_size: Option<u32>,
    /// Size in a ds64 chunk, which is written if there is one.
    pub long_size: Option<u64>,
    pub data: Vec<u8>,
    /// Written after the data.
    pub after: Vec<u8>,
}

impl Wav {
    /// 16-bit PCM at 44.1 kHz.
    pub fn pcm16(channels: u16, samples: &[i16]) -> Self {
        Self {
            form: b"RIFF",
            tag: tag::PCM,
            channels,
            sample_rate: 44_100,
            bits: 16,
            block_align: None,
            sub_format: None,
            before: Vec::new(),
            data_size: None,
            long_size: None,
            data: samples.iter().flat_map(|s| s.to_le_bytes()).collect(),
            after: Vec::new(),
        }
    }

    pub fn is_big(&self) -> bool {
        self.form == b"RIFX"
    }

    fn u16(&self, v: u16) -> [u8; 2] {
        if self.is_big() { v.to_be_bytes() } else { v.to_le_bytes() }
    }

    fn u32(&self, v: u32) -> [u8; 4] {
        if self.is_big() { v.to_be_bytes() } else { v.to_le_bytes() }
    }

    fn u64(&self, v: u64) -> [u8; 8] {
        if self.is_big() { v.to_be_bytes() } else { v.to_le_bytes() }
    }

    /// The file up to its first sample.
    pub fn header(&self) -> Vec<u8> {
        let align = self.block_align.unwrap_or(self.channels * self.bits.div_ceil(8));
        let outer = if self.sub_format.is_some() { tag::EXTENSIBLE } else { self.tag };
        let mut fmt = Vec::new();
        fmt.extend(self.u16(outer));
        fmt.extend(self.u16(self.channels));
        fmt.extend(self.u32(self.sample_rate));
        fmt.extend(self.u32(self.sample_rate.wrapping_mul(align.into())));
        fmt.extend(self.u16(align));
        fmt.extend(self.u16(self.bits));
        if let Some(sub) = self.sub_format {
            fmt.extend(self.u16(22));
            fmt.extend(self.u16(self.bits));
            fmt.extend(self.u32(0));
            fmt.extend(self.u32(sub.into()));
            fmt.extend(self.u16(0));
            fmt.extend(self.u16(0x10));
            fmt.extend([0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71]);
        }
        let mut body = b"WAVE".to_vec();
        if let Some(long) = self.long_size {
            body.extend(b"ds64");
            body.extend(self.u32(28));
            body.extend(self.u64(long + 100));
            body.extend(self.u64(long));
            body.extend([0; 12]);
        }
        for (name, size, bytes) in &self.before {
            body.extend(name);
            body.extend(self.u32(*size));
            body.extend(bytes);
        }
        body.extend(b"fmt ");
        body.extend(self.u32(fmt.len() as u32));
        body.extend(fmt);
        body.extend(b"data");
        body.extend(self.u32(self.data_size.unwrap_or(self.data.len() as u32)));
        let mut file = self.form.to_vec();
        file.extend(self.u32((body.len() + self.data.len()) as u32));
        file.extend(body);
        file
    }

    /// The whole file.
    pub fn bytes(&self) -> Vec<u8> {
        [self.header(), self.data.clone(), self.after.clone()].concat()
    }
}

/// What a source gave; equal if all samples have the same bits (NaN included).
#[derive(Debug)]
pub struct Recording {
    pub channels: usize,
    pub sample_rate: u32,
    pub format: String,
    pub declared_frames: Option<u64>,
    pub samples: Vec<f32>,
    pub report: ReadReport,
}

impl PartialEq for Recording {
    fn eq(&self, other: &Self) -> bool {
        let bits = |r: &Self| r.samples.iter().map(|s| s.to_bits()).collect::<Vec<_>>();
        let spec = |r: &Self| (r.channels, r.sample_rate, r.format.clone(), r.declared_frames);
        spec(self) == spec(other) && bits(self) == bits(other) && self.report == other.report
    }
}

impl Recording {
    pub fn repairs(&self) -> Vec<&'static str> {
        self.report.repairs.iter().map(|r| r.name()).collect()
    }
}

/// Reads to the end with blocks whose frame counts `sizes` yields.
pub fn read_with(
    source: &mut dyn BlockSource,
    mut sizes: impl Iterator<Item = usize>,
) -> Result<Recording, AudioError> {
    let channels = usize::from(source.spec().channels);
    let mut samples = Vec::new();
    loop {
        let mut block = vec![f32::NAN; channels * sizes.next().expect("endless sizes").max(1)];
        let frames = source.read(&mut block)?;
        if frames == 0 {
            break;
        }
        samples.extend_from_slice(&block[..frames * channels]);
    }
    let spec = source.spec();
    Ok(Recording {
        channels,
        sample_rate: spec.sample_rate,
        format: spec.format.clone(),
        declared_frames: spec.declared_frames,
        samples,
        report: source.health().clone(),
    })
}

/// Reads bytes as a file.
pub fn read_file(bytes: Vec<u8>) -> Result<Recording, AudioError> {
    read_with(from_seekable(Cursor::new(bytes))?.as_mut(), std::iter::repeat(1000))
}

/// Reads bytes as a pipe.
pub fn read_pipe(bytes: Vec<u8>) -> Result<Recording, AudioError> {
    read_with(from_reader(Cursor::new(bytes))?.as_mut(), std::iter::repeat(1000))
}

/// The shared material, where it is present.
pub fn shared(what: &str) -> Option<PathBuf> {
    let root = std::env::var_os("CORSMAL_SHARED").map_or_else(
        || PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared")),
        PathBuf::from,
    );
    let path = root.join(what);
    if path.exists() {
        return Some(path);
    }
    eprintln!("skipped: {} absent", path.display());
    None
}
