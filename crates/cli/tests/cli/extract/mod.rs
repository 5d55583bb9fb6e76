//! `corsmal-feat extract` from outside.

mod bad_recordings;
mod crashes;
mod frames;
mod full_disk;
mod long;
mod outputs;
mod partitions;
mod projection;
mod refusals;
#[cfg(unix)]
mod slurm;
mod streams;
pub(crate) mod support;
mod tables;
mod tars;
