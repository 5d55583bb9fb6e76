//! What can be wrong with parameters and arrays.

use thiserror::Error;

/// Result of every fallible function of this crate.
pub type Result<T> = std::result::Result<T, DspError>;

/// A refusal: says which parameter or array, its value, and what is allowed.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum DspError {
    /// A parameter has a value outside its range.
    #[error("{name} must be {allowed}, not {value}")]
    Parameter {
        /// Name of the parameter, in librosa's vocabulary.
        name: &'static str,
        /// The value that was given.
        value: String,
        /// What is allowed.
        allowed: String,
    },
    /// An array has the wrong shape.
    #[error("{name} has shape {actual:?}, expected {expected}")]
    Shape {
        /// Name of the array argument.
        name: &'static str,
        /// What was expected.
        expected: String,
        /// What was given.
        actual: Vec<usize>,
    },
    /// An array holds NaN or infinite values.
    #[error("{name} must be finite: the value at index {index} is not")]
    NonFinite {
        /// Name of the array argument.
        name: &'static str,
        /// Flat index of the first such value.
        index: usize,
    },
    /// The signal is too short for one frame.
    #[error("{name} has {actual} samples; one frame needs at least {needed}")]
    TooShort {
        /// Name of the array argument.
        name: &'static str,
        /// Samples given.
        actual: usize,
        /// Samples needed.
        needed: usize,
    },
}

/// `FromStr` of an enum by the names of its choices.
macro_rules! from_name {
    ($type:ty, $parameter:literal, $($name:literal => $value:expr),+ $(,)?) => {
        impl std::str::FromStr for $type {
            type Err = $crate::error::DspError;

            fn from_str(name: &str) -> $crate::error::Result<Self> {
                match name {
                    $($name => Ok($value),)+
                    _ => {
                        let allowed = format!("one of {}", [$($name),+].join(", "));
                        Err($crate::error::DspError::parameter($parameter, name, allowed))
                    }
                }
            }
        }
    };
}
pub(crate) use from_name;

/// Refuses an array of `shape` for which there is no memory, before it is made: a failed allocation
/// would end the process.
///
/// # Errors
/// More elements than can be addressed, or than the allocator has room for.
pub fn room_for<T>(name: &'static str, shape: &[usize]) -> Result<()> {
    let count = shape.iter().try_fold(1_usize, |n, size| n.checked_mul(*size));
    let fits = count.is_some_and(|n| {
        // What is small is not worth asking for twice.
        n.saturating_mul(size_of::<T>()) < 1 << 20 || Vec::<T>::new().try_reserve_exact(n).is_ok()
    });
    if fits {
        return Ok(());
    }
    let expected = "a shape that fits in memory".into();
    Err(DspError::Shape { name, expected, actual: shape.to_vec() })
}

/// Longest text of a number; longer ones are shown with an exponent.
const LONGEST: usize = 24;

impl DspError {
    /// Shorthand for [`DspError::Parameter`].
    pub fn parameter(
        name: &'static str,
        value: impl std::fmt::Display,
        allowed: impl Into<String>,
    ) -> Self {
        let text = value.to_string();
        // 1e300 would be shown with all of its digits.
        let value = match text.parse::<f64>() {
            Ok(number) if text.len() > LONGEST => format!("{number:e}"),
            _ => text,
        };
        Self::Parameter { name, value, allowed: allowed.into() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, shown) in
            [(1e300, "1e300"), (-2.5e-7, "-0.00000025"), (-1e-300, "-1e-300"), (0.1, "0.1")]
        {
            let error = DspError::parameter("sr", value, "above 0 Hz").to_string();
            assert!(error.contains(&format!(" {shown}")) && error.len() < 60, "{error}");
        }
    }
}
