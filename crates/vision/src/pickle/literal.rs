//! Numbers and strings as lines of a pickle.

pub(super) fn number(line: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(line).ok()?;
    text.strip_suffix('L').unwrap_or(text).trim().parse().ok()
}

/// The content of a Python 2 string literal.
pub(super) fn string(line: &[u8]) -> Option<Vec<u8>> {
    let (&quote, rest) = line.split_first()?;
    let (&last, body) = rest.split_last()?;
    if quote != last || !matches!(quote, b'\'' | b'"') {
        return None;
    }
    let mut out = Vec::with_capacity(body.len());
    let mut bytes = body.iter().copied();
    while let Some(b) = bytes.next() {
        if b != b'\\' {
            out.push(b);
            continue;
        }
        out.push(match bytes.next()? {
            b'n' => b'\n',
            b'r' => b'\r',
            b't' => b'\t',
            b'x' => hexadecimal(&mut bytes, 2)? as u8,
            same @ (b'\\' | b'\'' | b'"') => same,
            _ => return None,
        });
    }
    Some(out)
}

/// The UTF-8 of a text line.
pub(super) fn unicode(line: &[u8]) -> Option<Vec<u8>> {
    let mut out = String::new();
    let mut bytes = line.iter().copied();
    while let Some(b) = bytes.next() {
        // Raw bytes are latin-1, escapes are \uXXXX.
        let code = match b {
            b'\\' if bytes.next()? == b'u' => hexadecimal(&mut bytes, 4)?,
            b'\\' => return None,
            b => u32::from(b),
        };
        out.push(char::from_u32(code)?);
    }
    Some(out.into_bytes())
}

fn hexadecimal(bytes: &mut impl Iterator<Item = u8>, digits: usize) -> Option<u32> {
    (0..digits).try_fold(0, |n, _| Some(16 * n + char::from(bytes.next()?).to_digit(16)?))
}
