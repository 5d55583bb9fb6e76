//! The text of a table as it is read, and where its lines and quotation marks are.

use std::io::{self, BufRead, Read};

/// Text whose lines end by line feeds alone, and whose fields have no blanks around them, except in quotation marks.
/// Where lines end by CR LF, the csv crate takes the second for a part of the next line and counts one too few; where
/// they end by CR, it counts none. A CR between quotation marks ends no line. The csv crate would take blanks away
/// within quotation marks, too, where they belong to a name.
pub struct LineFeeds<R> {
    inner: R,
    /// A carriage return that ends a line was read and not given.
    has_return: bool,
    /// Blanks that were read and not given: after them, the field may end.
    blanks: Vec<u8>,
    /// Of these, those that are given now, since the field went on.
    given: usize,
    lines: Lines,
}

/// Where empty lines and quotation marks are in text that was read.
pub(super) struct Lines {
    delimiter: u8,
    /// Bytes of the text.
    bytes: u64,
    /// Lines that ended.
    ended: u64,
    is_begun: bool,
    place: Place,
    /// The line on which quotation marks were last opened.
    opened: u64,
    /// Empty lines that follow each other: the first, and the one after the last.
    empty: Vec<[u64; 2]>,
}

/// What the next byte is, as the csv crate sees it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Place {
    /// The first of a field.
    Begin,
    /// Of a field without quotation marks, where they are text.
    Plain,
    /// Between quotation marks.
    Quoted,
    /// Behind a quotation mark that ends a field, unless another one follows.
    Closed,
}

impl Lines {
    fn new(delimiter: u8) -> Self {
        let (place, empty) = (Place::Begin, Vec::new());
        Self { delimiter, bytes: 0, ended: 0, is_begun: false, place, opened: 0, empty }
    }

    /// Bytes of the text.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The line on which the quotation marks were opened that are still open.
    pub(super) fn opened(&self) -> Option<u64> {
        (self.place == Place::Quoted).then_some(self.opened)
    }

    /// Whether a byte is a blank outside of quotation marks.
    fn is_blank(&self, byte: u8) -> bool {
        matches!(byte, b' ' | b'\t') && byte != self.delimiter
    }

    fn add(&mut self, byte: u8) {
        self.bytes += 1;
        self.place = match (self.place, byte) {
            (Place::Begin, b'"') => {
                self.opened = self.ended + 1;
                Place::Quoted
            }
            (Place::Quoted, b'"') => Place::Closed,
            (Place::Quoted, _) | (Place::Closed, b'"') => Place::Quoted,
            (_, b'\n') => Place::Begin,
            (_, byte) if byte == self.delimiter => Place::Begin,
            _ => Place::Plain,
        };
        if byte != b'\n' {
            self.is_begun |= byte != b'\r';
            return;
        }
        self.ended += 1;
        if !std::mem::take(&mut self.is_begun) && self.place != Place::Quoted {
            match self.empty.last_mut() {
                Some([_, end]) if *end == self.ended => *end += 1,
                _ => self.empty.push([self.ended, self.ended + 1]),
            }
        }
    }

    /// The line on which a record begins that begins on `line` for the csv crate: that counts empty lines before
    /// a record as part of it.
    pub(super) fn of_record(&self, line: u64) -> u64 {
        let before = self.empty.partition_point(|[first, _]| *first <= line);
        let last = before.checked_sub(1).map(|at| self.empty[at]);
        last.map_or(line, |[_, end]| line.max(end))
    }
}

impl<R> LineFeeds<R> {
    pub(super) fn new(inner: R, delimiter: u8) -> Self {
        let lines = Lines::new(delimiter);
        Self { inner, has_return: false, blanks: Vec::new(), given: 0, lines }
    }

    pub(super) fn lines(&self) -> &Lines {
        &self.lines
    }

    /// What is read from.
    pub fn get_ref(&self) -> &R {
        &self.inner
    }
}

impl<R: BufRead> Read for LineFeeds<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if out.is_empty() {
            return Ok(0);
        }
        loop {
            let text = self.inner.fill_buf()?;
            if text.is_empty() {
                if !std::mem::take(&mut self.has_return) {
                    return Ok(0);
                }
                self.lines.add(b'\n');
                out[0] = b'\n';
                return Ok(1);
            }
            let (mut used, mut written) = (0, 0);
            while used < text.len() && written < out.len() {
                let mut byte = text[used];
                let ends = self.has_return;
                let quoted = self.lines.place == Place::Quoted;
                if !ends && !quoted && (byte == b'\r' || self.lines.is_blank(byte)) {
                    used += 1;
                    match byte {
                        b'\r' => self.has_return = true,
                        _ => self.blanks.push(byte),
                    }
                    continue;
                }
                let begins = self.lines.place == Place::Begin;
                if ends || byte == b'\n' || byte == self.lines.delimiter || begins {
                    // The field ends before them, or begins after them.
                    self.blanks.clear();
                } else if let Some(&blank) = self.blanks.get(self.given) {
                    self.given += 1;
                    self.lines.add(blank);
                    out[written] = blank;
                    written += 1;
                    continue;
                }
                (self.given, self.has_return) = (0, false);
                self.blanks.clear();
                used += usize::from(!ends || byte == b'\n');
                if ends {
                    byte = b'\n';
                }
                self.lines.add(byte);
                out[written] = byte;
                written += 1;
            }
            self.inner.consume(used);
            if written > 0 {
                return Ok(written);
            }
        }
    }
}
