//! The part of pickle that state dictionaries of PyTorch use. Nothing is called: the few classes
//! and functions that occur are known by name, everything else is refused. These are
//! binary pickles, from protocol 2 on; `corsmal_vision` reads those of protocol 0, which are text.

mod value;

pub(super) use value::{Storage, Tensor, Value};
use value::{call, global, size, storage};

/// Longest stack and memo accepted.
const MAX_VALUES: usize = 1 << 20;
/// Values made and copied in all; a long text counts for several.
const MAX_WORK: usize = 2 * MAX_VALUES;

/// Reads one pickle.
pub(super) fn read(bytes: &[u8]) -> Result<Value, String> {
    let (stack, memo, growing) = (Vec::new(), Vec::new(), Vec::new());
    let mut machine = Machine { bytes, at: 0, stack, memo, growing, work: 0 };
    loop {
        if let Some(value) = machine.step()? {
            return Ok(value);
        }
    }
}

struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    stack: Vec<Value>,
    memo: Vec<Value>,
    /// where lists and dictionaries of the memo are on the stack: the memo refers to them, and gets what is
    /// added to them later
    growing: Vec<(usize, usize)>,
    /// values made and copied so far
    work: usize,
}

impl Machine<'_> {
    fn take(&mut self, n: usize) -> Result<&[u8], String> {
        let end = self.at.checked_add(n).filter(|&e| e <= self.bytes.len());
        let end = end.ok_or_else(|| format!("the pickle ends within byte {}", self.at))?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], String> {
        let taken = self.take(N)?;
        taken.try_into().map_err(|_| "the pickle ends too early".into())
    }

    fn line(&mut self) -> Result<String, String> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|&b| b == b'\n').ok_or("the pickle ends within a name")?;
        let text = String::from_utf8_lossy(&rest[..end]).into_owned();
        self.at += end + 1;
        Ok(text)
    }

    fn text(&mut self, n: usize) -> Result<(), String> {
        let text =
            std::str::from_utf8(self.take(n)?).map_err(|e| format!("a name: {e}"))?.to_owned();
        self.push(Value::Text(text))
    }

    fn push(&mut self, value: Value) -> Result<(), String> {
        if self.stack.len() >= MAX_VALUES {
            return Err(format!("more than {MAX_VALUES} values"));
        }
        self.spend(1)?;
        self.forget_popped();
        self.stack.push(value);
        Ok(())
    }

    fn spend(&mut self, values: usize) -> Result<(), String> {
        self.work += values;
        if self.work > MAX_WORK { Err("too many values".into()) } else { Ok(()) }
    }

    fn pop(&mut self) -> Result<Value, String> {
        self.stack.pop().ok_or_else(|| format!("byte {}: the stack is empty", self.at))
    }

    fn since_mark(&mut self) -> Result<Vec<Value>, String> {
        let mark = self.stack.iter().rposition(|v| *v == Value::Mark);
        let mark = mark.ok_or_else(|| format!("byte {}: no mark", self.at))?;
        let items = self.stack.split_off(mark + 1);
        self.stack.pop();
        Ok(items)
    }

    fn remember(&mut self, index: usize) -> Result<(), String> {
        if index >= MAX_VALUES {
            return Err(format!("more than {MAX_VALUES} values"));
        }
        let value = self.stack.last().cloned().ok_or("the stack is empty")?;
        self.count(&value)?;
        if self.memo.len() <= index {
            self.memo.resize(index + 1, Value::None);
        }
        self.forget_popped();
        if matches!(value, Value::List(_) | Value::Dict(_)) {
            self.growing.push((self.stack.len() - 1, index));
        }
        self.memo[index] = value;
        Ok(())
    }

    /// Drops places of what is on the stack no more.
    fn forget_popped(&mut self) {
        let height = self.stack.len();
        while self.growing.last().is_some_and(|(place, _)| *place >= height) {
            self.growing.pop();
        }
    }

    /// Adds to the memo's copy of the list or dictionary on top of the stack what is added to that.
    fn grow(&mut self, items: &[Value]) -> Result<(), String> {
        self.forget_popped();
        let Some(top) = self.stack.len().checked_sub(1) else { return Ok(()) };
        for at in (0..self.growing.len()).rev() {
            let (place, index) = self.growing[at];
            if place != top {
                break;
            }
            items.iter().try_for_each(|item| self.count(item))?;
            match &mut self.memo[index] {
                Value::List(list) => list.extend_from_slice(items),
                Value::Dict(dict) => {
                    dict.extend(
                        items.chunks_exact(2).map(|pair| (pair[0].clone(), pair[1].clone())),
                    );
                }
                _ => (),
            }
        }
        Ok(())
    }

    fn recall(&mut self, index: usize) -> Result<(), String> {
        let value =
            self.memo.get(index).cloned().ok_or("a value is recalled that was never stored")?;
        self.count(&value)?;
        self.push(value)
    }

    /// Copies are counted: a pickle of a few bytes could double its values again and again.
    fn count(&mut self, value: &Value) -> Result<(), String> {
        self.spend(size(value, 0)?)
    }

    fn step(&mut self) -> Result<Option<Value>, String> {
        let code = self.array::<1>()?[0];
        match code {
            0x80 => {
                let version = self.array::<1>()?[0];
                if version > 5 {
                    return Err(format!("pickle protocol {version} is unknown"));
                }
            }
            0x95 => {
                self.array::<8>()?;
            }
            b'(' => self.push(Value::Mark)?,
            b'.' => return self.pop().map(Some),
            b'N' => self.push(Value::None)?,
            0x88 => self.push(Value::Bool(true))?,
            0x89 => self.push(Value::Bool(false))?,
            b'K' => {
                let n = self.array::<1>()?[0];
                self.push(Value::Int(n.into()))?;
            }
            b'M' => {
                let n = u16::from_le_bytes(self.array()?);
                self.push(Value::Int(n.into()))?;
            }
            b'J' => {
                let n = i32::from_le_bytes(self.array()?);
                self.push(Value::Int(n.into()))?;
            }
            0x8a => {
                let n = usize::from(self.array::<1>()?[0]);
                if n > 8 {
                    return Err("a whole number beyond 64 bits".into());
                }
                let mut all = [0u8; 8];
                all[..n].copy_from_slice(self.take(n)?);
                let negative = n > 0 && all[n - 1] & 0x80 != 0;
                if negative {
                    all[n..].fill(0xff);
                }
                self.push(Value::Int(i64::from_le_bytes(all)))?;
            }
            b'G' => {
                self.array::<8>()?;
                self.push(Value::Float)?;
            }
            b'X' => {
                let n = u32::from_le_bytes(self.array()?) as usize;
                self.text(n)?;
            }
            0x8c => {
                let n = usize::from(self.array::<1>()?[0]);
                self.text(n)?;
            }
            b'U' => {
                let n = usize::from(self.array::<1>()?[0]);
                self.text(n)?;
            }
            b')' => self.push(Value::Tuple(Vec::new()))?,
            b't' => {
                let items = shallow(self.since_mark()?)?;
                self.push(Value::Tuple(items))?;
            }
            0x85..=0x87 => {
                let n = usize::from(code - 0x84);
                let at = self.stack.len().checked_sub(n).ok_or("the stack is empty")?;
                let items = shallow(self.stack.split_off(at))?;
                self.push(Value::Tuple(items))?;
            }
            b']' => self.push(Value::List(Vec::new()))?,
            b'}' => self.push(Value::Dict(Vec::new()))?,
            b'a' | b'e' => {
                let items = if code == b'a' { vec![self.pop()?] } else { self.since_mark()? };
                let items = shallow(items)?;
                if !matches!(self.stack.last(), Some(Value::List(_))) {
                    return Err("a value is appended to something that is not a list".into());
                }
                self.grow(&items)?;
                if let Some(Value::List(list)) = self.stack.last_mut() {
                    list.extend(items);
                }
            }
            b's' | b'u' => {
                let items = if code == b's' {
                    let value = self.pop()?;
                    vec![self.pop()?, value]
                } else {
                    self.since_mark()?
                };
                let items = shallow(items)?;
                if !matches!(self.stack.last(), Some(Value::Dict(_))) {
                    return Err("a value is set in something that is not a dictionary".into());
                }
                self.grow(&items)?;
                if let Some(Value::Dict(dict)) = self.stack.last_mut() {
                    let mut items = items.into_iter();
                    while let (Some(key), Some(value)) = (items.next(), items.next()) {
                        dict.push((key, value));
                    }
                }
            }
            b'c' => {
                let (module, name) = (self.line()?, self.line()?);
                self.push(Value::Global(global(&module, &name)?))?;
            }
            0x93 => {
                let (name, module) = (self.pop()?, self.pop()?);
                let (Value::Text(module), Value::Text(name)) = (module, name) else {
                    return Err("a class without a name".into());
                };
                self.push(Value::Global(global(&module, &name)?))?;
            }
            b'R' => {
                let (arguments, function) = (self.pop()?, self.pop()?);
                let value = call(function, arguments)?;
                self.push(value)?;
            }
            b'b' => {
                // State of an object: an OrderedDict's attributes (PyTorch's `_metadata`).
                self.pop()?;
                if !matches!(self.stack.last(), Some(Value::Dict(_))) {
                    return Err("an object of an unknown class".into());
                }
            }
            b'Q' => {
                let id = self.pop()?;
                self.push(storage(id)?)?;
            }
            b'q' => {
                let n = usize::from(self.array::<1>()?[0]);
                self.remember(n)?;
            }
            b'r' => {
                let n = u32::from_le_bytes(self.array()?) as usize;
                self.remember(n)?;
            }
            0x94 => self.remember(self.memo.len())?,
            b'h' => {
                let n = usize::from(self.array::<1>()?[0]);
                self.recall(n)?;
            }
            b'j' => {
                let n = u32::from_le_bytes(self.array()?) as usize;
                self.recall(n)?;
            }
            b'0' => {
                self.pop()?;
            }
            other => {
                return Err(format!("byte {}: pickle code {other:#04x} is not read", self.at - 1));
            }
        }
        Ok(None)
    }
}

/// Values that are about to go into another one; refuses those that would lie too deep there. A value
/// nested deeper could not even be dropped: each level takes a piece of the stack.
fn shallow(items: Vec<Value>) -> Result<Vec<Value>, String> {
    items.iter().try_for_each(|item| size(item, 1).map(|_| ()))?;
    Ok(items)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What was added to a list after its first use was missing where it was used again.
    #[test]
    fn what_is_recalled_is_whole() {
        // {"a": [5, 6], "b": the same list}
        let shared = b"\x80\x02}q\x00(X\x01\0\0\0a]q\x01(K\x05K\x06eX\x01\0\0\0bh\x01u.";
        let list = Value::List(vec![Value::Int(5), Value::Int(6)]);
        let key = |name: &str| Value::Text(name.into());
        let both = vec![(key("a"), list.clone()), (key("b"), list)];
        assert_eq!(read(shared).unwrap(), Value::Dict(both));
        // In batches, as long lists are written.
        let batches = b"\x80\x02(]q\0q\x01(K\x05e(K\x06eh\0h\x01t.";
        let list = Value::List(vec![Value::Int(5), Value::Int(6)]);
        assert_eq!(read(batches).unwrap(), Value::Tuple(vec![list; 3]));
        let mut long = b"\x80\x02]q\0".to_vec();
        for _ in 0..200 {
            long.extend(b"(");
            long.extend(b"K\x05".repeat(1000));
            long.extend(b"e");
        }
        long.extend(b".");
        assert!(matches!(read(&long), Ok(Value::List(list)) if list.len() == 200_000));
        // A list in the place of one that was dropped is not that one: [dropped, [7]]
        let dropped = b"\x80\x02(]q\x000]K\x07ah\x00t.";
        let seven = Value::List(vec![Value::Int(7)]);
        assert_eq!(read(dropped).unwrap(), Value::Tuple(vec![seven, Value::List(Vec::new())]));
    }
}
