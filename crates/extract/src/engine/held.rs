//! Recordings that are held whole take no more memory than is free.

use corsmal_files::memory;
use corsmal_files::outcome::Status;

use super::failed::Failed;
use super::plan::Plan;
use crate::config::Normalize;

/// Bytes of samples held after which the memory is looked at again (64 MiB).
const STEP: u64 = 1 << 26;
/// Bytes of a sample in a list that has doubled last.
const SAMPLE: u64 = 8;
const GIB: f64 = (1_u64 << 30) as f64;

/// Counts the samples of a recording that is held whole.
pub struct Held {
    /// What holds it.
    by: String,
    channels: u64,
    /// Bytes that a frame takes in the end.
    frame: u64,
    frames: u64,
    /// Frames at which to look again.
    next: u64,
}

impl Held {
    /// For recordings of this plan; `None` where none is held.
    pub fn of(plan: &Plan) -> Option<Self> {
        let name = |index: usize| plan.features[index].name.as_str();
        let mut by: Vec<&str> = plan.whole.iter().map(|whole| name(whole.feature)).collect();
        let work = plan.whole.iter().map(|whole| whole.kernel.bytes_per_sample()).max();
        let levelled = plan.config.signal.normalize != Normalize::None;
        if levelled {
            by.push("signal.normalize");
        }
        if by.is_empty() {
            return None;
        }
        let channels = plan.channels as u64;
        // Channels are computed side by side.
        let at_once = channels.min(rayon::current_num_threads() as u64);
        let copies = u64::from(levelled) + u64::from(work.is_some());
        let frame = copies * channels * SAMPLE + at_once * work.unwrap_or(0);
        Some(Self { by: by.join(", "), channels, frame, frames: 0, next: STEP / (4 * channels) })
    }

    /// So many frames of the signal are held.
    ///
    /// # Errors
    /// They take more memory than is free.
    pub fn reach(&mut self, frames: u64) -> Result<(), Failed> {
        self.frames = self.frames.max(frames);
        if self.frames < self.next {
            return Ok(());
        }
        self.next = self.frames + STEP / (4 * self.channels);
        self.require(memory::available())
    }

    fn require(&self, available: Option<u64>) -> Result<(), Failed> {
        let Some(available) = available else { return Ok(()) };
        // The samples themselves are not free any more.
        let free = available.saturating_add(self.frames * self.channels * 4);
        let needed = self.frames.saturating_mul(self.frame);
        if needed <= free {
            return Ok(());
        }
        let reason = format!(
            "{} of a recording as long as this one takes more than {:.1} GiB of memory, and {:.1} \
             are free: --window SECONDS computes it in windows, --jobs 1 one recording at a time",
            self.by,
            needed as f64 / GIB,
            free as f64 / GIB,
        );
        Err(Failed::new(Status::Unsupported, reason))
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::config::Config;

    fn held(toml: &str) -> Option<Held> {
        let config = Arc::new(Config::with_overrides(toml, "test", &[]).unwrap());
        Held::of(&Plan::new(&config, 22_050.0, 2).unwrap())
    }

    #[test]
    fn ten_hours_are_refused_where_they_do_not_fit() {
        let mut whole = held("[features.af193]").unwrap();
        whole.frames = 36_000 * 22_050;
        assert!(whole.require(None).is_ok() && whole.require(Some(1 << 40)).is_ok());
        let failed = whole.require(Some(1 << 30)).unwrap_err();
        let reason = failed.reason.as_str();
        assert!(reason.contains("af193") && reason.contains("--window"), "{reason}");
        assert_eq!(failed.status, Status::Unsupported);
        // An hour takes a tenth of it.
        whole.frames /= 10;
        assert!(whole.require(Some(8 << 30)).is_ok());
    }

    #[test]
    fn only_what_is_held_is_counted() {
        assert!(held("[features.mfcc]").is_none());
        let level = held("[signal]\nnormalize = \"peak\"\n[features.mfcc]").unwrap();
        assert_eq!((level.by.as_str(), level.frame), ("signal.normalize", 16));
    }
}
