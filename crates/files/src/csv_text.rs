//! CSV as spreadsheets and other programs write it: separated by commas, semicolons or tabs, with or
//! without a byte order mark.

use std::collections::HashSet;
use std::io::{self, BufRead};

/// A reader of the table in `text`, whose first line says what separates its fields: commas where
/// it has one, else semicolons, else tabs. Space around fields is left out.
///
/// # Errors
/// Reading fails, or the text is not UTF-8 but UTF-16, a feature file or a model; the error says so.
pub fn reader<R: BufRead>(mut text: R) -> io::Result<csv::Reader<R>> {
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
    let line = start.split(|&byte| byte == b'\n').next().unwrap_or_default();
    let delimiter =
        [b',', b';', b'\t'].into_iter().find(|byte| line.contains(byte)).unwrap_or(b',');
    if marked {
        text.consume(3);
    }
    let mut builder = csv::ReaderBuilder::new();
    Ok(builder.delimiter(delimiter).trim(csv::Trim::All).from_reader(text))
}

/// What is wrong with a table, and what to do about text that is not UTF-8, such as Excel's `CSV` in
/// Western Europe.
pub fn fault(error: &csv::Error) -> String {
    match (error.kind(), error.position()) {
        (csv::ErrorKind::Utf8 { .. }, position) => {
            let line = position.map(|p| format!("line {}: ", p.line())).unwrap_or_default();
            format!("{line}text that is not UTF-8: save the table as \"CSV UTF-8\"")
        }
        _ => error.to_string(),
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
        let error = table.records().next().unwrap().unwrap_err();
        let expected = "line 2: text that is not UTF-8: save the table as \"CSV UTF-8\"";
        assert_eq!(fault(&error), expected);
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
