//! Pages of Ogg (RFC 3533) with a right checksum, and the packets in them.

use symphonia::core::checksum::Crc32;
use symphonia::core::io::Monitor;

use crate::error::AudioError;
use crate::input::Input;

/// Bytes of a page before its table of segments.
const HEAD: usize = 27;
/// The largest page: 255 segments of 255 bytes.
const LARGEST: usize = HEAD + 255 + 255 * 255;
/// Packets are not larger in practice; what is longer is cut here.
const MAX_PACKET: usize = 4 << 20;
/// Bytes of what only looks like pages that may be looked through for each byte passed.
const PATIENCE: u64 = 64;

/// A page.
#[derive(Debug, Clone, Default)]
pub(super) struct Page {
    /// The first byte of it in the file.
    pub(super) offset: u64,
    /// It begins with the rest of a packet.
    pub(super) continued: bool,
    /// The first and the last page of a stream.
    pub(super) is_first: bool,
    pub(super) is_last: bool,
    /// The position at the end of the last packet that ends here; `None` where none does.
    pub(super) granule: Option<i64>,
    pub(super) serial: u32,
    pub(super) sequence: u32,
    /// Lengths of segments; one below 255 ends a packet.
    lacing: Vec<u8>,
    body: Vec<u8>,
    /// Bytes passed so far, and those looked through in vain.
    passed: u64,
    searched: u64,
}

impl Page {
    /// Goes to the next page that is whole and has a right checksum, and reads it. False at the end.
    pub(super) fn read(&mut self, input: &mut Input) -> Result<bool, AudioError> {
        loop {
            let shown = input.peek(HEAD)?;
            if shown.len() < HEAD {
                return Ok(false);
            }
            if shown.starts_with(b"OggS") && self.take(input)? {
                return Ok(true);
            }
            if self.searched > PATIENCE * (self.passed + (1 << 20)) {
                let actual = "hardly any intact page of Ogg";
                return Err(AudioError::corrupt(self.offset, actual, "pages with right checksums"));
            }
            let shown = input.peek(HEAD)?;
            let next = shown[1..].iter().position(|&b| b == b'O').map_or(shown.len(), |at| at + 1);
            input.consume(next);
            self.passed += next as u64;
        }
    }

    /// Reads the page that starts here; false if it is damaged, cut off or none.
    ///
    /// ```text
    /// 0  "OggS"  4  u8 version  5  u8 flags: 1 continued, 2 first, 4 last   6  i64 granule
    /// 14 u32 serial  18 u32 sequence  22 u32 checksum  26 u8 segments  27 their lengths, the body
    /// ```
    fn take(&mut self, input: &mut Input) -> Result<bool, AudioError> {
        self.offset = input.position();
        let Some(&segments) = input.peek(HEAD)?.get(HEAD - 1) else { return Ok(false) };
        let table = HEAD + usize::from(segments);
        let Some(lacing) = input.peek(table)?.get(HEAD..table) else { return Ok(false) };
        let length = table + lacing.iter().map(|n| usize::from(*n)).sum::<usize>();
        debug_assert!(length <= LARGEST);
        self.searched += length as u64;
        let Some(page) = input.peek(length)?.get(..length) else { return Ok(false) };
        let u32_at = |at: usize| page[at..].first_chunk().map_or(0, |b| u32::from_le_bytes(*b));
        let mut crc = Crc32::new(0);
        crc.process_buf_bytes(&page[..22]);
        crc.process_buf_bytes(&[0; 4]);
        crc.process_buf_bytes(&page[26..]);
        if page[4] != 0 || crc.crc() != u32_at(22) {
            return Ok(false);
        }
        let granule = page[6..].first_chunk().map_or(-1, |b| i64::from_le_bytes(*b));
        self.granule = (granule != -1).then_some(granule);
        let flags = page[5];
        (self.continued, self.is_first, self.is_last) =
            (flags & 1 != 0, flags & 2 != 0, flags & 4 != 0);
        (self.serial, self.sequence) = (u32_at(14), u32_at(18));
        self.lacing.clear();
        self.lacing.extend_from_slice(&page[HEAD..table]);
        self.body.clear();
        self.body.extend_from_slice(&page[table..]);
        input.consume(length);
        self.passed += length as u64;
        self.searched -= length as u64;
        Ok(true)
    }

    /// The start of the body.
    pub(super) fn body(&self) -> &[u8] {
        &self.body
    }

    /// Adds the packets that end in this page to `packets`. `partial` is what earlier pages hold of
    /// the first of them, and then of the one that goes on in the next page.
    pub(super) fn packets(&self, partial: &mut Option<Vec<u8>>, packets: &mut Vec<Vec<u8>>) {
        // The rest of a packet without its beginning is of no use.
        let mut current = if self.continued { partial.take() } else { Some(Vec::new()) };
        *partial = None;
        let mut at = 0;
        for &length in &self.lacing {
            let end = at + usize::from(length);
            if let Some(packet) = current.as_mut().filter(|p| p.len() < MAX_PACKET) {
                packet.extend_from_slice(&self.body[at..end]);
            }
            at = end;
            if length < 255 {
                packets.extend(current.take());
                current = Some(Vec::new());
            }
        }
        if self.lacing.last() == Some(&255) {
            *partial = current;
        }
    }
}

/// The position at the end of the last page of a stream, where the input can be looked through.
pub(super) fn last_granule(input: &mut Input, serial: u32) -> Result<Option<i64>, AudioError> {
    let Some(len) = input.len() else { return Ok(None) };
    let back = input.position();
    input.seek(len.saturating_sub(LARGEST as u64 + 1).max(back))?;
    let mut page = Page::default();
    let mut last = None;
    while page.read(input)? {
        // Another stream after this one has its own positions.
        last = page.granule.filter(|_| page.serial == serial);
    }
    input.seek(back)?;
    Ok(last)
}
