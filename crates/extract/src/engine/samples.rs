//! Samples as they are read: how many at a time, and which of them are valid.

use corsmal_files::outcome::Status;

use super::failed::Failed;

/// Samples read at a time, all channels together.
pub(super) const BLOCK: usize = 1 << 16;
/// Largest sample that features are computed of: the power of the longest window of such samples
/// still has a place in single precision.
pub const LARGEST_SAMPLE: f32 = 1e12;

/// Refuses samples that features cannot be computed of; `position` is that of the first frame, and
/// `byte_of` knows where in the file a frame begins.
pub fn check_samples(
    samples: &[f32],
    position: u64,
    channels: usize,
    byte_of: impl Fn(u64) -> Option<u64>,
) -> Result<(), Failed> {
    // False for NaN.
    let is_usable = |x: &f32| x.abs() <= LARGEST_SAMPLE;
    if samples.iter().fold(true, |all, x| all & is_usable(x)) {
        return Ok(());
    }
    let at = samples.iter().position(|x| !is_usable(x)).unwrap_or(0);
    let (frame, channel) = (position + (at / channels) as u64, at % channels);
    let is_finite = samples[at].is_finite();
    let bad = samples.iter().filter(|x| !is_usable(x) && x.is_finite() == is_finite).count();
    let (status, what, why) = match is_finite {
        true => {
            (Status::Unsupported, "beyond ±1e12", ": their powers overflow; scale the recording")
        }
        false => (Status::NonFinite, "NaN or infinite", ""),
    };
    let reason = format!(
        "{what} from frame {frame} on (channel {channel}; {} of this block){why}",
        if bad == 1 { "1 sample".into() } else { format!("{bad} samples") }
    );
    Err(Failed { byte_offset: byte_of(frame), ..Failed::new(status, reason) })
}
