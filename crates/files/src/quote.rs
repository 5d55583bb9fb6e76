//! What messages repeat of an input.

use std::fmt::Write;

/// Characters of an input that a message repeats at most.
pub const LONGEST: usize = 120;

/// A piece of an input for a message: in quotation marks, control characters and what is invisible
/// escaped, cut to a length that a terminal shows.
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", shown(text))
}

/// As [`quoted`], without quotation marks.
pub fn shown(text: &str) -> String {
    let mut out = String::new();
    let mut left = text.chars();
    for character in left.by_ref().take(LONGEST) {
        match character {
            // What a debug format escapes for its own sake.
            '\'' | '"' => out.push(character),
            _ => out.extend(character.escape_debug()),
        }
    }
    let more = left.count();
    if more > 0 {
        // Writing to a string cannot fail.
        let _ = write!(out, "… ({more} more characters)");
    }
    out
}

/// Characters of a whole message that are shown at most.
const LONGEST_MESSAGE: usize = 4000;

/// A whole message as a terminal may have it, whatever it repeats: control characters but line feeds
/// and tabs escaped, not endless, and without what may be secret in addresses.
pub fn printable(message: &str) -> String {
    escaped(message, |character| matches!(character, '\n' | '\t'))
}

/// As [`printable`], on one line: line feeds and tabs, which the names of files may have, are
/// escaped as well.
pub fn printable_line(text: &str) -> String {
    escaped(text, |_| false)
}

fn escaped(message: &str, is_kept: fn(char) -> bool) -> String {
    // Twice as many, so that no secret is cut in two before it is found.
    let mut beyond = message.chars();
    let begin: String = beyond.by_ref().take(2 * LONGEST_MESSAGE).collect();
    let begin = without_secrets(&begin);
    let mut out = String::with_capacity(begin.len().min(LONGEST_MESSAGE));
    let mut left = begin.chars();
    for character in left.by_ref().take(LONGEST_MESSAGE) {
        match character {
            _ if is_kept(character) => out.push(character),
            _ if character.is_control() || is_direction(character) => {
                out.extend(character.escape_debug());
            }
            _ => out.push(character),
        }
    }
    let more = left.count() + beyond.count();
    if more > 0 {
        // Writing to a string cannot fail.
        let _ = write!(out, "… ({more} more characters)");
    }
    out
}

/// A message without passwords in addresses, and without the queries of web addresses, which may be signatures. An
/// address ends at a blank or a quotation mark.
fn without_secrets(message: &str) -> String {
    const SCHEME: &str = "://";
    let ends = |c: char| c.is_whitespace() || "\"`<>".contains(c);
    let (mut out, mut left) = (String::with_capacity(message.len()), message);
    while let Some(at) = left.find(SCHEME) {
        let (before, after) = left.split_at(at + SCHEME.len());
        out.push_str(before);
        let word = &after[..after.find(ends).unwrap_or(after.len())];
        let host = &word[user(word)..];
        left = &after[word.len() - host.len()..];
        let scheme = before.to_ascii_lowercase();
        let is_web = ["http://", "https://"].iter().any(|web| scheme.ends_with(web));
        // A list of addresses may follow: each has its turn.
        let query = host.find('?').filter(|&at| is_web && !host[..at].contains(SCHEME));
        if let Some(query) = query {
            // What ends the name in the message, such as a colon.
            let behind = host.trim_end_matches([':', ',', ';', '.', ')', '\'']).len().max(query);
            out.extend([&host[..query], &host[behind..]]);
            left = &left[host.len()..];
        }
    }
    out.push_str(left);
    out
}

/// Length of a user and password at the beginning of an address.
fn user(address: &str) -> usize {
    let authority = address.split(['/', '?', '#']).next().unwrap_or_default();
    let is_port = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    let length = match authority.rfind('@') {
        Some(at) if authority[..at].contains(':') => Some(at),
        Some(_) => None,
        // Secrets of stores have slashes.
        None => {
            let port = authority.split_once(':').map(|(_, port)| port);
            port.filter(|port| !authority.starts_with('[') && !is_port(port))
                .and_then(|_| address.find('@'))
        }
    };
    length.map_or(0, |at| at + 1)
}

/// Whether a character changes the order in which those around it are shown.
fn is_direction(character: char) -> bool {
    matches!(character, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_long_is_cut_and_what_is_invisible_escaped() {
        assert_eq!(quoted("träning/1"), "\"träning/1\"");
        assert_eq!(shown("a\u{1b}[2Jb\n\u{202e}"), "a\\u{1b}[2Jb\\n\\u{202e}");
        assert_eq!(shown("it's"), "it's");
        assert_eq!(printable("a: b\n\tc\u{7}\u{2066}ü"), "a: b\n\tc\\u{7}\\u{2066}ü");
        assert_eq!(printable_line("a\n\tb\u{7}"), "a\\n\\tb\\u{7}");
        assert!(printable(&"x".repeat(1_000_000)).len() < 4100);
        // Looking for secrets takes no longer for it.
        assert!(printable(&"a://".repeat(1_000_000)).ends_with("(3996000 more characters)"));
        for (message, shown) in [
            ("https://h:8/x.wav?key=secret: gone", "https://h:8/x.wav: gone"),
            ("a \"http://me:secret@h/x.wav\", b", "a \"http://h/x.wav\", b"),
            ("s3://ID:se/cret@bucket/x.wav, y://z?", "s3://bucket/x.wav, y://z?"),
            ("abfss://c@account/x: https://", "abfss://c@account/x: https://"),
            ("s3://b/what?.wav", "s3://b/what?.wav"),
            ("http://h:8765/take@2.wav: io", "http://h:8765/take@2.wav: io"),
            ("s3://lab/05-01T10:20:30@site.wav", "s3://lab/05-01T10:20:30@site.wav"),
            ("s3://b/x.wav,s3://b/a@b.wav", "s3://b/x.wav,s3://b/a@b.wav"),
            ("http://h/a,http://u:secret@h/b?c: d", "http://h/a,http://h/b: d"),
            ("HTTPS://h/x?a='b'&key=secret; e", "HTTPS://h/x; e"),
            ("http://[::1]:80/a@b", "http://[::1]:80/a@b"),
        ] {
            assert_eq!(printable(message), shown);
        }
        let long = shown(&"x".repeat(1_000_000));
        assert!(long.len() < 200 && long.ends_with("x… (999880 more characters)"), "{long}");
    }
}
