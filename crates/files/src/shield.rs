//! Panics of other people's code.

use std::cell::Cell;
use std::panic::{self, AssertUnwindSafe, catch_unwind};
use std::sync::Once;

thread_local! {
    static SHIELDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs code that may panic. A panic on this thread ends here and is not printed.
///
/// # Errors
/// What the panic says.
pub fn shielded<T>(run: impl FnOnce() -> T) -> Result<T, String> {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let others = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if !SHIELDED.get() {
                others(info);
            }
        }));
    });
    let before = SHIELDED.replace(true);
    let done = catch_unwind(AssertUnwindSafe(run));
    SHIELDED.set(before);
    done.map_err(|panic| match (panic.downcast_ref::<String>(), panic.downcast_ref::<&str>()) {
        (Some(text), _) => text.clone(),
        (_, Some(text)) => (*text).into(),
        _ => "it panicked".into(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_becomes_its_text() {
        assert_eq!(shielded(|| 3), Ok(3));
        assert_eq!(shielded(|| -> u8 { panic!("page {}", 7) }), Err("page 7".into()));
        assert_eq!(shielded(|| -> u8 { panic!("lost") }), Err("lost".into()));
    }
}
