//! `.pth`: PyTorch's zip archive of a pickle and raw numbers.

use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

use zip::ZipArchive;

use super::numbers::{MAX_FILE, State, numbers};
use super::pickle::{self, Storage, Tensor, Value};

/// Longest pickle read.
const MAX_PICKLE: u64 = 64 << 20;
/// Keys under which training scripts keep the weights beside other things.
const INNER: [&str; 3] = ["state_dict", "model_state_dict", "model"];

/// Whether a zip archive is one of `torch.save`.
pub(super) fn is_archive(path: &Path) -> bool {
    let archive = File::open(path).ok().and_then(|f| ZipArchive::new(BufReader::new(f)).ok());
    archive.is_some_and(|a| a.file_names().any(|name| name.is_ok_and(|name| is_pickle(&name))))
}

fn is_pickle(name: &str) -> bool {
    name == "data.pkl" || name.ends_with("/data.pkl")
}

pub(super) fn read(path: &Path) -> Result<State, String> {
    let file = File::open(path).map_err(|e| e.to_string())?;
    let length = file.metadata().map_err(|e| e.to_string())?.len();
    let mut archive = ZipArchive::new(BufReader::new(file)).map_err(|e| {
        format!(
            "not an archive as torch.save writes it since PyTorch 1.6 ({e}); load it with PyTorch and \
             save net.state_dict() again"
        )
    })?;
    let names: Vec<String> = archive
        .file_names()
        .map(|name| name.map(|n| n.into_owned()).map_err(|e| e.to_string()))
        .collect::<Result<_, _>>()?;
    let pickle = names.iter().find(|name| is_pickle(name)).ok_or("it has no data.pkl")?;
    let root = pickle.strip_suffix("data.pkl").unwrap_or("").to_owned();
    if let Ok(order) = member(&mut archive, &format!("{root}byteorder"), 16)
        && order != b"little"
    {
        return Err("its numbers are big-endian; only little-endian ones are read".into());
    }
    let bytes = member(&mut archive, pickle, MAX_PICKLE)?;
    let entries = entries(pickle::read(&bytes)?)?;
    // Tensors that share a storage one after another: each is read once, and one is held at a time.
    let mut order: Vec<usize> = (0..entries.len()).collect();
    order.sort_by_key(|&i| (&entries[i].1.storage.key, entries[i].1.storage.kind));
    let mut state: Vec<(usize, Vec<f32>)> = Vec::with_capacity(entries.len());
    let mut held: Option<(&Storage, Vec<f32>)> = None;
    let mut total = 0u64;
    for i in order {
        let (name, tensor) = &entries[i];
        let wrong = |reason: String| format!("{name}: {reason}");
        // A storage may be shared; what all tensors together take is bounded by the file.
        let count = count(tensor).ok_or_else(|| wrong("its shape is too large".into()))?;
        let size = tensor.storage.kind.size() as u64;
        total = total.saturating_add((count as u64).saturating_mul(size));
        if total > length.saturating_mul(2) {
            return Err(wrong("the tensors are larger than the file".into()));
        }
        let same = |s: &Storage| (&s.key, s.kind) == (&tensor.storage.key, tensor.storage.kind);
        let values = match held.take().filter(|(storage, _)| same(storage)) {
            Some((_, values)) => values,
            None => {
                let key = format!("{root}data/{}", tensor.storage.key);
                let raw = member(&mut archive, &key, MAX_FILE.min(length)).map_err(wrong)?;
                numbers(tensor.storage.kind, &raw)
            }
        };
        if values.len() < tensor.storage.len {
            return Err(wrong(format!("{} numbers of {}", values.len(), tensor.storage.len)));
        }
        let seen = view(tensor, count, &values)
            .ok_or_else(|| wrong("its shape reaches beyond its numbers".into()))?;
        state.push((i, seen));
        held = Some((&tensor.storage, values));
    }
    state.sort_by_key(|&(i, _)| i);
    let state = entries.into_iter().zip(state);
    Ok(state.map(|((name, tensor), (_, values))| (name, tensor.shape, values)).collect())
}

fn member(
    archive: &mut ZipArchive<BufReader<File>>,
    name: &str,
    most: u64,
) -> Result<Vec<u8>, String> {
    let member = archive.by_name(name).map_err(|e| format!("{name}: {e}"))?;
    let mut bytes = Vec::new();
    member.take(most + 1).read_to_end(&mut bytes).map_err(|e| format!("{name}: {e}"))?;
    if bytes.len() as u64 > most {
        return Err(format!("{name} has more than {most} bytes"));
    }
    Ok(bytes)
}

/// Tensors by name.
type Entries = Vec<(String, Tensor)>;

/// Those of the dictionary itself or, where it has none, of one of its known keys.
fn entries(value: Value) -> Result<Entries, String> {
    const NONE: &str = "it does not hold a dictionary of tensors";
    let Value::Dict(dict) = value else { return Err(NONE.into()) };
    let mut tensors = Vec::new();
    let mut inner: Option<(String, Entries)> = None;
    let (mut conflict, mut fault) = (None, None);
    for (key, value) in dict {
        match (key, value) {
            (Value::Text(name), Value::Tensor(tensor)) => tensors.push((name, tensor)),
            (Value::Text(name), value @ Value::Dict(_)) if INNER.contains(&name.as_str()) => {
                match (entries(value), &inner) {
                    (Ok(found), None) => inner = Some((name, found)),
                    (Ok(found), Some((other, before))) if !are_same(&found, before) => {
                        conflict = Some(format!(
                            "{other} and {name} are dictionaries of different tensors: save the one \
                             that is meant"
                        ));
                    }
                    (Ok(_), Some(_)) => (),
                    (Err(inside), _) => fault = Some(inside),
                }
            }
            _ => (),
        }
    }
    match (inner, conflict) {
        _ if !tensors.is_empty() => Ok(tensors),
        (_, Some(conflict)) => Err(conflict),
        (Some((_, inner)), None) => Ok(inner),
        (None, None) => Err(fault.unwrap_or_else(|| NONE.into())),
    }
}

/// Whether they are the same, in any order.
fn are_same(one: &Entries, other: &Entries) -> bool {
    let sorted = |entries: &Entries| {
        let mut sorted: Vec<(String, Tensor)> = entries.clone();
        sorted.sort_by(|a, b| a.0.cmp(&b.0));
        sorted
    };
    one == other || sorted(one) == sorted(other)
}

fn count(tensor: &Tensor) -> Option<usize> {
    tensor.shape.iter().try_fold(1usize, |n, &s| n.checked_mul(s))
}

/// The tensor's numbers in C order.
fn view(tensor: &Tensor, count: usize, values: &[f32]) -> Option<Vec<f32>> {
    let mut out = Vec::with_capacity(count);
    let mut index = vec![0usize; tensor.shape.len()];
    for _ in 0..count {
        let mut at = tensor.offset;
        for (i, stride) in index.iter().zip(&tensor.strides) {
            at = at.checked_add(i.checked_mul(*stride)?)?;
        }
        out.push(*values.get(at)?);
        for (i, &size) in index.iter_mut().zip(&tensor.shape).rev() {
            *i += 1;
            if *i < size {
                break;
            }
            *i = 0;
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::pickle::Storage;
    use super::*;
    use crate::weights::numbers::Kind;

    #[test]
    fn one_dictionary_of_tensors_is_found() {
        let tensor = |key: &str| {
            let storage = Storage { kind: Kind::F32, key: key.into(), len: 1 };
            Value::Tensor(Tensor { storage, offset: 0, shape: vec![1], strides: vec![1] })
        };
        let dict = |items: &[(&str, Value)]| {
            let pair = |(key, value): &(&str, Value)| (Value::Text((*key).into()), value.clone());
            Value::Dict(items.iter().map(pair).collect())
        };
        let one = dict(&[("a", tensor("0")), ("b", tensor("1"))]);
        let turned = dict(&[("b", tensor("1")), ("a", tensor("0"))]);
        let other = dict(&[("a", tensor("2")), ("b", tensor("1"))]);
        let names = |value: Value| entries(value).map(|found| found.len());
        assert_eq!(names(one.clone()), Ok(2));
        assert_eq!(names(dict(&[("model", one.clone()), ("state_dict", turned)])), Ok(2));
        assert_eq!(names(dict(&[("model", dict(&[])), ("state_dict", one.clone())])), Ok(2));
        let two = dict(&[("model", one.clone()), ("state_dict", other)]);
        assert!(names(two.clone()).unwrap_err().contains("different tensors"));
        assert!(names(dict(&[("model", two.clone())])).unwrap_err().contains("different tensors"));
        assert_eq!(names(dict(&[("a", tensor("0")), ("model", two)])), Ok(1));
    }
}
