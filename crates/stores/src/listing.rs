//! Which objects there are.

use std::sync::atomic::AtomicBool;
use std::time::{Duration, Instant};

use futures_util::TryStreamExt;

use crate::connect;
use crate::error::StoreError;
use crate::object::{Object, Version};
use crate::runtime;
use crate::uri::{Scheme, Uri};

/// How often a listing is asked for again, and how long after it was asked for first.
const MORE: u32 = 2;
const WITHIN: Duration = Duration::from_secs(60);

/// All objects below a folder, at any depth, sorted by the bytes of their keys. Waiting ends when `stop`
/// is set.
///
/// # Errors
/// [`StoreError`]; web servers have no folders that can be listed.
pub fn list(folder: &Uri, stop: &AtomicBool) -> Result<Vec<Object>, StoreError> {
    if folder.scheme == Scheme::Web {
        return Err(StoreError::Unsupported(
            "a web server does not list its files: name them, or list them in a manifest".into(),
        ));
    }
    let (store, path) = (connect::store(folder)?, folder.path()?);
    let prefix = (!path.is_root()).then_some(path);
    let (mut tries, begin) = (0, Instant::now());
    let found = loop {
        let (store, prefix) = (store.clone(), prefix.clone());
        let listing = runtime::spawn(async move {
            store.list(prefix.as_ref()).try_collect::<Vec<_>>().await.map_err(StoreError::from)
        });
        match runtime::wait(&listing, stop)? {
            // The client asks again by itself where it got no answer, but not for a page that broke off.
            Err(StoreError::Failed(_)) if tries < MORE && begin.elapsed() < WITHIN => tries += 1,
            found => break found?,
        }
    };
    let object = |meta: object_store::ObjectMeta| Object {
        uri: folder.with_key(meta.location.as_ref()),
        listed: Some(Version::of(&meta)),
    };
    let mut objects: Vec<Object> = found.into_iter().map(object).collect();
    let size = |object: &Object| object.listed.as_ref().map_or(0, |version| version.size);
    objects.sort_by(|a, b| a.uri.key().cmp(b.uri.key()).then(size(b).cmp(&size(a))));
    // The client takes the slash off the empty object that stands for a folder (`x.wav/`).
    objects.dedup_by(|b, a| size(b) == 0 && a.uri.key() == b.uri.key());
    Ok(objects)
}
