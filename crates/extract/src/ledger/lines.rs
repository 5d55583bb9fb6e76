//! Lines that vouch for themselves: each begins with a check sum over its text and all before it.
//!
//! So a line holds only in its place, in its file: one that was changed, moved, doubled, left out or
//! taken from another run is told from what the run wrote.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};

/// Digits of a check sum: 128 bits in hexadecimal.
const DIGITS: usize = 32;

/// Longest line that is read back (256 MiB): a wide summary row takes 8 characters per value.
const MAX_LINE: u64 = 1 << 28;

/// What all lines so far come to.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Chain([u8; 32]);

impl Chain {
    /// Takes in the next line and returns its check sum.
    fn check(&mut self, text: &[u8]) -> String {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.0);
        hasher.update(text);
        let hash = hasher.finalize();
        self.0 = *hash.as_bytes();
        let mut check = hash.to_hex().to_string();
        check.truncate(DIGITS);
        check
    }

    /// The next line, as it is written.
    pub fn line(&mut self, text: &[u8]) -> Vec<u8> {
        let mut line = self.check(text).into_bytes();
        line.push(b' ');
        line.extend_from_slice(text);
        line.push(b'\n');
        line
    }
}

/// What comes next in a file of lines.
pub(super) enum Next<'a> {
    /// The text of a line that holds.
    Line(&'a [u8]),
    /// Nothing, or a line that a kill has cut.
    End,
    /// A whole line that does not hold.
    Wrong(&'a [u8]),
}

/// The lines of a file from its beginning.
pub(super) struct Lines<'a> {
    reader: BufReader<&'a File>,
    line: Vec<u8>,
    /// Byte after the last line that holds.
    pub end: u64,
    /// What the lines that hold come to.
    pub chain: Chain,
}

impl<'a> Lines<'a> {
    pub fn new(file: &'a File) -> Self {
        let reader = BufReader::new(file);
        Self { reader, line: Vec::new(), end: 0, chain: Chain::default() }
    }

    /// Reads the next line. After one that does not hold there is no use in reading on.
    pub fn next(&mut self) -> io::Result<Next<'_>> {
        self.line.clear();
        let read = Read::take(&mut self.reader, MAX_LINE).read_until(b'\n', &mut self.line)?;
        if self.line.pop_if(|last| *last == b'\n').is_none() {
            return Ok(if read as u64 == MAX_LINE { Next::Wrong(&self.line) } else { Next::End });
        }
        let before = self.chain;
        match self.line.split_at_checked(DIGITS) {
            Some((check, [b' ', text @ ..])) if self.chain.check(text).as_bytes() == check => {
                self.end += read as u64;
                Ok(Next::Line(&self.line[DIGITS + 1..]))
            }
            _ => {
                self.chain = before;
                Ok(Next::Wrong(&self.line))
            }
        }
    }
}
