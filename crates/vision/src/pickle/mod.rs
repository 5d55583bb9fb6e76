//! A reader of text pickles (protocol 0) that hold lists, dictionaries, strings, numbers and numpy
//! arrays of floats. Nothing is called: a pickle that names any other function is refused. `corsmal_nets`
//! reads the binary pickles of PyTorch.

mod array;
mod literal;

use std::collections::HashMap;

use array::array;
use literal::{number, string, unicode};

pub(crate) use array::Array;

/// Place of a value in a [`Pickle`].
pub(crate) type Id = usize;

/// What a pickle holds.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Value {
    None,
    Number(f64),
    /// Python 2 strings are bytes; text is kept as UTF-8.
    Bytes(Vec<u8>),
    List(Vec<Id>),
    Dict(Vec<(Id, Id)>),
    Array(Array),
    Callable(Callable),
    /// Element type of an array: 8 or 4 bytes, byte order.
    Type {
        double: bool,
        little: bool,
    },
}

/// The three names of numpy that an array needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Callable {
    Reconstruct,
    NdArray,
    DType,
}

/// The values of a pickle; lists and dictionaries refer to others by [`Id`].
pub(crate) struct Pickle {
    values: Vec<Value>,
    pub(crate) root: Id,
}

impl Pickle {
    /// Reads a pickle; the text of an error gives the place in bytes.
    pub(crate) fn parse(bytes: &[u8]) -> Result<Self, String> {
        let mut machine =
            Machine { bytes, at: 0, values: vec![], stack: vec![], memo: HashMap::new() };
        let root = machine.run().map_err(|reason| format!("byte {}: {reason}", machine.at))?;
        Ok(Self { values: machine.values, root })
    }

    /// The value at a place.
    pub(crate) fn get(&self, id: Id) -> &Value {
        &self.values[id]
    }

    /// The entry of a dictionary.
    pub(crate) fn entry(&self, dict: Id, key: &str) -> Option<Id> {
        let Value::Dict(pairs) = self.get(dict) else { return None };
        let named = |id: Id| matches!(self.get(id), Value::Bytes(b) if b == key.as_bytes());
        // As in Python, the last of equal keys counts.
        pairs.iter().rev().find(|(k, _)| named(*k)).map(|(_, v)| *v)
    }
}

enum Item {
    Mark,
    Value(Id),
}

struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    values: Vec<Value>,
    stack: Vec<Item>,
    memo: HashMap<u64, Id>,
}

const SHORT: &str = "the pickle ends early or its stack is empty";

impl<'a> Machine<'a> {
    fn run(&mut self) -> Result<Id, String> {
        loop {
            let op = *self.bytes.get(self.at).ok_or(SHORT)?;
            self.at += 1;
            match op {
                b'.' => return self.pop(),
                b'(' => self.stack.push(Item::Mark),
                b'N' => self.push(Value::None),
                b'0' => drop(self.pop()?),
                b'I' | b'L' | b'F' => {
                    let line = self.line()?;
                    let value = number(line).ok_or_else(|| self.odd("a number", line))?;
                    self.push(Value::Number(value));
                }
                b'S' => {
                    let line = self.line()?;
                    let text = string(line).ok_or_else(|| self.odd("a quoted string", line))?;
                    self.push(Value::Bytes(text));
                }
                b'V' => {
                    let line = self.line()?;
                    let text = unicode(line).ok_or_else(|| self.odd("a text", line))?;
                    self.push(Value::Bytes(text));
                }
                b'l' | b't' => {
                    let items = self.since_mark()?;
                    self.push(Value::List(items));
                }
                b'd' => {
                    let items = self.since_mark()?;
                    if items.len() % 2 != 0 {
                        return Err("a dictionary with a key but no value".into());
                    }
                    let pairs = items.chunks_exact(2).map(|p| (p[0], p[1])).collect();
                    self.push(Value::Dict(pairs));
                }
                b'a' => {
                    let item = self.pop()?;
                    match self.top()? {
                        Value::List(items) => items.push(item),
                        _ => {
                            return Err(
                                "a value is appended to something that is not a list".into()
                            );
                        }
                    }
                }
                b's' => {
                    let (value, key) = (self.pop()?, self.pop()?);
                    match self.top()? {
                        Value::Dict(pairs) => pairs.push((key, value)),
                        _ => {
                            return Err(
                                "an entry is set in something that is not a dictionary".into()
                            );
                        }
                    }
                }
                b'p' => {
                    let key = self.key()?;
                    let id = self.top_id()?;
                    self.memo.insert(key, id);
                }
                b'g' => {
                    let key = self.key()?;
                    let id = *self.memo.get(&key).ok_or("a reference to nothing")?;
                    self.stack.push(Item::Value(id));
                }
                b'c' => {
                    let (module, name) = (self.line()?, self.line()?);
                    let callable = callable(module, name)?;
                    self.push(Value::Callable(callable));
                }
                b'R' => self.reduce()?,
                b'b' => self.build()?,
                other => {
                    return Err(format!(
                        "operation {:?}; only lists, dictionaries, strings, numbers and numpy \
                         arrays of protocol 0, as Python 2 writes them, are read; write JSON with the \
                         keys intrinsic and extrinsic instead",
                        char::from(other)
                    ));
                }
            }
        }
    }

    fn push(&mut self, value: Value) {
        self.values.push(value);
        self.stack.push(Item::Value(self.values.len() - 1));
    }

    fn pop(&mut self) -> Result<Id, String> {
        match self.stack.pop() {
            Some(Item::Value(id)) => Ok(id),
            _ => Err(SHORT.into()),
        }
    }

    fn top_id(&self) -> Result<Id, String> {
        match self.stack.last() {
            Some(Item::Value(id)) => Ok(*id),
            _ => Err(SHORT.into()),
        }
    }

    fn top(&mut self) -> Result<&mut Value, String> {
        let id = self.top_id()?;
        Ok(&mut self.values[id])
    }

    fn since_mark(&mut self) -> Result<Vec<Id>, String> {
        let mut items = Vec::new();
        loop {
            match self.stack.pop() {
                Some(Item::Value(id)) => items.push(id),
                Some(Item::Mark) => break,
                None => return Err(SHORT.into()),
            }
        }
        items.reverse();
        Ok(items)
    }

    /// The rest of the line, without its end.
    fn line(&mut self) -> Result<&'a [u8], String> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n').ok_or(SHORT)?;
        self.at += end + 1;
        Ok(rest[..end].strip_suffix(b"\r").unwrap_or(&rest[..end]))
    }

    fn key(&mut self) -> Result<u64, String> {
        let line = self.line()?;
        std::str::from_utf8(line)
            .ok()
            .and_then(|t| t.parse().ok())
            .ok_or_else(|| self.odd("a number", line))
    }

    fn odd(&self, expected: &str, line: &[u8]) -> String {
        let line = &line[..line.len().min(40)];
        format!("'{}' is not {expected}", String::from_utf8_lossy(line))
    }

    /// Only what numpy needs to make an empty array or a type is followed.
    fn reduce(&mut self) -> Result<(), String> {
        let (arguments, function) = (self.pop()?, self.pop()?);
        let made = match (&self.values[function], &self.values[arguments]) {
            (Value::Callable(Callable::Reconstruct), Value::List(of))
                if matches!(
                    of.first().map(|&id| &self.values[id]),
                    Some(Value::Callable(Callable::NdArray))
                ) =>
            {
                Value::Array(Array::default())
            }
            (Value::Callable(Callable::DType), Value::List(of)) => {
                let name = of.first().map(|&id| &self.values[id]);
                match name {
                    Some(Value::Bytes(b)) if b == b"f8" => {
                        Value::Type { double: true, little: true }
                    }
                    Some(Value::Bytes(b)) if b == b"f4" => {
                        Value::Type { double: false, little: true }
                    }
                    _ => return Err("an array whose elements are not floats (f4, f8)".into()),
                }
            }
            _ => return Err("a call of something other than numpy's array constructor".into()),
        };
        self.push(made);
        Ok(())
    }

    /// The state of an array or a type.
    fn build(&mut self) -> Result<(), String> {
        let state = self.pop()?;
        let Value::List(state) = self.values[state].clone() else {
            return Err("the state of an array is not a tuple".into());
        };
        let part = |i: usize| state.get(i).map(|&id| &self.values[id]);
        let built = match (self.values[self.top_id()?].clone(), part(1), part(2), part(3), part(4))
        {
            (Value::Type { double, .. }, Some(Value::Bytes(order)), ..) => {
                Value::Type { double, little: order != b">" }
            }
            (
                Value::Array(_),
                Some(Value::List(shape)),
                Some(&Value::Type { double, little }),
                Some(&Value::Number(fortran)),
                Some(Value::Bytes(raw)),
            ) => {
                let size = |&id: &Id| match self.values[id] {
                    Value::Number(n) if (0.0..=1e6).contains(&n) && n.fract() == 0.0 => {
                        Ok(n as usize)
                    }
                    _ => Err("the size of an array is not a small whole number"),
                };
                let shape = shape.iter().map(size).collect::<Result<Vec<_>, _>>()?;
                let array = array(shape, raw, double, little, fortran != 0.0)?;
                Value::Array(array)
            }
            _ => return Err("the state of an array is not as numpy writes it".into()),
        };
        *self.top()? = built;
        Ok(())
    }
}

fn callable(module: &[u8], name: &[u8]) -> Result<Callable, String> {
    match (module, name) {
        (b"numpy.core.multiarray" | b"numpy._core.multiarray", b"_reconstruct") => {
            Ok(Callable::Reconstruct)
        }
        (b"numpy", b"ndarray") => Ok(Callable::NdArray),
        (b"numpy", b"dtype") => Ok(Callable::DType),
        _ => Err(format!(
            "it names '{}.{}'; only numpy arrays are read from a pickle",
            String::from_utf8_lossy(&module[..module.len().min(40)]),
            String::from_utf8_lossy(&name[..name.len().min(40)])
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(text: &[u8]) -> String {
        Pickle::parse(text).err().expect("it must be refused")
    }

    #[test]
    fn a_pickle_that_calls_a_function_is_refused() {
        let text = b"cos\nsystem\np0\n(S'echo no'\np1\ntp2\nRp3\n.";
        assert!(refused(text).contains("'os.system'"), "{}", refused(text));
        for text in [
            &b"c__builtin__\neval\n(S'1'\ntR."[..],
            b"cnumpy\nload\n(S'x'\ntR.",
            b"cnumpy.core.multiarray\n_reconstruct\n(cnumpy\ndtype\n(I0\ntS'b'\ntR.",
            b"(ios\nsystem\n.",
            b"\x80\x02]q\x00.",
        ] {
            refused(text);
        }
    }

    #[test]
    fn faults_give_the_place() {
        for (text, part) in [
            (&b""[..], "ends early"),
            (b"(lp0\nI1x\na.", "'1x' is not a number"),
            (b"(lp0\n", "ends early"),
            (b"g7\n.", "reference to nothing"),
            (b"(I1\nd.", "no value"),
            (b"I1\nI2\na.", "not a list"),
            (b"S'abc\n.", "quoted string"),
        ] {
            let error = refused(text);
            assert!(error.starts_with("byte ") && error.contains(part), "{error}");
        }
    }

    #[test]
    fn escapes_orders_and_sizes() {
        let array = |state: &str, raw: &str| {
            format!(
                "cnumpy.core.multiarray\n_reconstruct\n(cnumpy\nndarray\n(I0\ntS'b'\ntR(I1\n(I1\n\
                 I2\ntcnumpy\ndtype\n(S'f4'\nI0\nI1\ntR(I3\nS'{state}'\nNNNI-1\nI-1\nI0\ntbI00\n\
                 S'{raw}'\ntb."
            )
        };
        let little = array("<", r"\x00\x00\x80?\x00\x00\x00@");
        let big = array(">", r"?\x80\x00\x00@\x00\x00\x00");
        for text in [little, big] {
            let pickle = Pickle::parse(text.as_bytes()).unwrap();
            let expected = Array { shape: vec![1, 2], data: vec![1.0, 2.0] };
            assert_eq!(pickle.get(pickle.root), &Value::Array(expected));
        }
        assert!(refused(array("<", "abcd").as_bytes()).contains("4 bytes"));
    }

    #[test]
    fn lists_that_hold_themselves_are_harmless() {
        let pickle = Pickle::parse(b"(lp0\ng0\na.").unwrap();
        assert_eq!(pickle.get(pickle.root), &Value::List(vec![pickle.root]));
    }
}
