//! Puts a file into a store, whole or not at all.

use std::fs::File;
use std::io::Read;
use std::path::Path as FilePath;
use std::pin::pin;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use bytes::Bytes;
use futures_util::StreamExt;
use futures_util::future::{Either, select};
use futures_util::stream::FuturesUnordered;
use object_store::path::Path;
use object_store::{MultipartUpload, ObjectStore, ObjectStoreExt, PutMode};

use crate::connect;
use crate::error::StoreError;
use crate::object::Object;
use crate::runtime;
use crate::uri::Scheme;

/// Files up to this size go in one request; larger ones in parts of at least so many bytes (8 MiB).
const PART: u64 = 8 << 20;
/// Most parts of an object; stores allow 10,000.
const MOST_PARTS: u64 = 9_000;
/// Parts on their way at the same time.
const AHEAD: usize = 3;
/// How often an upload looks whether it should stop, and how long the store has to forget its parts.
const LOOK: Duration = Duration::from_millis(50);
const FORGET: Duration = Duration::from_secs(5);

/// What to do with an object that is there already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Existing {
    /// Leave it: [`StoreError::Exists`].
    Keep,
    /// Replace it.
    Replace,
}

/// Copies a file into a store. The object appears when all of it is there, and nobody sees a part of it.
/// Where another one must stay, the store itself refuses a file of up to 8 MiB; before the last step of a
/// larger one, it is asked whether an object has appeared. When `stop` is set, the parts are given up.
///
/// # Errors
/// [`StoreError`]; web servers take no files.
pub fn upload(
    file: &FilePath,
    object: &Object,
    existing: Existing,
    stop: &Arc<AtomicBool>,
) -> Result<(), StoreError> {
    if object.uri.scheme == Scheme::Web {
        return Err(StoreError::Unsupported("outputs cannot be written to a web server".into()));
    }
    let failed = |e: std::io::Error| StoreError::File(format!("{}: {e}", file.display()));
    let content = File::open(file).map_err(failed)?;
    let size = content.metadata().map_err(failed)?.len();
    let (store, path) = (connect::store(&object.uri)?, object.uri.path()?);
    let sending = Sending { store, path, existing, part: PART.max(size.div_ceil(MOST_PARTS)) };
    let stop = stop.clone();
    let sent = runtime::spawn(async move {
        if size <= PART {
            sending.whole(content, &stop).await
        } else {
            sending.parts(content, &stop).await
        }
    });
    // It ends by itself soon after a stop.
    match runtime::wait(&sent, &AtomicBool::new(false))? {
        Err(StoreError::Missing) => Err(StoreError::Setup("the store has no such bucket".into())),
        sent => sent,
    }
}

struct Sending {
    store: Arc<dyn ObjectStore>,
    path: Path,
    existing: Existing,
    part: u64,
}

impl Sending {
    async fn whole(self, mut content: File, stop: &AtomicBool) -> Result<(), StoreError> {
        let bytes = next(&mut content, PART)?;
        let mode = match self.existing {
            Existing::Keep => PutMode::Create,
            Existing::Replace => PutMode::Overwrite,
        };
        let put = self.store.put_opts(&self.path, bytes.clone().into(), mode.into());
        match until(put, stop).await?.map(drop).map_err(StoreError::from) {
            // The answer to it may have been lost, and the client's next try met the object.
            Err(StoreError::Exists) if until(self.holds(&bytes), stop).await? => Ok(()),
            sent => sent,
        }
    }

    /// Whether the object has these bytes.
    async fn holds(&self, bytes: &Bytes) -> bool {
        match self.store.get(&self.path).await {
            Ok(there) if there.meta.size == bytes.len() as u64 => {
                there.bytes().await.is_ok_and(|there| there == *bytes)
            }
            Ok(_) | Err(_) => false,
        }
    }

    async fn parts(self, content: File, stop: &AtomicBool) -> Result<(), StoreError> {
        let mut upload = until(self.store.put_multipart(&self.path), stop).await??;
        let sent = until(self.send(upload.as_mut(), content), stop).await;
        match sent.and_then(|sent| sent) {
            Ok(()) => Ok(()),
            Err(error) => {
                // The error matters; what the store keeps of the parts, its rules remove.
                let _ = tokio::time::timeout(FORGET, upload.abort()).await;
                Err(error)
            }
        }
    }

    async fn send(
        &self,
        upload: &mut dyn MultipartUpload,
        mut content: File,
    ) -> Result<(), StoreError> {
        let mut coming = FuturesUnordered::new();
        loop {
            let bytes = next(&mut content, self.part)?;
            if bytes.is_empty() {
                break;
            }
            if coming.len() == AHEAD
                && let Some(sent) = coming.next().await
            {
                sent?;
            }
            coming.push(upload.put_part(bytes.into()));
        }
        while let Some(sent) = coming.next().await {
            sent?;
        }
        if self.existing == Existing::Keep {
            match self.store.head(&self.path).await.map_err(StoreError::from) {
                Ok(_) => return Err(StoreError::Exists),
                Err(StoreError::Missing) => {}
                Err(error) => return Err(error),
            }
        }
        upload.complete().await?;
        Ok(())
    }
}

/// The next bytes of a file, fewer at its end.
fn next(content: &mut File, most: u64) -> Result<Bytes, StoreError> {
    let mut bytes = Vec::new();
    content.take(most).read_to_end(&mut bytes).map_err(|e| StoreError::File(e.to_string()))?;
    Ok(bytes.into())
}

/// The result of work, unless `stop` is set before it comes.
async fn until<T>(work: impl Future<Output = T>, stop: &AtomicBool) -> Result<T, StoreError> {
    let stopped = async {
        while !stop.load(Ordering::Relaxed) {
            tokio::time::sleep(LOOK).await;
        }
    };
    // Looked at first: work that never waits would be done before.
    match select(pin!(stopped), pin!(work)).await {
        Either::Left(_) => Err(StoreError::Stopped),
        Either::Right((result, _)) => Ok(result),
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use object_store::memory::InMemory;

    use super::*;

    /// A file of so many bytes, and what the store holds after it was sent in parts of 1000 bytes.
    fn send(
        size: usize,
        before: Option<&[u8]>,
        existing: Existing,
        stop: bool,
    ) -> (Vec<u8>, Result<(), StoreError>, Option<Vec<u8>>) {
        let content: Vec<u8> = (0..size).map(|i| ((i * 7919) >> 5) as u8).collect();
        let mut file = tempfile::tempfile().unwrap();
        file.write_all(&content).unwrap();
        std::io::Seek::rewind(&mut file).unwrap();
        let (store, path) = (Arc::new(InMemory::new()), Path::from("x"));
        let before = before.map(<[u8]>::to_vec);
        let work = runtime::spawn(async move {
            if let Some(before) = before {
                store.put(&path, before.into()).await.unwrap();
            }
            let sending =
                Sending { store: store.clone(), path: path.clone(), existing, part: 1000 };
            let stop = AtomicBool::new(stop);
            let sent = if size <= 1000 {
                sending.whole(file, &stop).await
            } else {
                sending.parts(file, &stop).await
            };
            let there = match store.get(&path).await {
                Ok(there) => Some(there.bytes().await.unwrap().to_vec()),
                Err(_) => None,
            };
            (sent, there)
        });
        let (sent, there) = runtime::wait(&work, &AtomicBool::new(false)).unwrap();
        (content, sent, there)
    }

    #[test]
    fn files_of_any_size_arrive_whole() {
        for size in [0, 1, 1000, 1001, 2000, 12_345] {
            let (content, sent, there) = send(size, None, Existing::Keep, false);
            assert_eq!((sent, there), (Ok(()), Some(content.clone())), "{size}");
            let (content, sent, there) = send(size, Some(b"old"), Existing::Replace, false);
            assert_eq!((sent, there), (Ok(()), Some(content)), "{size}");
        }
    }

    #[test]
    fn an_object_that_is_there_stays() {
        for size in [10, 5000] {
            let (_, sent, there) = send(size, Some(b"old"), Existing::Keep, false);
            assert_eq!(
                (sent, there.as_deref()),
                (Err(StoreError::Exists), Some(&b"old"[..])),
                "{size}"
            );
        }
    }

    /// A store whose answer was lost has the object: the next try of the client meets it.
    #[test]
    fn an_object_that_arrived_is_sent() {
        let content: Vec<u8> = (0..10usize).map(|i| ((i * 7919) >> 5) as u8).collect();
        let (_, sent, there) = send(10, Some(&content), Existing::Keep, false);
        assert_eq!((sent, there), (Ok(()), Some(content)));
    }

    #[test]
    fn a_stop_leaves_nothing() {
        let (_, sent, there) = send(50_000_000, None, Existing::Keep, true);
        assert_eq!((sent, there), (Err(StoreError::Stopped), None));
    }
}
