//! Black-box tests of what goes into a run and what comes out of it.

// Helpers outside of test functions are not covered by `allow-unwrap-in-tests`.
#![allow(clippy::unwrap_used)]

mod again;
mod archives;
mod faults;
mod in_order;
mod inputs;
mod manifests;
mod outputs;
mod own_feature;
mod pieces;
mod projection;
mod resume;
mod support;
mod together;
mod windows;
