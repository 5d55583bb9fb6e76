//! What tells that a recording of one file is one of the other.

use std::collections::BTreeMap;

use corsmal_files::identity;
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
    /// The identities of their contents, where no file name is in both either.
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
            Self::Content => identities.of(id),
        }
    }
}

/// Identities of the contents of recordings, as far as they are known.
#[derive(Debug, Default)]
pub(super) struct Identities(BTreeMap<String, String>);

impl Identities {
    pub(super) fn new(outcomes: &[Outcome]) -> Self {
        let known = |o: &&Outcome| !o.identity.is_empty() && o.identity != identity::STREAM;
        let identity = |o: &Outcome| (o.id.clone(), o.identity.clone());
        Self(outcomes.iter().filter(known).map(identity).collect())
    }

    /// Every recording and its identity.
    pub(super) fn iter(&self) -> impl Iterator<Item = (String, String)> + '_ {
        self.0.iter().map(|(id, identity)| (id.clone(), identity.clone()))
    }

    /// The identity of a recording.
    pub(super) fn of(&self, id: &str) -> Option<&str> {
        self.0.get(id).map(String::as_str)
    }
}
