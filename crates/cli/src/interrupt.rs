//! Ctrl-C and termination: the first asks running work to stop, the second ends the process.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

use crate::failure::INTERRUPTED;

static STOP: LazyLock<Arc<AtomicBool>> = LazyLock::new(|| {
    let stop = Arc::new(AtomicBool::new(false));
    listen(stop.clone());
    stop
});

/// Set once the user asked to stop.
pub fn flag() -> &'static Arc<AtomicBool> {
    &STOP
}

/// Hears SIGINT, SIGTERM and, unless `nohup` had it ignored, SIGHUP.
// Without a handler the default action ends the process, which is safe as well.
#[cfg(unix)]
fn listen(stop: Arc<AtomicBool>) {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::iterator::Signals;

    let hangup = (!is_ignored(SIGHUP)).then_some(SIGHUP);
    let Ok(mut signals) = Signals::new([SIGINT, SIGTERM].into_iter().chain(hangup)) else { return };
    let hear = move || signals.forever().for_each(|_| asked(&stop));
    let _ = std::thread::Builder::new().name("signals".into()).spawn(hear);
}

#[cfg(not(unix))]
fn listen(stop: Arc<AtomicBool>) {
    let _ = ctrlc::set_handler(move || asked(&stop));
}

/// The user asked to stop.
fn asked(stop: &AtomicBool) {
    if stop.swap(true, Ordering::SeqCst) {
        std::process::exit(i32::from(INTERRUPTED));
    }
}

/// Whether the process was started with this signal ignored; `false` where the system does not say.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}
