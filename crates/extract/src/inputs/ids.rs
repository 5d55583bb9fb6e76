//! Unique ids for a list of inputs.

use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::{Component, Path};

use super::error::InputError;
use super::found::{Found, Naming};
use super::input::InputSource;
use super::stored;
use corsmal_files::quote::quoted;
use corsmal_files::table::RESERVED;

/// Longest id in bytes, far below what a zip archive can name.
const LONGEST: usize = 4096;
/// numpy cannot tell `x` in `x.npy` from `x.npy` in `x.npy.npy`.
const NPY: &str = ".npy";

/// Why an id that the user gave cannot be.
pub(super) fn refusal(id: &str) -> Option<String> {
    let reason = if id.starts_with(RESERVED) {
        format!("must not begin with {RESERVED}")
    } else if id.ends_with(NPY) {
        format!("must not end in {NPY}")
    } else if id.len() > LONGEST {
        format!("must not be longer than {LONGEST} bytes")
    } else if id.starts_with('/') || climbs(id) {
        "must not be an absolute path or contain ..".to_string()
    } else if id.chars().any(char::is_control) {
        "must not contain control characters".to_string()
    } else {
        return None;
    };
    Some(format!("id {} {reason}", quoted(id)))
}

/// Why a label cannot be called so: its column becomes a member of an archive, too.
pub(super) fn label_refusal(labels: &[(String, String)]) -> Option<String> {
    let (name, _) = labels.iter().find(|(name, _)| climbs(name))?;
    Some(format!("the label {} must not contain .. as a path does", quoted(name)))
}

/// Whether what unpacks a member of this name may write elsewhere.
fn climbs(name: &str) -> bool {
    name.split(['/', '\\']).any(|part| part == "..")
}

/// The id of each input: given ones as they are, others from the shortest form of their path that
/// collides with none.
pub(super) fn assign(found: &[Found]) -> Result<Vec<String>, InputError> {
    let mut named: HashMap<Option<&InputSource>, usize> = HashMap::new();
    // Only a stretch asks whether there are others of its file.
    if found.iter().any(|found| times(found).is_some()) {
        for found in found.iter().filter(|found| matches!(found.naming, Naming::Derived(_))) {
            *named.entry(place(found)).or_default() += 1;
        }
    }
    let forms = |found: &Found| {
        let mut forms = forms(found);
        let repeated = named.get(&place(found)).is_some_and(|n| *n > 1);
        if let (true, Some(times)) = (repeated, times(found)) {
            forms.iter_mut().for_each(|id| id.push_str(&times));
        }
        forms
    };
    let mut ids: Vec<String> = found.iter().map(|found| forms(found).swap_remove(0)).collect();
    let mut levels = vec![0; found.len()];
    let mut order: Vec<usize> = (0..found.len()).collect();
    loop {
        order.sort_unstable_by(|a, b| ids[*a].cmp(&ids[*b]).then(a.cmp(b)));
        let mut changed = Vec::new();
        for group in order.chunk_by(|a, b| ids[*a] == ids[*b]).filter(|group| group.len() > 1) {
            let before = changed.len();
            // The hash is for those that nothing else tells apart.
            for last in [1, 0] {
                for &index in group {
                    let mut forms = forms(&found[index]);
                    if levels[index] + 1 + last < forms.len() {
                        levels[index] += 1;
                        changed.push((index, forms.swap_remove(levels[index])));
                    }
                }
                if changed.len() > before {
                    break;
                }
            }
            if changed.len() == before {
                if let (InputSource::Member(one), InputSource::Member(other)) =
                    (&found[group[0]].source, &found[group[1]].source)
                    && one.path == other.path
                {
                    return Err(InputError::MemberTwice { path: one.path.clone() });
                }
                return Err(InputError::Duplicate {
                    id: forms(&found[group[0]]).swap_remove(0),
                    first: found[group[0]].described(),
                    second: found[group[1]].described(),
                });
            }
        }
        if changed.is_empty() {
            return Ok(ids);
        }
        changed.into_iter().for_each(|(index, id)| ids[index] = id);
    }
}

/// The ids that an input may have, best first.
fn forms(found: &Found) -> Vec<String> {
    match (&found.naming, &found.source) {
        (Naming::Given(id), _) => vec![id.clone()],
        (Naming::Derived(relative), source) => {
            let path = match source {
                InputSource::File(path) | InputSource::Pipe(path) => path.clone(),
                InputSource::Object(object) => stored::path_in_store(object).into(),
                InputSource::Member(member) => member.path.clone(),
                InputSource::Memory(_) | InputSource::Stdin => return vec![id_of(relative)],
            };
            let mut forms = Vec::new();
            for path in [relative, &path] {
                forms.push(id_of(&path.with_extension("")));
                forms.push(id_of(path));
            }
            forms.retain(|id| !id.ends_with(NPY));
            if forms.is_empty() {
                forms.push(format!("{}_", id_of(relative)));
            }
            forms.push(format!("{}~{}", id_of(&path), fingerprint(&path)));
            forms
        }
    }
}

/// The file or object, where it is one.
fn place(found: &Found) -> Option<&InputSource> {
    match &found.source {
        InputSource::File(_) | InputSource::Object(_) => Some(&found.source),
        InputSource::Pipe(_)
        | InputSource::Member(_)
        | InputSource::Memory(_)
        | InputSource::Stdin => None,
    }
}

/// The stretch after the id of a file that is there more than once.
fn times(found: &Found) -> Option<String> {
    match (&found.naming, found.start, found.end) {
        (Naming::Given(_), ..) | (_, None, None) => None,
        (_, start, None) => Some(format!("@{:?}-", start.unwrap_or(0.0))),
        (_, start, Some(end)) => Some(format!("@{:?}-{end:?}", start.unwrap_or(0.0))),
    }
}

fn id_of(path: &Path) -> String {
    let parts: Vec<String> = path
        .components()
        .filter_map(|part| match part {
            Component::Normal(name) => Some(readable(name)),
            _ => None,
        })
        .collect();
    let id = parts.join("/").replace(char::is_control, "\u{fffd}");
    // Parts between backslashes are folders elsewhere.
    let id = if climbs(&id) { id.replace("..", "_") } else { id };
    if id.starts_with(RESERVED) { format!("./{id}") } else { id }
}

/// Of the bytes of a path, of which an id loses some, such as where it begins.
fn fingerprint(path: &Path) -> String {
    let mut hash = blake3::Hasher::new();
    for part in path.components() {
        match part {
            Component::Normal(name) => hash.update(name.as_encoded_bytes()).update(b"/"),
            Component::ParentDir => hash.update(b"../"),
            Component::RootDir => hash.update(b"/"),
            Component::CurDir | Component::Prefix(_) => continue,
        };
    }
    hash.finalize().to_hex()[..8].into()
}

/// A name as text: bytes that are not UTF-8 as `\xff`, so that different names stay different.
fn readable(name: &OsStr) -> String {
    let mut text = String::new();
    for chunk in name.as_encoded_bytes().utf8_chunks() {
        text.push_str(chunk.valid());
        text.extend(chunk.invalid().iter().map(|byte| format!("\\x{byte:02x}")));
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found((relative, path): (&str, &str)) -> Found {
        Found {
            source: InputSource::File(path.into()),
            naming: Naming::Derived(relative.into()),
            start: None,
            end: None,
            labels: Vec::new(),
            line: None,
        }
    }

    #[test]
    fn plain_names_get_no_hash() {
        let files = [
            ("x.flac", "1/x.flac"),
            ("x.wav", "1/x.wav"),
            ("x.wav", "2/x.wav"),
            ("1/x.wav", "R/1/x.wav"),
        ];
        assert_eq!(assign(&files.map(found)).unwrap(), ["x.flac", "1/x.wav", "2/x", "R/1/x"]);
    }

    /// They were refused as one file that is named twice.
    #[test]
    fn paths_that_begin_elsewhere_are_other_files() {
        let paths = ["aud/x.wav", "../aud/x.wav", "/aud/x.wav", "aud/../aud/x.wav"];
        let mut ids = assign(&paths.map(|path| found(("x.wav", path)))).unwrap();
        ids.sort();
        ids.dedup();
        assert_eq!(ids.len(), 4, "{ids:?}");
        let same = ["aud/x.wav", "./aud/x.wav"].map(|path| found(("x.wav", path)));
        assert!(matches!(assign(&same), Err(InputError::Duplicate { .. })));
    }
}
