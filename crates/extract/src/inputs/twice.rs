//! Files that are given twice.

use std::collections::HashMap;
use std::hash::{BuildHasher, RandomState};
use std::path::Path;

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
        0 => format!("{of}: it has a row for each, which folds may separate"),
        more => {
            format!(
                "{of}, and {more} more are given twice: they have a row for each, which folds may separate"
            )
        }
    })
}

type Stretch = (Option<u64>, Option<u64>);

/// Where a file lies, links not followed, and which stretch of it is meant.
fn place(input: &Input, folder: &Path) -> Option<(String, Stretch)> {
    let InputSource::File(path) = &input.source else { return None };
    let path = spelling::plain(&folder.join(path).to_string_lossy());
    Some((path, (input.start.map(f64::to_bits), input.end.map(f64::to_bits))))
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
        assert!(said.contains("is given as x and as y: it has"), "{said}");
        let said = [("x", None), ("y", Some(1.0)), ("z", Some(1.0)), ("w", Some(1.0))];
        let said = told(&said.map(|(id, start)| input(id, part, start))).unwrap();
        assert!(said.contains("as y and as z, and 1 more"), "{said}");
        assert_eq!(told(&[input("x", part, None), input("y", part, Some(1.0))]), None);
    }
}
