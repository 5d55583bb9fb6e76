//! Annotated rows of several files, found by recording.

use std::collections::HashMap;
use std::hash::Hash;
use std::path::Path;

use super::annotation::{Annotation, Annotations};
use super::container::{Container, Subset};
use super::oddity::Oddity;
use super::recording::Recording;

/// A row and the file that it is in.
type AnnotatedRow<'a> = (&'a Path, &'a Annotation);

/// Annotated rows by id within their part, whose numbers start at 0 each, and by container and
/// sequence.
pub(super) struct Index<'a> {
    by_id: HashMap<(Subset, u32), AnnotatedRow<'a>>,
    by_sequence: HashMap<(u8, u16), AnnotatedRow<'a>>,
    /// Files that say different things about one recording, one entry for each two of them.
    pub(super) contradictions: Vec<Oddity>,
}

impl<'a> Index<'a> {
    /// Where several files have a recording the first one counts, of those with ids before those
    /// without.
    pub(super) fn new(files: &'a [Annotations]) -> Self {
        let mut index =
            Self { by_id: HashMap::new(), by_sequence: HashMap::new(), contradictions: Vec::new() };
        let with_ids = |file: &&Annotations| file.rows.iter().any(|row| row.id.is_some());
        let (flat, tree): (Vec<_>, Vec<_>) = files.iter().partition(with_ids);
        for file in flat.into_iter().chain(tree) {
            let mut told: Vec<&Path> = Vec::new();
            for row in &file.rows {
                let Some(container) = Container::new(row.container) else { continue };
                let found = (file.path.as_path(), row);
                let by_id = row.id.and_then(|id| {
                    let other = insert(&mut index.by_id, (container.subset(), id), found)?;
                    let differ = row.container != other.1.container
                        || differ(row.name(), other.1.name())
                        || contradict(row, other.1);
                    differ.then(|| (other.0, format!("id {id}")))
                });
                let by_sequence = row.sequence.and_then(|sequence| {
                    let key = (row.container, sequence);
                    let other = insert(&mut index.by_sequence, key, found)?;
                    let text = || format!("container {} sequence {sequence}", row.container);
                    contradict(row, other.1).then(|| (other.0, text()))
                });
                if let Some((other, which)) = by_id.or(by_sequence)
                    && !told.contains(&other)
                {
                    told.push(other);
                    let what = match other == file.path {
                        true => format!("has two rows about {which} that contradict each other"),
                        false => format!("contradicts {} about {which}", other.display()),
                    };
                    index.contradictions.push(Oddity { path: file.path.clone(), what });
                }
            }
        }
        index
    }

    pub(super) fn find(&self, recording: &Recording) -> Option<&'a Annotation> {
        let by_sequence = recording
            .container
            .zip(recording.sequence)
            .and_then(|(c, s)| self.by_sequence.get(&(c.number(), s)));
        let by_id = || self.by_id.get(&(recording.part, recording.id?));
        by_sequence.or_else(by_id).map(|(_, row)| *row)
    }
}

/// Keeps what is there already, and gives it back.
fn insert<'a, K: Hash + Eq>(
    map: &mut HashMap<K, AnnotatedRow<'a>>,
    key: K,
    found: AnnotatedRow<'a>,
) -> Option<AnnotatedRow<'a>> {
    let kept = *map.entry(key).or_insert(found);
    (!std::ptr::eq(kept.1, found.1)).then_some(kept)
}

/// Whether two rows of one recording cannot both be true. Scenario, background and illumination of
/// a sequence number are known to differ between the official files and ACC's.
fn contradict(a: &Annotation, b: &Annotation) -> bool {
    let number = |value: f64| (value >= 0.0).then_some(value);
    differ(a.filling, b.filling)
        || differ(number(a.capacity_ml), number(b.capacity_ml))
        || differ(number(a.filling_mass_g), number(b.filling_mass_g))
}

/// Whether both are known and not the same.
fn differ<T: PartialEq>(a: Option<T>, b: Option<T>) -> bool {
    a.zip(b).is_some_and(|(a, b)| a != b)
}
