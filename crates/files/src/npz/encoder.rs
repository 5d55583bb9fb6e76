//! Counts, checks and, if asked, deflates the bytes of one entry on their way out.

use std::io::{self, BufWriter, Write};

use flate2::write::DeflateEncoder;

use super::entry::Compression;
use super::limits::{MAX_INFLATED, MAX_RATIO};

/// Deflate level: numpy's and zlib's default.
const LEVEL: u32 = 6;
/// Small pieces are gathered to writes of this size.
const BUFFER: usize = 1 << 20;
/// Every so many bytes of an entry its compressed size is looked at.
const STRETCH: u64 = 16 << 20;
/// A deflate block that stores nothing.
const EMPTY: [u8; 5] = [0, 0, 0, 0xff, 0xff];

pub(super) struct Encoder<W: Write> {
    body: Body<W>,
    crc: crc32fast::Hasher,
    size: u64,
}

enum Body<W: Write> {
    Stored(BufWriter<W>),
    Deflated(Box<Deflated<W>>),
}

struct Deflated<W: Write> {
    encoder: DeflateEncoder<BufWriter<Checked<W>>>,
    /// Bytes of empty blocks.
    padding: u64,
}

impl<W: Write> Deflated<W> {
    fn compressed(&self) -> u64 {
        self.encoder.total_out() + self.padding
    }

    /// Keeps an entry of `size` bytes so far below what readers take for a bomb: long digital silence
    /// deflates to a thousandth. Half of the ratio, for those that read it in double precision. The
    /// place depends on `size` alone, not on how the bytes arrive.
    fn pad(&mut self, size: u64) -> io::Result<()> {
        let read = 2 * (size + STRETCH);
        if !size.is_multiple_of(STRETCH) || read <= MAX_INFLATED {
            return Ok(());
        }
        self.encoder.flush()?;
        let lacking = (read / MAX_RATIO).saturating_sub(self.compressed());
        for _ in 0..lacking.div_ceil(EMPTY.len() as u64) {
            self.encoder.get_mut().write_all(&EMPTY)?;
            self.padding += EMPTY.len() as u64;
        }
        Ok(())
    }
}

/// Checks the bytes that go through.
pub(super) struct Checked<W> {
    out: W,
    crc: crc32fast::Hasher,
}

impl<W: Write> Checked<W> {
    pub fn new(out: W) -> Self {
        Self { out, crc: crc32fast::Hasher::new() }
    }

    pub fn crc32(&self) -> u32 {
        self.crc.clone().finalize()
    }
}

impl<W: Write> Write for Checked<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write(bytes)?;
        self.crc.update(&bytes[..written]);
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

/// What has gone through an [`Encoder`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Totals {
    pub crc32: u32,
    /// Of the bytes as they are stored.
    pub stored_crc32: u32,
    pub size: u64,
    pub compressed: u64,
}

impl<W: Write> Encoder<W> {
    pub fn new(out: W, compression: Compression) -> Self {
        let body = match compression {
            Compression::Stored => Body::Stored(BufWriter::with_capacity(BUFFER, out)),
            Compression::Deflated => {
                let out = BufWriter::with_capacity(BUFFER, Checked::new(out));
                let encoder = DeflateEncoder::new(out, flate2::Compression::new(LEVEL));
                Body::Deflated(Box::new(Deflated { encoder, padding: 0 }))
            }
        };
        Self { body, crc: crc32fast::Hasher::new(), size: 0 }
    }

    pub fn finish(self) -> io::Result<Totals> {
        let crc32 = self.crc.finalize();
        let (stored_crc32, compressed) = match self.body {
            Body::Stored(mut out) => {
                out.flush()?;
                (crc32, self.size)
            }
            Body::Deflated(mut deflated) => {
                deflated.encoder.try_finish()?;
                let compressed = deflated.compressed();
                let mut out = deflated.encoder.finish()?;
                out.flush()?;
                (out.get_ref().crc32(), compressed)
            }
        };
        Ok(Totals { crc32, stored_crc32, size: self.size, compressed })
    }
}

impl<W: Write> Write for Encoder<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = match &mut self.body {
            Body::Stored(out) => out.write(bytes),
            Body::Deflated(deflated) => {
                let stretch = (STRETCH - self.size % STRETCH).min(bytes.len() as u64);
                deflated.encoder.write(&bytes[..stretch as usize])
            }
        }?;
        self.crc.update(&bytes[..written]);
        self.size += written as u64;
        if let (Body::Deflated(deflated), 1..) = (&mut self.body, written) {
            deflated.pad(self.size)?;
        }
        Ok(written)
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.body {
            Body::Stored(out) => out.flush(),
            // A flush inside the deflate stream would make bytes depend on how they arrive.
            Body::Deflated(_) => Ok(()),
        }
    }
}
