//! Configurations; an accepted one says the same when it is written and read again, and computes a
//! short signal.
#![no_main]

use std::sync::Arc;

use corsmal_extract::config::Config;
use corsmal_extract::engine::Signals;

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |text: &str| {
    let Ok(config) = Config::with_overrides(text, "fuzz", &[]) else { return };
    let again = Config::from_value(config.to_value()).expect("its own value");
    assert_eq!(again.hash(), config.hash());
    let Ok(mut signal) = Signals::new(Arc::new(config)).start(16_000, 2) else { return };
    let noise: Vec<f32> = (0..1600_u32).map(|i| (i * i % 997) as f32 / 997.0 - 0.5).collect();
    if signal.push(&noise).is_ok() {
        let _ = signal.finish();
    }
});
