//! Counts, checks and, if asked, deflates the bytes of one entry on their way out.

use std::io::{self, BufWriter, Write};

use flate2::write::DeflateEncoder;

use super::entry::Compression;

/// Deflate level: numpy's and zlib's default.
const LEVEL: u32 = 6;
/// Small pieces are gathered to writes of this size.
const BUFFER: usize = 1 << 20;

pub(super) struct Encoder<W: Write> {
    body: Body<W>,
    crc: crc32fast::Hasher,
    size: u64,
}

enum Body<W: Write> {
    Stored(BufWriter<W>),
    Deflated(DeflateEncoder<BufWriter<Checked<W>>>),
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
                Body::Deflated(DeflateEncoder::new(out, flate2::Compression::new(LEVEL)))
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
            Body::Deflated(mut encoder) => {
                encoder.try_finish()?;
                let compressed = encoder.total_out();
                let mut out = encoder.finish()?;
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
            Body::Deflated(encoder) => encoder.write(bytes),
        }?;
        self.crc.update(&bytes[..written]);
        self.size += written as u64;
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
