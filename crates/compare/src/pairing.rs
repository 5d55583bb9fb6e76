//! What tells that a recording of one file is one of the other.

use std::collections::{BTreeMap, HashMap, HashSet};

use corsmal_files::outcome::Outcome;
use serde::Serialize;

/// What recordings of two files are paired by.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PairedBy {
    /// Their ids.
    #[default]
    Id,
    /// The last parts of their ids, where no id is in both files.
    FileName,
    /// The identities of their files, as far as they are whole files, where no file name is in both either.
    Content,
}

impl PairedBy {
    /// In the order of trial: the first one that pairs any recordings counts.
    pub(super) const ALL: [Self; 3] = [Self::Id, Self::FileName, Self::Content];

    /// What a recording is known by; none where its content is not known.
    pub(super) fn key<'k>(self, identities: &'k Identities, id: &'k str) -> Option<&'k str> {
        match self {
            Self::Id => Some(id),
            Self::FileName => id.rsplit('/').next(),
            Self::Content => identities.of_whole(id),
        }
    }
}

/// Identities of the contents of recordings, as far as they are known.
#[derive(Debug, Default)]
pub(super) struct Identities(BTreeMap<String, FileIdentity>);

#[derive(Debug)]
struct FileIdentity {
    hash: String,
    /// Whether the recording is known to be the whole file, and not a stretch of it.
    is_whole: bool,
}

impl Identities {
    pub(super) fn new(outcomes: &[Outcome]) -> Self {
        // Objects of stores have identities of other kinds, which say nothing beside a hash.
        let is_hash = |o: &&Outcome| {
            let hash = o.identity.split_once(':').map(|(_, hash)| hash);
            hash.is_some_and(|hash| hash.len() == 64 && hash.bytes().all(|b| b.is_ascii_hexdigit()))
        };
        let file = |o: &Outcome| {
            let is_whole = o.start_frame.is_none() && o.declared_frames == Some(o.decoded_frames);
            (o.id.clone(), FileIdentity { hash: o.identity.clone(), is_whole })
        };
        Self(outcomes.iter().filter(is_hash).map(file).collect())
    }

    /// The recordings whose paired ones have another content, by their ids.
    pub(super) fn other(&self, paired: &Self, by: PairedBy) -> HashSet<String> {
        let theirs: HashMap<&str, &str> = paired
            .0
            .iter()
            .filter_map(|(id, file)| Some((by.key(paired, id)?, file.hash.as_str())))
            .collect();
        let is_other = |id: &str, file: &FileIdentity| {
            by.key(self, id).and_then(|key| theirs.get(key)).is_some_and(|hash| *hash != file.hash)
        };
        self.0.iter().filter(|(id, file)| is_other(id, file)).map(|(id, _)| id.clone()).collect()
    }

    /// Every recording and its identity.
    pub(super) fn iter(&self) -> impl Iterator<Item = (String, String)> + '_ {
        self.0.iter().map(|(id, file)| (id.clone(), file.hash.clone()))
    }

    /// The identity of a recording that is a whole file.
    fn of_whole(&self, id: &str) -> Option<&str> {
        self.0.get(id).filter(|file| file.is_whole).map(|file| file.hash.as_str())
    }
}
