//! Objects of S3, Google Cloud Storage, Azure and web servers: found by prefix, read by blocks.
//!
//! [`list`] finds objects, [`ObjectReader`] reads one as if it were a file: blocks of [`BLOCK`] bytes,
//! one of them fetched ahead, each tried again as a whole where it fails. A [`Pin`] makes sure that all
//! blocks are of one version of the object. [`upload`] puts a file into a store, whole or not at all.
//!
//! Credentials come from where each store's own tools look for them. They are in no error and no
//! `Debug` output.

mod connect;
mod error;
mod listing;
mod object;
mod profile;
mod reader;
mod runtime;
mod upload;
mod uri;

pub use error::StoreError;
pub use listing::list;
pub use object::{Object, Pin, Version};
pub use reader::{BLOCK, ObjectReader, Purpose};
pub use upload::{Existing, upload};
pub use uri::Uri;
