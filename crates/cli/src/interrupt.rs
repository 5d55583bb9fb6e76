//! Ctrl-C and termination: the first asks running work to stop, the second ends the process.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::failure::INTERRUPTED;

static STOP: AtomicBool = AtomicBool::new(false);
static INSTALL: Once = Once::new();

/// Set once the user asked to stop.
pub fn flag() -> &'static AtomicBool {
    INSTALL.call_once(|| {
        // Without a handler the default action ends the process, which is safe as well.
        let _ = ctrlc::set_handler(|| {
            if STOP.swap(true, Ordering::SeqCst) {
                std::process::exit(i32::from(INTERRUPTED));
            }
        });
    });
    &STOP
}
