//! What a file without samples or features is.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use corsmal_extract::config::{Config, ConfigError};

/// First bytes of a model file.
const MODEL: &[u8] = b"CORSMDL\0";
/// Bytes that are looked at.
const START: u64 = 4096;
/// Digits of the check sum at the beginning of a ledger.
const DIGITS: usize = 32;

/// What a file without samples or features may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A trained classifier.
    Model,
    /// Weights, alone or with what trained them.
    Tensors,
    /// JSON: one value, or one a line.
    Json,
    /// The record of an unfinished run.
    Ledger,
    /// PNG or JPEG.
    Picture,
    /// A pickle, as calibrations are.
    Pickle,
    /// Lines of values that commas, semicolons or tabs separate.
    Table,
    /// A configuration of `extract`.
    Configuration,
    /// A page or figure for other programs to show.
    Page(&'static str),
}

/// What a file is by its first bytes, if it is one of these.
pub fn of(path: &Path) -> io::Result<Option<Kind>> {
    let mut start = Vec::new();
    File::open(path)?.take(START).read_to_end(&mut start)?;
    Ok(match start.as_slice() {
        bytes if bytes.starts_with(MODEL) => Some(Kind::Model),
        // The length of a header below 4 GiB, and the header's brace.
        [_, _, _, _, 0, 0, 0, 0, b'{', ..] => Some(Kind::Tensors),
        [0x89, b'P', b'N', b'G', ..] | [0xff, 0xd8, 0xff, ..] => Some(Kind::Picture),
        // Text in UTF-16, which readers of tables name; MPEG audio begins alike.
        [0xff, 0xfe, _, 0, _, 0, ..] | [0xfe, 0xff, 0, _, 0, ..] => Some(Kind::Table),
        [b'%', b'P', b'D', b'F', b'-', ..] => Some(Kind::Page("PDF")),
        // A text pickle begins with a mark, and another one or a list, dictionary or tuple.
        [b'(', b'(' | b'l' | b'd' | b't', ..] | [0x80, 2..=5, ..] => Some(Kind::Pickle),
        bytes if is_ledger(bytes) => Some(Kind::Ledger),
        bytes => match text(bytes) {
            Some(text) => of_text(text, path),
            None => None,
        },
    })
}

fn is_ledger(start: &[u8]) -> bool {
    let split = start.split_at_checked(DIGITS);
    split.is_some_and(|(check, rest)| {
        check.iter().all(u8::is_ascii_hexdigit) && rest.starts_with(b" {")
    })
}

/// The text that a file begins with, up to a character that may be cut.
fn text(start: &[u8]) -> Option<&str> {
    let start = start.strip_prefix(b"\xef\xbb\xbf").unwrap_or(start);
    let text = match std::str::from_utf8(start) {
        Ok(text) => text,
        Err(error) if error.error_len().is_none() => {
            std::str::from_utf8(&start[..error.valid_up_to()]).ok()?
        }
        Err(_) => return None,
    };
    let plain = |c: char| !c.is_control() || matches!(c, '\n' | '\r' | '\t');
    text.chars().all(plain).then_some(text)
}

fn of_text(text: &str, path: &Path) -> Option<Kind> {
    let content = text.trim_start();
    let mut marks = content.chars().filter(|c| !c.is_whitespace());
    match (marks.next(), marks.next()) {
        (Some('{'), Some('"' | '}')) => return Some(Kind::Json),
        // A table of TOML begins with a name.
        (Some('['), Some('{' | '[' | '"' | ']' | '-' | '0'..='9'))
            if !content.starts_with("[[") =>
        {
            return Some(Kind::Json);
        }
        _ => {}
    }
    let beginning: String = content.chars().take(15).collect::<String>().to_ascii_lowercase();
    if beginning.starts_with("<!doctype html") || beginning.starts_with("<html") {
        return Some(Kind::Page("HTML"));
    }
    if beginning.starts_with("<svg") || (beginning.starts_with("<?xml") && content.contains("<svg"))
    {
        return Some(Kind::Page("SVG"));
    }
    if is_configuration(content, path) {
        return Some(Kind::Configuration);
    }
    text.lines().next().is_some_and(|line| line.contains([',', ';', '\t'])).then_some(Kind::Table)
}

/// Whether it is a configuration, if perhaps with faults, and not just any text.
fn is_configuration(content: &str, path: &Path) -> bool {
    let tables = ["[features", "[signal", "[summary"];
    let named = content.lines().any(|line| tables.iter().any(|table| line.starts_with(table)));
    named
        && !matches!(
            Config::load(path, &[]),
            Err(ConfigError::Syntax { .. } | ConfigError::Read { .. })
        )
}
