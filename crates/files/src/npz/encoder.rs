//! Counts, checks and, if asked, deflates the bytes of one entry on their way out.

use std::io::{self, BufWriter, Write};

use flate2::write::DeflateEncoder;

use super::writer::Compression;

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
    Deflated(DeflateEncoder<BufWriter<W>>),
}

/// What has gone through a [`Encoder`].
#[derive(Debug, Clone, Copy)]
pub(super) struct Totals {
    pub crc32: u32,
    pub size: u64,
    pub compressed: u64,
}

impl<W: Write> Encoder<W> {
    pub fn new(out: W, compression: Compression) -> Self {
        let out = BufWriter::with_capacity(BUFFER, out);
        let body = match compression {
            Compression::Stored => Body::Stored(out),
            Compression::Deflated => {
                Body::Deflated(DeflateEncoder::new(out, flate2::Compression::new(LEVEL)))
            }
        };
        Self { body, crc: crc32fast::Hasher::new(), size: 0 }
    }

    pub fn finish(self) -> io::Result<Totals> {
        let compressed = match self.body {
            Body::Stored(mut out) => {
                out.flush()?;
                self.size
            }
            Body::Deflated(mut encoder) => {
                encoder.try_finish()?;
                let compressed = encoder.total_out();
                encoder.finish()?.flush()?;
                compressed
            }
        };
        Ok(Totals { crc32: self.crc.finalize(), size: self.size, compressed })
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
