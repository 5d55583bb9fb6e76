//! Why a command could not run at all (exit code 2).

use std::fmt;

use corsmal_files::quote::printable;

/// Exit code of a run that finished but had failed files.
pub const FAILED_FILES: u8 = 1;
/// Exit code of a command that could not run or go on.
pub const COULD_NOT_RUN: u8 = 2;
/// Exit code of a run that the user stopped.
pub const INTERRUPTED: u8 = 130;

/// One message for the user: path or key, the value, and what is allowed.
#[derive(Debug)]
pub struct Failure {
    message: String,
    code: u8,
}

impl Failure {
    /// A failure with its message.
    pub fn new(message: impl Into<String>) -> Self {
        Self { message: message.into(), code: COULD_NOT_RUN }
    }

    /// The same for work that the user stopped.
    pub fn interrupted(message: impl Into<String>) -> Self {
        Self { message: message.into(), code: INTERRUPTED }
    }

    /// The exit code.
    pub fn code(&self) -> u8 {
        self.code
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&without_numbers(&printable(&self.message)))
    }
}

/// Leaves out the numbers of the system's errors, ` (os error 2)`: their words say the same.
fn without_numbers(message: &str) -> String {
    let mut parts = message.split(" (os error ");
    let mut text = parts.next().unwrap_or_default().to_string();
    for part in parts {
        match part.split_once(')') {
            Some((number, rest)) if number.parse::<u32>().is_ok() => text.push_str(rest),
            _ => text.extend([" (os error ", part]),
        }
    }
    text
}

impl<E: std::error::Error> From<E> for Failure {
    fn from(error: E) -> Self {
        // Causes that the message does not already show.
        let mut message = error.to_string();
        let mut cause = error.source();
        while let Some(c) = cause {
            let text = c.to_string();
            if !message.contains(&text) {
                message.push_str(": ");
                message.push_str(&text);
            }
            cause = c.source();
        }
        Self::new(message)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_systems_errors_are_words() {
        for (message, shown) in [
            ("a: No such file or directory (os error 2)", "a: No such file or directory"),
            ("a: gone (os error 2); b: full (os error 28)", "a: gone; b: full"),
            ("label (os error x) (os error 3", "label (os error x) (os error 3"),
            ("plain", "plain"),
        ] {
            assert_eq!(Failure::new(message).to_string(), shown);
        }
    }
}
