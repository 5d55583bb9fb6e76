//! `corsmal-feat compare` from outside.

mod causes;
mod files;
mod rows;
mod support;
