//! Two feature files, one behind the other: a length of four bytes, the first, the second.
#![no_main]

use corsmal_compare::{Criteria, compare};

libfuzzer_sys::fuzz_target!(init: corsmal_fuzz::ours_only(), |bytes: &[u8]| {
    let Some((length, files)) = bytes.split_first_chunk() else { return };
    let middle = (u32::from_le_bytes(*length) as usize).min(files.len());
    let (first, second) = files.split_at(middle);
    let (a, b) = (corsmal_fuzz::file("a", first), corsmal_fuzz::file("b", second));
    let _ = compare(&a, &b, &Criteria::default());
    let _ = compare(&a, &a, &Criteria::default());
});
