//! Black-box tests of what goes into a run and what comes out of it.

mod inputs;
mod outputs;
mod resume;
mod support;
