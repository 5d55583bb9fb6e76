//! Ctrl-C and termination: the first asks running work to stop, the second ends the process.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use crate::failure::INTERRUPTED;

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(|| {
    let stop = Arc::new(AtomicBool::new(false));
    let flag = stop.clone();
    // Without a handler the default action ends the process, which is safe as well.
    let _ = ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::SeqCst) {
            std::process::exit(i32::from(INTERRUPTED));
        }
    });
    stop
});

/// Set once the user asked to stop.
pub fn flag() -> &'static Arc<AtomicBool> {
    &STOP
}
