//! CSV as spreadsheets and other programs write it: separated by commas, semicolons or tabs, with or
//! without a byte order mark.

mod lines;

use std::collections::HashSet;
use std::io::{self, BufRead};

pub use lines::LineFeeds;

/// What may lie around fields, and belongs to those between quotation marks.
const BLANKS: [char; 2] = [' ', '\t'];

/// A reader of the table in `text`, whose first line says what separates its fields: commas where
/// it has one, else semicolons, else tabs. Blanks around fields are left out, but for those in quotation marks.
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
    let mut lines = start.split(|byte| b"\r\n".contains(byte));
    let line = lines.find(|line| !line.trim_ascii().is_empty()).unwrap_or_default();
    let delimiter =
        [b',', b';', b'\t'].into_iter().find(|byte| line.contains(byte)).unwrap_or(b',');
    if marked {
        text.consume(3);
    }
    let mut builder = csv::ReaderBuilder::new();
    let text = LineFeeds::new(text, delimiter);
    Ok(builder.delimiter(delimiter).from_reader(text))
}

/// The names of the columns, without white space around them, but for what stands in quotation marks in the names of
/// probabilities, `p_<label>`: there it belongs to the label.
///
/// # Errors
/// As those of records.
pub fn header<R: BufRead>(
    reader: &mut csv::Reader<LineFeeds<R>>,
) -> Result<csv::StringRecord, Fault> {
    let header = reader.headers().cloned();
    match unclosed(reader) {
        Some(fault) => Err(fault),
        None => Ok(header?.iter().map(name).collect()),
    }
}

/// The name of a column.
fn name(field: &str) -> &str {
    let bare = bare(field);
    if bare.starts_with("p_") { bare } else { field.trim() }
}

/// That the record which was read last goes on to the end of the text, since a quotation mark in it is never
/// closed.
fn unclosed<R: BufRead>(reader: &csv::Reader<LineFeeds<R>>) -> Option<Fault> {
    let lines = reader.get_ref().lines();
    // The text is read ahead of the records.
    let line = lines.opened().filter(|_| reader.position().byte() == lines.bytes())?;
    let reason = "a quotation mark opens here and is never closed: close it, or write it twice inside \
                  quotation marks if it belongs to the text";
    Some(Fault { line: Some(line), reason: reason.into() })
}

/// The records after the header, each with the number of its line.
pub fn records<R: BufRead>(
    reader: &mut csv::Reader<LineFeeds<R>>,
) -> impl Iterator<Item = Result<(u64, csv::StringRecord), Fault>> {
    std::iter::from_fn(|| {
        let mut record = csv::StringRecord::new();
        let read = reader.read_record(&mut record);
        if let (Ok(true) | Err(_), Some(fault)) = (&read, unclosed(reader)) {
            return Some(Err(fault));
        }
        match read {
            Ok(true) => {
                let line = record.position().map_or(0, csv::Position::line);
                let line = reader.get_ref().lines().of_record(line);
                let same = record.iter().all(|field| bare(field).len() == field.len());
                Some(Ok((line, if same { record } else { record.iter().map(bare).collect() })))
            }
            Ok(false) => None,
            Err(error) => {
                let mut fault = Fault::from(error);
                fault.line = fault.line.map(|line| reader.get_ref().lines().of_record(line));
                Some(Err(fault))
            }
        }
    })
}

/// A field without white space around it. Blanks count: they were between quotation marks.
fn bare(field: &str) -> &str {
    field.trim_matches(|c: char| c.is_whitespace() && !BLANKS.contains(&c))
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

/// One record of several fields with its line end. Blanks around a field are kept by quotation marks, as
/// [`reader`] has it; the csv crate would write them without.
pub fn line(fields: &[String]) -> Vec<u8> {
    let written = |field: &String| {
        let has_blanks = field.trim_matches(BLANKS).len() < field.len();
        match has_blanks || field.contains([',', '"', '\r', '\n']) {
            true => format!("\"{}\"", field.replace('"', "\"\"")),
            false => field.clone(),
        }
    };
    let mut line = fields.iter().map(written).collect::<Vec<_>>().join(",").into_bytes();
    line.push(b'\n');
    line
}

/// A name that two columns have; columns without a name are not told apart.
pub fn repeated<S: AsRef<str>>(header: impl IntoIterator<Item = S>) -> Option<String> {
    let mut seen = HashSet::new();
    let named = header.into_iter().map(|name| name.as_ref().to_owned());
    named.filter(|name| !name.is_empty()).find(|name| !seen.insert(name.clone()))
}

#[cfg(test)]
mod tests {
    use std::io::Read;

    use super::*;

    /// The class `dog ` of a prediction file became another one.
    #[test]
    fn blanks_in_quotation_marks_belong_to_the_labels_of_probabilities() {
        let mut table = reader(&b"id, \"type \" ,\"p_dog \", p_cat \n1,x,.5,.5\n"[..]).unwrap();
        let names = header(&mut table).unwrap();
        assert_eq!(names.iter().collect::<Vec<_>>(), ["id", "type", "p_dog ", "p_cat"]);
    }

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

    /// Messages named the first line.
    #[test]
    fn lines_that_end_by_cr_are_counted() {
        let mut table = reader(&b"\r\rid;note\ra;1,5\r\rb;\"x\"\rd;\"5\"\r"[..]).unwrap();
        assert_eq!(&header(&mut table).unwrap()[1], "note");
        let lines: Vec<u64> = records(&mut table).map(|r| r.unwrap().0).collect();
        assert_eq!(lines, [4, 6, 7]);
        let mut table = reader(&b"id,note\ra,x\rb,\"y\rc,z"[..]).unwrap();
        header(&mut table).unwrap();
        let fault = records(&mut table).find_map(Result::err).unwrap().to_string();
        assert!(fault.starts_with("line 3: a quotation mark opens here"), "{fault}");
    }

    /// Records after empty lines were said to stand on these.
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

    /// What swallowed the rest of the table was said to be a line with too few fields, or nothing at all.
    #[test]
    fn quotation_marks_that_stay_open_are_found() {
        let fault = |text: &str, capacity: usize| {
            let mut table =
                reader(io::BufReader::with_capacity(capacity, text.as_bytes())).unwrap();
            match header(&mut table) {
                Err(fault) => Some(fault.to_string()),
                Ok(_) => records(&mut table).find_map(Result::err).map(|fault| fault.to_string()),
            }
        };
        for ending in ["\n", "\r\n"] {
            for capacity in [16, 8192] {
                for (text, line) in [
                    ("id,note\na,x\n\nb,\"y\nc,z\nd,z\n", 4),
                    ("id,note\na,x\nb,\"y", 3),
                    ("id,note\na,\"x\ny\",\"", 3),
                    ("id,note\na,x\n\"b,y\nc,z\n", 3),
                    ("id,\"note\na,x\n", 1),
                    ("id;note\na;\"x \"\"y\"\"\nb;c\n", 2),
                ] {
                    let found = fault(&text.replace('\n', ending), capacity).unwrap();
                    let expected = format!("line {line}: a quotation mark opens here");
                    assert!(found.starts_with(&expected), "{text:?}: {found}");
                }
                // Within a field they are text, and two of them between two others.
                for text in
                    ["id,note\na,5\" pipe\nb,\"5\"\" pipe\"\nc,\"\"\nd,\"x\ny\"\n", "a\n\"b\""]
                {
                    assert_eq!(fault(&text.replace('\n', ending), capacity), None, "{text:?}");
                }
            }
        }
    }

    /// A lone carriage return ends a line, too; between quotation marks every one is kept.
    #[test]
    fn other_carriage_returns_are_line_feeds() {
        for (text, expected) in [
            ("a\rb\r", "a\nb\n"),
            ("\r\r\n\"\r\n\"\r", "\n\n\"\r\n\"\n"),
            ("\r", "\n"),
            ("5\" pipe,\"a\rb\"\r", "5\" pipe,\"a\rb\"\n"),
        ] {
            for capacity in [1, 2, 64] {
                let inner = io::BufReader::with_capacity(capacity, text.as_bytes());
                let mut plain = LineFeeds::new(inner, b',');
                let mut found = Vec::new();
                // One byte at a time.
                let mut byte = [0];
                while plain.read(&mut byte).unwrap() > 0 {
                    found.push(byte[0]);
                }
                assert_eq!(String::from_utf8(found).unwrap(), expected);
            }
        }
    }

    /// Of two files, the one without the blank was read.
    #[test]
    fn blanks_count_within_quotation_marks_alone() {
        let rows = [
            ("a b , c\t,  \n", ["a b", "c", ""]),
            ("  a  b,\" c \" ,\" x \"\"y\"\" \"\n", ["a  b", " c ", " x \"y\" "]),
            // Blanks before a quotation mark do not matter; one inside of a field is text.
            (" \"a\" , b\" c\" ,\t\"\"\n", ["a", "b\" c\"", ""]),
            ("f, \" a, b\"\t, 12\" x\n", ["f", " a, b", "12\" x"]),
            ("\"a\" b, ,c ", ["a b", "", "c"]),
            ("\u{a0}a\u{3000},\u{c}b\u{a0} ,\" \u{a0}\"", ["a", "b", " "]),
        ];
        for ending in ["\n", "\r\n", "\r"] {
            for capacity in 48..64 {
                for (row, expected) in rows {
                    let text = format!("{:40}x, \u{a0}y\u{a0},\" z \" \n{row}", "");
                    let text = text.replace('\n', ending);
                    let inner = io::BufReader::with_capacity(capacity, text.as_bytes());
                    let mut table = reader(inner).unwrap();
                    let names = header(&mut table).unwrap();
                    assert_eq!(names.iter().collect::<Vec<_>>(), ["x", "y", "z"]);
                    let found = records(&mut table).next().unwrap().unwrap().1;
                    assert_eq!(found.iter().collect::<Vec<_>>(), expected, "{text:?}");
                }
            }
        }
        let mut table = reader(&b"a\tb \tc\n1\t\t 3 \n \n4\t5\t6"[..]).unwrap();
        assert_eq!(header(&mut table).unwrap().len(), 3);
        let found: Vec<_> = records(&mut table).map(|r| r.unwrap()).collect();
        assert_eq!((found[0].0, &found[0].1[1], &found[0].1[2]), (2, "", "3"));
        assert_eq!((found[1].0, &found[1].1[0]), (4, "4"), "a line of blanks is empty");
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
    fn lines_are_those_of_the_csv_crate_but_for_blanks_at_ends() {
        let fields = ["a", "", "b c", "x,y", "\"", "a\"b\"", "l\nm", "r\rs", "é;#'\t|", "-1.5"];
        let fields = fields.map(String::from);
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(&fields).unwrap();
        assert_eq!(line(&fields), writer.into_inner().unwrap());
        let blanks = [" a", "b\t", " ", "\" "].map(String::from);
        let written = line(&blanks);
        assert_eq!(written, b"\" a\",\"b\t\",\" \",\"\"\" \"\n");
        let text = [b"a,b,c,d\n", &written[..]].concat();
        let mut table = reader(&text[..]).unwrap();
        let found = records(&mut table).next().unwrap().unwrap().1;
        assert_eq!(found.iter().collect::<Vec<_>>(), blanks);
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
