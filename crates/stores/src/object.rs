//! An object, and which version of it is read.

use std::fmt;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use object_store::{ObjectMeta, ObjectStoreExt};

use crate::connect;
use crate::error::StoreError;
use crate::runtime;
use crate::uri::Uri;

/// An object of a store.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Object {
    /// Its name.
    pub uri: Uri,
    /// The version that a listing has shown.
    pub listed: Option<Version>,
}

/// What tells one version of an object from another.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Version {
    /// Length in bytes.
    pub size: u64,
    /// The store's entity tag, without quotation marks: some listings leave them out.
    pub etag: Option<String>,
    /// Last change in seconds since 1970, as answers have it (listings have fractions, too); `None`
    /// where the server does not say.
    pub modified: Option<i64>,
}

impl Version {
    pub(crate) fn of(meta: &ObjectMeta) -> Self {
        let modified = meta.last_modified.timestamp();
        // What the client puts where a web server says nothing.
        let modified = (modified != 0).then_some(modified);
        let etag = meta.e_tag.as_ref().map(|etag| etag.trim_matches('"').to_owned());
        // Of a file that nobody uploaded, a server before a disk has none.
        let etag = etag.filter(|etag| !etag.is_empty());
        Self { size: meta.size, etag, modified }
    }

    /// A text that two versions share only if nothing tells them apart; `None` where the server says
    /// nothing but the length.
    pub fn identity(&self) -> Option<String> {
        match (&self.etag, self.modified) {
            (Some(etag), _) => Some(format!("{}:etag:{etag}", self.size)),
            (None, Some(modified)) => Some(format!("{}:modified:{modified}", self.size)),
            (None, None) => None,
        }
    }

    /// The tag for `If-Match`, which weak tags do not match.
    pub(crate) fn strong_etag(&self) -> Option<String> {
        let strong = self.etag.as_ref().filter(|etag| !etag.starts_with("W/"));
        strong.map(|etag| format!("\"{etag}\""))
    }

    /// What happened between this version and another one.
    fn difference(&self, now: &Self) -> Option<String> {
        let same = match (&self.etag, &now.etag) {
            (Some(before), Some(now)) => before == now,
            _ => self.modified == now.modified,
        };
        match (self.size, now.size) {
            (old, new) if new > old => Some(format!("grew from {old} to {new} bytes")),
            (old, new) if new < old => Some(format!("was cut from {old} to {new} bytes")),
            _ if same => None,
            _ => Some("was replaced by another object".into()),
        }
    }
}

/// Keeps all reads of an object to one version: the first one that was met.
#[derive(Debug, Clone, Default)]
pub struct Pin(Arc<Mutex<Pinned>>);

#[derive(Debug, Default)]
struct Pinned {
    version: Option<Version>,
    changed: Option<String>,
}

impl Pin {
    /// A pin to a version that is known before the first read.
    pub fn to(version: Option<Version>) -> Self {
        Self(Arc::new(Mutex::new(Pinned { version, changed: None })))
    }

    fn lock(&self) -> MutexGuard<'_, Pinned> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The version that is read, once known.
    pub fn version(&self) -> Option<Version> {
        self.lock().version.clone()
    }

    /// What happened to the object while it was read, if anything.
    pub fn changed(&self) -> Option<String> {
        self.lock().changed.clone()
    }

    /// Takes note of the version that an answer is of.
    pub(crate) fn meet(&self, now: Version) -> Result<(), StoreError> {
        let mut pinned = self.lock();
        let Some(before) = &pinned.version else {
            pinned.version = Some(now);
            return Ok(());
        };
        match before.difference(&now) {
            None => Ok(()),
            Some(what) => {
                pinned.changed = Some(what.clone());
                Err(StoreError::Changed(what))
            }
        }
    }

    /// Takes note of what an answer says of the object.
    pub(crate) fn note(&self, error: &StoreError) {
        let mut pinned = self.lock();
        match error {
            StoreError::Changed(what) => pinned.changed = Some(what.clone()),
            StoreError::Missing if pinned.version.is_some() => {
                pinned.changed = Some("was removed".into());
            }
            _ => {}
        }
    }
}

impl fmt::Display for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.uri.fmt(f)
    }
}

impl Object {
    /// An object that no listing has shown.
    pub fn new(uri: Uri) -> Self {
        Self { uri, listed: None }
    }

    /// Its URI.
    pub fn name(&self) -> &str {
        self.uri.as_str()
    }

    /// Its URI, with the query of a web address: see [`Uri::address`].
    pub fn address(&self) -> String {
        self.uri.address()
    }

    /// Asks the store which version is there now. Waiting ends when `stop` is set.
    ///
    /// # Errors
    /// [`StoreError`]: there is none, or the store does not answer.
    pub fn look(&self, stop: &AtomicBool) -> Result<Version, StoreError> {
        let (store, path) = (connect::store(&self.uri)?, self.uri.path()?);
        let head = runtime::spawn(async move { store.head(&path).await });
        Ok(Version::of(&runtime::wait(&head, stop)??))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn version(size: u64, etag: Option<&str>, modified: Option<i64>) -> Version {
        Version { size, etag: etag.map(str::to_owned), modified }
    }

    #[test]
    fn a_pin_keeps_to_the_first_version() {
        let pin = Pin::default();
        pin.note(&StoreError::Missing);
        assert_eq!((pin.version(), pin.changed()), (None, None));
        let first = version(5, Some("a"), Some(1));
        pin.meet(first.clone()).unwrap();
        // A store that touches its copies does not change them.
        pin.meet(version(5, Some("a"), Some(2))).unwrap();
        for (other, what) in [
            (version(6, Some("b"), Some(1)), "grew from 5 to 6 bytes"),
            (version(4, Some("b"), Some(1)), "was cut from 5 to 4 bytes"),
            (version(5, Some("b"), Some(1)), "was replaced"),
        ] {
            assert!(
                matches!(pin.meet(other), Err(StoreError::Changed(told)) if told.contains(what))
            );
            assert!(pin.changed().unwrap().contains(what));
        }
        assert_eq!(pin.version(), Some(first));
    }

    #[test]
    fn versions_without_a_tag_go_by_time() {
        let pin = Pin::to(Some(version(5, None, Some(1))));
        pin.meet(version(5, None, Some(1))).unwrap();
        assert!(pin.meet(version(5, None, Some(2))).is_err());
        let identity = |etag, modified| version(5, etag, modified).identity();
        assert_eq!(identity(Some("a"), Some(1)).unwrap(), "5:etag:a");
        assert_eq!(identity(None, Some(1)).unwrap(), "5:modified:1");
        assert_eq!(identity(None, None), None);
        assert_eq!(version(5, Some("a"), None).strong_etag().unwrap(), "\"a\"");
        assert_eq!(version(5, Some("W/\"a"), None).strong_etag(), None);
    }

    #[test]
    fn an_object_that_goes_while_it_is_read_has_changed() {
        let pin = Pin::to(Some(version(5, None, Some(1))));
        pin.note(&StoreError::Failed("503".into()));
        assert_eq!(pin.changed(), None);
        pin.note(&StoreError::Missing);
        assert_eq!(pin.changed().unwrap(), "was removed");
    }
}
