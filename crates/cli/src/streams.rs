//! Standard output and error, whose other end may be closed or full. The macros of this file stand
//! in for the standard ones in the whole crate: those panic there.

use std::fmt::Arguments;
use std::io::{self, ErrorKind, Write};
use std::process::exit;
use std::sync::atomic::{AtomicBool, Ordering};

use corsmal_files::quote::printable_line;

macro_rules! print {
    ($($text:tt)*) => { $crate::streams::out(format_args!($($text)*)) };
}

macro_rules! println {
    () => { print!("\n") };
    ($($text:tt)*) => { print!("{}\n", format_args!($($text)*)) };
}

macro_rules! eprintln {
    ($($text:tt)*) => { $crate::streams::err(format_args!($($text)*)) };
}

/// Set once whoever reads standard output has seen enough (`| head`).
static UNREAD: AtomicBool = AtomicBool::new(false);

/// Prints to standard output. Where nobody reads it any more, work goes on: its files are still to be written, and
/// its exit code is its own. Output that cannot be written is a failure.
pub fn out(text: Arguments<'_>) {
    if UNREAD.load(Ordering::Relaxed) {
        return;
    }
    let mut stdout = io::stdout().lock();
    match stdout.write_fmt(text).and_then(|()| stdout.flush()) {
        Ok(()) => {}
        Err(error) if error.kind() == ErrorKind::BrokenPipe => {
            UNREAD.store(true, Ordering::Relaxed)
        }
        Err(error) => {
            eprintln!("error: standard output: {error}");
            exit(2)
        }
    }
}

/// Prints a message to standard error, on one line whatever it repeats of an input.
pub fn err(text: Arguments<'_>) {
    err_lines(&printable_line(&text.to_string()));
}

/// Prints lines to standard error as they are. Work goes on where nobody reads them.
pub fn err_lines(text: &str) {
    // One write, so that lines of several threads do not mix.
    let _ = io::stderr().write_all(format!("{text}\n").as_bytes());
}
