//! CSV as spreadsheets and other programs write it: separated by commas, semicolons or tabs, with or
//! without a byte order mark.

use std::collections::HashSet;
use std::io::{self, BufRead, Read};

/// A reader of the table in `text`, whose first line says what separates its fields: commas where
/// it has one, else semicolons, else tabs. Space around fields is left out.
///
/// # Errors
/// Reading fails, or the text is not UTF-8 but UTF-16, a feature file or a model; the error says so.
pub fn reader<R: BufRead>(mut text: R) -> io::Result<csv::Reader<LineFeeds<R>>> {
    let start = text.fill_buf()?;
    let other = |what: &str| Err(io::Error::new(io::ErrorKind::InvalidData, what.to_string()));
    if start.starts_with(b"\xff\xfe") || start.starts_with(b"\xfe\xff") {
        return other("text in UTF-16, where CSV in UTF-8 is expected: save it as \"CSV UTF-8\"");
    }
    if start.starts_with(b"PK\x03\x04") {
        return other("an .npz file or another ZIP archive, but a CSV table is expected");
    }
    if start.starts_with(b"PAR1") {
        return other("a Parquet file, but a CSV table is expected");
    }
    let marked = start.starts_with(b"\xef\xbb\xbf");
    let mut lines = start.split(|&byte| byte == b'\n');
    let line = lines.find(|line| !line.trim_ascii().is_empty()).unwrap_or_default();
    let delimiter =
        [b',', b';', b'\t'].into_iter().find(|byte| line.contains(byte)).unwrap_or(b',');
    if marked {
        text.consume(3);
    }
    let mut builder = csv::ReaderBuilder::new();
    Ok(builder.delimiter(delimiter).trim(csv::Trim::All).from_reader(LineFeeds::new(text)))
}

/// The records behind the header, each with the number of its line.
pub fn records<R: BufRead>(
    reader: &mut csv::Reader<LineFeeds<R>>,
) -> impl Iterator<Item = Result<(u64, csv::StringRecord), Fault>> {
    std::iter::from_fn(|| {
        let mut record = csv::StringRecord::new();
        match reader.read_record(&mut record) {
            Ok(true) => {
                let line = record.position().map_or(0, csv::Position::line);
                Some(Ok((reader.get_ref().lines.of_record(line), record)))
            }
            Ok(false) => None,
            Err(error) => {
                let mut fault = Fault::from(error);
                fault.line = fault.line.map(|line| reader.get_ref().lines.of_record(line));
                Some(Err(fault))
            }
        }
    })
}

/// Text whose lines end by line feeds alone, except in quotation marks. Where they end by CR LF, the csv crate
/// takes the second for a part of the next line and counts one too few.
pub struct LineFeeds<R> {
    inner: R,
    is_quoted: bool,
    /// A carriage return was read and not given.
    has_return: bool,
    lines: Lines,
}

/// Where empty lines are in text that was read.
#[derive(Default)]
struct Lines {
    /// Lines that ended.
    ended: u64,
    is_begun: bool,
    is_quoted: bool,
    /// Empty lines that follow each other: the first, and the one behind the last.
    empty: Vec<[u64; 2]>,
}

impl Lines {
    fn add(&mut self, text: &[u8]) {
        for &byte in text {
            self.is_quoted ^= byte == b'"';
            if byte != b'\n' {
                self.is_begun |= byte != b'\r';
                continue;
            }
            self.ended += 1;
            if !std::mem::take(&mut self.is_begun) && !self.is_quoted {
                match self.empty.last_mut() {
                    Some([_, end]) if *end == self.ended => *end += 1,
                    _ => self.empty.push([self.ended, self.ended + 1]),
                }
            }
        }
    }

    /// The line on which a record begins that begins on `line` for the csv crate: that counts empty lines before
    /// a record as part of it.
    fn of_record(&self, line: u64) -> u64 {
        let before = self.empty.partition_point(|[first, _]| *first <= line);
        let last = before.checked_sub(1).map(|at| self.empty[at]);
        last.map_or(line, |[_, end]| line.max(end))
    }
}

impl<R> LineFeeds<R> {
    fn new(inner: R) -> Self {
        Self { inner, is_quoted: false, has_return: false, lines: Lines::default() }
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
                out[0] = b'\r';
                return Ok(usize::from(std::mem::take(&mut self.has_return)));
            }
            let (mut used, mut written) = (0, 0);
            for &byte in text {
                if self.has_return && byte != b'\n' && written < out.len() {
                    out[written] = b'\r';
                    written += 1;
                    self.has_return = false;
                }
                if written == out.len() {
                    break;
                }
                used += 1;
                self.is_quoted ^= byte == b'"';
                self.has_return = byte == b'\r' && !self.is_quoted;
                if !self.has_return {
                    out[written] = byte;
                    written += 1;
                }
            }
            self.inner.consume(used);
            self.lines.add(&out[..written]);
            if written > 0 {
                return Ok(written);
            }
        }
    }
}

/// What is wrong with a table, and where.
#[derive(Debug)]
pub struct Fault {
    /// The line, where that is known: not where reading failed.
    pub line: Option<u64>,
    /// What is wrong, and what to do about text that is not UTF-8, such as Excel's `CSV` in Western Europe.
    pub reason: String,
}

impl std::fmt::Display for Fault {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.line {
            Some(line) => write!(f, "line {line}: {}", self.reason),
            None => f.write_str(&self.reason),
        }
    }
}

impl From<csv::Error> for Fault {
    fn from(error: csv::Error) -> Self {
        let line = error.position().map(csv::Position::line);
        let reason = match error.kind() {
            csv::ErrorKind::Utf8 { .. } => {
                "text that is not UTF-8: save the table as \"CSV UTF-8\"".into()
            }
            csv::ErrorKind::UnequalLengths { expected_len, len, .. } => format!(
                "{len} fields, but the first line has {expected_len}: is a quotation mark or a \
                 separator missing?"
            ),
            _ => error.to_string(),
        };
        Self { line, reason }
    }
}

/// A name that two columns have; columns without a name are not told apart.
pub fn repeated<S: AsRef<str>>(header: impl IntoIterator<Item = S>) -> Option<String> {
    let mut seen = HashSet::new();
    let named = header.into_iter().map(|name| name.as_ref().to_owned());
    named.filter(|name| !name.is_empty()).find(|name| !seen.insert(name.clone()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_of_older_encodings_is_refused_with_advice() {
        let mut table = reader(&b"id,class\n1,caf\xe9\n"[..]).unwrap();
        table.headers().unwrap();
        let fault = records(&mut table).next().unwrap().unwrap_err();
        let expected = "line 2: text that is not UTF-8: save the table as \"CSV UTF-8\"";
        assert_eq!(fault.to_string(), expected);
    }

    /// Messages named the line before.
    #[test]
    fn lines_that_end_by_cr_lf_are_counted_as_they_are() {
        for ending in ["\n", "\r\n"] {
            let text = "id,note\na,\"x\ny\"\nb,1\nd,5\ne,6".replace('\n', ending);
            for capacity in [8, 9, 10, 11, 64] {
                let buffered = io::BufReader::with_capacity(capacity, text.as_bytes());
                let mut table = reader(buffered).unwrap();
                table.headers().unwrap();
                let records: Vec<_> = super::records(&mut table).map(Result::unwrap).collect();
                let lines: Vec<u64> = records.iter().map(|(line, _)| *line).collect();
                assert_eq!(lines, [2, 4, 5, 6], "{ending:?}");
                assert_eq!(records[0].1[1], format!("x{ending}y"));
                assert_eq!(&records[3].1[1], "6");
            }
        }
    }

    /// Records behind empty lines were said to stand on these.
    #[test]
    fn empty_lines_are_counted() {
        for ending in ["\n", "\r\n"] {
            let text = "\n\nid,note\n\na,\"x\n\n\ny\"\n\n\n\nb,1\nd,5\n\n".replace('\n', ending);
            let mut table = reader(text.as_bytes()).unwrap();
            assert_eq!(&table.headers().unwrap()[1], "note");
            let lines: Vec<u64> = records(&mut table).map(|r| r.unwrap().0).collect();
            assert_eq!(lines, [5, 12, 13], "{ending:?}");
            let text = "\n\nid;note\n1,5;b\n".replace('\n', ending);
            let mut table = reader(text.as_bytes()).unwrap();
            assert_eq!(&table.headers().unwrap()[1], "note");
            let text = "id,note\n\n\na,b,c\n".replace('\n', ending);
            let mut table = reader(text.as_bytes()).unwrap();
            let fault = records(&mut table).next().unwrap().unwrap_err().to_string();
            assert!(fault.starts_with("line 4: 3 fields, but the first line has 2"), "{fault}");
        }
    }

    /// A lone carriage return ends a line, too, for the csv crate; none is lost.
    #[test]
    fn other_carriage_returns_are_kept() {
        for text in ["a\rb\r", "\r\r\n\"\r\n\"\r", "\r"] {
            for capacity in [1, 2, 64] {
                let inner = io::BufReader::with_capacity(capacity, text.as_bytes());
                let mut plain = LineFeeds::new(inner);
                let mut found = Vec::new();
                // One byte at a time.
                let mut byte = [0];
                while plain.read(&mut byte).unwrap() > 0 {
                    found.push(byte[0]);
                }
                let expected = text.replace("\r\r\n\"", "\r\n\"");
                assert_eq!(String::from_utf8(found).unwrap(), expected);
            }
        }
    }

    #[test]
    fn separators_and_marks_are_recognised() {
        for text in
            ["a,b;c\n1, 2;3\n", "a;b;c\n1;2;3\n", "a\tb\tc\n1\t2\t3\r\n", "\u{feff}a,b\n1,2\n"]
        {
            let mut table = reader(text.as_bytes()).unwrap();
            let header = table.headers().unwrap().clone();
            assert_eq!(&header[0], "a");
            let row = table.records().next().unwrap().unwrap();
            assert_eq!((row.len(), &row[0]), (header.len(), "1"));
        }
        assert_eq!(reader(&b""[..]).unwrap().headers().unwrap().len(), 0);
    }

    #[test]
    fn names_that_two_columns_have_are_found() {
        assert_eq!(repeated(["a", "", "A", "b", "", "A"]).as_deref(), Some("A"));
        assert_eq!(repeated(["a", "", "A", ""]), None);
    }

    #[test]
    fn other_files_are_named() {
        for (bytes, what) in [
            (&b"\xff\xfea\0"[..], "UTF-16"),
            (b"\xfe\xff\0a", "UTF-16"),
            (b"PK\x03\x04rest", ".npz"),
            (b"PAR1rest", "Parquet"),
        ] {
            assert!(reader(bytes).map(drop).unwrap_err().to_string().contains(what));
        }
    }
}
