//! Parts of a run.

use std::fmt;
use std::str::FromStr;

use thiserror::Error;

/// A shard that cannot be.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[error("shard must be i/n with 0 <= i < n, such as 0/4 or 3/4, not {value:?}")]
pub struct ShardError {
    /// The text given.
    pub value: String,
}

/// Part `index` of `count` contiguous parts of an input list. The parts of a list, one after the
/// other, are the list, so merged shards hold what a whole run holds, in the same order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// From 0.
    pub index: usize,
    /// At least 1.
    pub count: usize,
}

impl Default for Shard {
    /// The whole list.
    fn default() -> Self {
        Self { index: 0, count: 1 }
    }
}

impl Shard {
    /// This part of `list`; parts differ in length by at most one.
    pub fn of<T>(self, list: &[T]) -> &[T] {
        // In 128 bits, so that no product overflows.
        let cut = |index: usize| (list.len() as u128 * index as u128 / self.count as u128) as usize;
        &list[cut(self.index)..cut(self.index + 1)]
    }
}

impl FromStr for Shard {
    type Err = ShardError;

    /// Reads `i/n`, counted from 0.
    fn from_str(text: &str) -> Result<Self, ShardError> {
        let parts =
            text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if index < count => Ok(Self { index, count }),
            _ => Err(ShardError { value: text.into() }),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}
