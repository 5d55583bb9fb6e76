//! The dictionary literal of a `.npy` header.

use super::dtype::DType;
use super::error::{NpyError, malformed};
use super::header::{Header, Order};

/// numpy's limit on the number of axes.
const MAX_AXES: usize = 64;

/// Reads the dictionary that `text` holds; it begins at byte `start` of the stream.
pub(super) fn header(text: &[u8], start: u64) -> Result<Header, NpyError> {
    Literal { text, at: 0, start }.header()
}

/// Reader of the dictionary literal: exactly the three keys in any order, in the subset of Python's
/// syntax that numpy and its imitators write.
struct Literal<'a> {
    text: &'a [u8],
    at: usize,
    /// Offset of `text` in the stream, for messages.
    start: u64,
}

impl Literal<'_> {
    fn header(mut self) -> Result<Header, NpyError> {
        let (mut dtype, mut order, mut shape) = (None, None, None);
        self.expect(b'{')?;
        while !self.accept(b'}') {
            let key_at = self.at;
            let key = self.string()?;
            self.expect(b':')?;
            let repeated = match key.as_str() {
                "descr" => dtype.replace(DType::parse(&self.string()?)?).is_some(),
                "fortran_order" => order.replace(self.boolean()?).is_some(),
                "shape" => shape.replace(self.tuple()?).is_some(),
                _ => true,
            };
            if repeated {
                let expected = "each of the keys descr, fortran_order and shape once";
                return Err(malformed(self.start + key_at as u64, expected, key));
            }
            if !self.accept(b',') {
                self.expect(b'}')?;
                break;
            }
        }
        self.skip_spaces();
        if self.at < self.text.len() {
            return Err(self.unexpected("only padding behind the dictionary"));
        }
        match (dtype, order, shape) {
            (Some(dtype), Some(order), Some(shape)) => Ok(Header { dtype, order, shape }),
            _ => Err(self.unexpected("the keys descr, fortran_order and shape")),
        }
    }

    fn skip_spaces(&mut self) {
        while self.text.get(self.at).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
    }

    fn accept(&mut self, byte: u8) -> bool {
        self.skip_spaces();
        let found = self.text.get(self.at) == Some(&byte);
        self.at += usize::from(found);
        found
    }

    fn expect(&mut self, byte: u8) -> Result<(), NpyError> {
        if self.accept(byte) {
            return Ok(());
        }
        Err(self.unexpected(&format!("{:?}", char::from(byte))))
    }

    fn unexpected(&self, expected: &str) -> NpyError {
        let rest = &self.text[self.at..];
        let actual = match rest {
            [] => "the end of the header".to_string(),
            _ => format!("{:?}", String::from_utf8_lossy(&rest[..rest.len().min(20)])),
        };
        malformed(self.start + self.at as u64, expected, actual)
    }

    fn take_while(&mut self, keep: impl Fn(u8) -> bool) -> String {
        let rest = &self.text[self.at..];
        let length = rest.iter().position(|&b| !keep(b)).unwrap_or(rest.len());
        self.at += length;
        String::from_utf8_lossy(&rest[..length]).into_owned()
    }

    fn string(&mut self) -> Result<String, NpyError> {
        self.skip_spaces();
        let quote = match self.text.get(self.at) {
            Some(&quote @ (b'\'' | b'"')) => quote,
            _ => return Err(self.unexpected("a quoted string")),
        };
        self.at += 1;
        let content = self.take_while(|b| b != quote);
        self.expect(quote)?;
        Ok(content)
    }

    fn boolean(&mut self) -> Result<Order, NpyError> {
        self.skip_spaces();
        let before = self.at;
        match self.take_while(|b| b.is_ascii_alphabetic()).as_str() {
            "True" => Ok(Order::Fortran),
            "False" => Ok(Order::C),
            _ => {
                self.at = before;
                Err(self.unexpected("True or False"))
            }
        }
    }

    fn tuple(&mut self) -> Result<Vec<u64>, NpyError> {
        let mut axes = Vec::new();
        self.expect(b'(')?;
        while !self.accept(b')') {
            self.skip_spaces();
            let before = self.at;
            let digits = self.take_while(|b| b.is_ascii_digit());
            // Python 2 wrote long integers as 5L.
            self.accept(b'L');
            match digits.parse() {
                Ok(length) if axes.len() < MAX_AXES => axes.push(length),
                _ => {
                    self.at = before;
                    return Err(self.unexpected(&format!("at most {MAX_AXES} axis lengths")));
                }
            }
            if !self.accept(b',') {
                self.expect(b')')?;
                break;
            }
        }
        Ok(axes)
    }
}
