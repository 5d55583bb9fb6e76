//! The threads that wait for the network.
//!
//! A fork copies memory but no threads: each process has a runtime of its own. It copies locks as well, and
//! one that another thread held at that moment is never let go: nobody waits for one without end.

use std::future::Future;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Mutex, MutexGuard, TryLockError};
use std::time::{Duration, Instant};

use tokio::runtime::{Builder, Handle, Runtime};
use tokio::task::AbortHandle;

use crate::error::StoreError;

/// Threads: they wait, decrypt and copy.
const THREADS: usize = 2;
/// How often one that waits looks whether it should stop.
const LOOK: Duration = Duration::from_millis(50);

/// How long to wait for a lock that is held for the time it takes to make a client.
const PATIENCE: Duration = Duration::from_secs(10);

static HERE: Mutex<Option<(u32, Runtime)>> = Mutex::new(None);

/// Locks what all threads of a process share.
///
/// # Errors
/// The lock is that of a thread that is not here.
pub(crate) fn lock<T>(shared: &Mutex<T>) -> Result<MutexGuard<'_, T>, StoreError> {
    lock_within(shared, PATIENCE)
}

fn lock_within<T>(shared: &Mutex<T>, patience: Duration) -> Result<MutexGuard<'_, T>, StoreError> {
    let begin = Instant::now();
    loop {
        match shared.try_lock() {
            Ok(guard) => return Ok(guard),
            Err(TryLockError::Poisoned(poisoned)) => return Ok(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) if begin.elapsed() > patience => {
                return Err(StoreError::Setup(
                    "this process was forked while another thread used a store: start processes by \
                     `spawn` or `forkserver`"
                        .into(),
                ));
            }
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(1)),
        }
    }
}

/// The runtime of this process.
fn handle() -> Result<Handle, StoreError> {
    let process = std::process::id();
    let mut here = lock(&HERE)?;
    match here.take() {
        Some((owner, runtime)) if owner == process => {
            let handle = runtime.handle().clone();
            *here = Some((owner, runtime));
            return Ok(handle);
        }
        // The parent's: its threads are not here, so nothing must wait for them.
        Some((_, runtime)) => std::mem::forget(runtime),
        None => {}
    }
    let runtime = Builder::new_multi_thread()
        .worker_threads(THREADS)
        .thread_name("stores")
        .enable_all()
        .build()
        .map_err(|e| StoreError::Setup(format!("no threads for the network: {e}")))?;
    let handle = runtime.handle().clone();
    *here = Some((process, runtime));
    Ok(handle)
}

/// Work that goes on while its result is not asked for; given up when dropped.
pub(crate) struct Coming<T> {
    result: Receiver<T>,
    task: Option<AbortHandle>,
    failed: Option<StoreError>,
}

impl<T> Drop for Coming<T> {
    fn drop(&mut self) {
        self.task.iter().for_each(AbortHandle::abort);
    }
}

/// Starts work.
pub(crate) fn spawn<T: Send + 'static>(
    work: impl Future<Output = T> + Send + 'static,
) -> Coming<T> {
    let (send, result) = sync_channel(1);
    let spawned = handle().map(|handle| {
        handle.spawn(async move {
            // Nobody waits any more: nothing to do.
            let _ = send.send(work.await);
        })
    });
    match spawned {
        Ok(task) => Coming { result, task: Some(task.abort_handle()), failed: None },
        Err(error) => Coming { result, task: None, failed: Some(error) },
    }
}

/// The result of work; an error where `stop` is set before it comes.
pub(crate) fn wait<T>(coming: &Coming<T>, stop: &AtomicBool) -> Result<T, StoreError> {
    if let Some(error) = &coming.failed {
        return Err(error.clone());
    }
    loop {
        match coming.result.recv_timeout(LOOK) {
            Ok(result) => return Ok(result),
            Err(RecvTimeoutError::Timeout) => {
                if stop.load(Ordering::Relaxed) {
                    return Err(StoreError::Stopped);
                }
            }
            Err(RecvTimeoutError::Disconnected) => {
                return Err(StoreError::Setup(
                    "the store's client failed: check AWS_*, AZURE_* and GOOGLE_* for characters that a request cannot carry"
                        .into(),
                ));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_that_nobody_lets_go_is_told() {
        let shared = Mutex::new(5);
        assert_eq!(*lock(&shared).unwrap(), 5);
        let _held = shared.lock().unwrap();
        let told = lock_within(&shared, Duration::from_millis(5)).unwrap_err().to_string();
        assert!(told.contains("forked") && told.contains("spawn"), "{told}");
    }
}
