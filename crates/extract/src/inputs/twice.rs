//! Files that are given twice.

use std::collections::HashMap;
use std::hash::{BuildHasher, RandomState};
use std::path::{Path, PathBuf};

use corsmal_files::spelling;

use super::input::{Input, InputSource};

/// That files, or the same stretches of them, are given under two ids.
pub(super) fn told(inputs: &[Input]) -> Option<String> {
    let folder = std::env::current_dir().unwrap_or_default();
    let hashes = RandomState::new();
    // Hashes alone are kept: there may be millions.
    let mut seen: HashMap<u64, usize> = HashMap::new();
    let mut twice = inputs.iter().enumerate().filter_map(|(index, input)| {
        let place = place(input, &folder)?;
        let before = *seen.entry(hashes.hash_one(&place)).or_insert(index);
        let is_same = before != index && self::place(&inputs[before], &folder) == Some(place);
        is_same.then_some((&inputs[before], input))
    });
    let (one, other) = twice.next()?;
    let of = format!("{} is given as {} and as {}", other.source, one.id, other.id);
    Some(match twice.count() {
        0 => format!("{of}, so it has a row for each"),
        more => format!("{of}, so it has a row for each (the first of {} such inputs)", more + 1),
    })
}

type Stretch = (Option<u64>, Option<u64>);

/// Where a file lies, links not followed, and which stretch of it is meant.
fn place(input: &Input, folder: &Path) -> Option<(PathBuf, Stretch)> {
    let InputSource::File(path) = &input.source else { return None };
    let start = input.start.filter(|&start| start > 0.0);
    let stretch = (start.map(f64::to_bits), input.end.map(f64::to_bits));
    Some((spelling::plain_path(&folder.join(path)), stretch))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn input(id: &str, path: &Path, start: Option<f64>) -> Input {
        let source = InputSource::File(path.to_owned());
        Input { id: id.into(), source, start, end: None, labels: Vec::new() }
    }

    /// A folder named twice, once in full, gave two rows for each recording without a word.
    #[test]
    fn one_file_in_two_spellings_is_told() {
        let folder = std::env::current_dir().unwrap();
        let whole = folder.join("a/x.wav");
        let part = Path::new("a/./x.wav");
        let said = told(&[input("x", part, None), input("y", &whole, None)]).unwrap();
        assert!(said.ends_with("is given as x and as y, so it has a row for each"), "{said}");
        let said = [("x", None), ("y", Some(1.0)), ("z", Some(1.0)), ("w", Some(1.0))];
        let said = told(&said.map(|(id, start)| input(id, part, start))).unwrap();
        assert!(
            said.contains("as y and as z, so") && said.ends_with("(the first of 2 such inputs)")
        );
        let from_0 = told(&[input("x", part, None), input("y", part, Some(0.0))]);
        assert!(from_0.unwrap().contains("as x and as y"));
        assert_eq!(told(&[input("x", part, None), input("y", part, Some(1.0))]), None);
    }

    /// Names that are no UTF-8 looked the same.
    #[cfg(target_os = "linux")]
    #[test]
    fn names_of_any_bytes_are_told_apart() {
        use std::os::unix::ffi::OsStrExt;

        let named = |byte: u8| Path::new(std::ffi::OsStr::from_bytes(&[b'a', byte])).to_owned();
        let (one, other) = (input("x", &named(0xfe), None), input("y", &named(0xff), None));
        assert_eq!(told(&[one, other]), None);
    }
}
