//! Tells whether a recording is still the file that it was when its first byte was read.

use std::io;

use corsmal_files::identity::Stamp;
use corsmal_files::outcome::Status;

use super::failed::Failed;
use crate::inputs::stored::{Pin, identity_of_read, of_address};
use crate::inputs::{Input, InputSource};

/// A file as it was when it was looked at.
pub type Seen = (InputSource, Stamp);

/// A look at a file before it is read, to be compared with one after the last read.
#[derive(Debug, Clone)]
pub struct Watch {
    /// Streams and devices cannot be looked at twice.
    seen: Option<Seen>,
    /// Whether a change could keep the stamp, so that only the content tells.
    fresh: bool,
    /// Objects of stores are not looked at: every answer says of which version it is.
    pin: Pin,
    stored: Option<InputSource>,
}

impl Watch {
    /// Looks at an input that is about to be read.
    pub fn begin(input: &Input) -> Self {
        // What cannot be looked at cannot be opened either, which says more.
        let stamp = input.source.file().and_then(|path| Stamp::of_path(path).ok().flatten());
        let seen = stamp.map(|stamp| (input.source.clone(), stamp));
        let fresh = seen.as_ref().is_some_and(|(_, stamp)| stamp.is_fresh());
        let pin = input.source.pin();
        let stored = pin.is_some().then(|| input.source.clone());
        Self { seen, fresh, pin: pin.unwrap_or_default(), stored }
    }

    /// The file, where every change of it is seen later.
    pub(crate) fn lasting(&self) -> Option<&Seen> {
        self.seen.as_ref().filter(|_| !self.fresh)
    }

    /// Keeps reads of an object to one version.
    pub(crate) fn pin(&self) -> &Pin {
        &self.pin
    }

    /// What the bytes are known by that came from a store; `None` for files, and before any came.
    pub(crate) fn identity(&self) -> Option<String> {
        let (whole, stored) = (identity_of_read(&self.pin)?, self.stored.as_ref()?);
        let whole = match stored.object() {
            Some(object) => of_address(object, whole),
            None => whole,
        };
        Some(match stored {
            InputSource::Member(member) => member.identity_in(&whole),
            _ => whole,
        })
    }

    /// Looks again.
    ///
    /// # Errors
    /// [`Status::Changed`] and what happened to the file.
    pub fn check(&self) -> Result<(), Failed> {
        if let Some(what) = self.pin.changed() {
            return Err(Failed::new(Status::Changed, format!("{what} while it was read")));
        }
        let Some((source, before)) = &self.seen else { return Ok(()) };
        let Some(path) = source.file() else { return Ok(()) };
        let changed =
            |what: String| Err(Failed::new(Status::Changed, format!("{what} while it was read")));
        let now = match Stamp::of_path(path) {
            Ok(Some(now)) => now,
            Ok(None) => return changed("was replaced by something other than a file".into()),
            Err(e) if e.kind() == io::ErrorKind::NotFound => return changed("was removed".into()),
            Err(e) => return changed(format!("became unreadable ({e})")),
        };
        match (before.size, now.size) {
            _ if before == &now => Ok(()),
            _ if before.file != now.file => changed("was replaced by another file".into()),
            (old, new) if new > old => changed(format!("grew from {old} to {new} bytes")),
            (old, new) if new < old => changed(format!("was cut from {old} to {new} bytes")),
            _ => changed("was written to".into()),
        }
    }

    /// Looks again, at the content too where the file is so new that its stamp may not tell:
    /// `identity` is that of [`InputSource::identity`] from before the first read.
    ///
    /// # Errors
    /// As [`Watch::check`].
    pub fn check_content(&self, identity: &str) -> Result<(), Failed> {
        self.check()?;
        match &self.seen {
            Some((source, _)) if self.fresh => match source.identity() {
                now if now.is_empty() || now == identity => Ok(()),
                _ => Err(Failed::new(Status::Changed, "was written to while it was read")),
            },
            _ => Ok(()),
        }
    }

    /// The verdict on what was read: a change explains any failure that it met.
    ///
    /// # Errors
    /// The change, else the failure.
    pub fn settle<T>(&self, read: Result<T, Failed>) -> Result<T, Failed> {
        match read {
            // No fault of the recording.
            Err(failed) if failed.temporary.is_some() => Err(failed),
            read => self.check().and(read),
        }
    }
}
