//! AAC, by itself in ADTS or in MP4; decoded by symphonia.

mod adts;
mod bits;
mod config;
mod sbr;

pub(crate) use adts::{WINDOW, find, open};
pub(crate) use config::{Config, FRAME};
pub(crate) use sbr::{LOOKED_AT, refuse as refuse_replication};
