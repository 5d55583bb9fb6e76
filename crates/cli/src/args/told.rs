//! What a command that writes files says of them at its end.

use serde_json::Value;

use crate::failure::Failure;

/// `--json` and `--quiet`.
#[derive(clap::Args, Clone, Copy)]
pub struct Told {
    /// Print what was written as JSON.
    #[arg(long)]
    pub json: bool,
    /// Print only warnings and errors.
    #[arg(long, short)]
    pub quiet: bool,
}

impl Told {
    /// Prints JSON, or a text, or nothing.
    pub fn tell(
        self,
        json: impl FnOnce() -> Value,
        text: impl FnOnce() -> String,
    ) -> Result<(), Failure> {
        if self.json {
            println!("{}", serde_json::to_string_pretty(&json())?);
        } else if !self.quiet {
            println!("{}", text());
        }
        Ok(())
    }
}
