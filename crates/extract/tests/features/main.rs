//! Features by way of the engine: against array functions, against one another, against the originals.

#![allow(clippy::unwrap_used)]

mod arrays;
mod conformance;
mod neighbours;
mod real_audio;
mod registered;
mod support;
