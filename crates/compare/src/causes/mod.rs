//! Likely causes of differences, each derived from the values and shown with its evidence.
//!
//! A cause is a change of the first file's values that makes the second's of them (`scale`,
//! `transform`, `arrangement`, `mel_scale`), or a confinement of the differences to places that one
//! choice affects (`places`, `floor`). Nothing is guessed from names. Where the values show none, recordings
//! that differ (`of_contents`) and keys of the configuration that differ (`of_settings`) are named.

mod arrangement;
mod cause;
mod constant;
mod factor;
mod fit;
mod floor;
mod mel_scale;
mod places;
mod precision;
mod scale;
mod transform;

use ndarray::ArrayD;

pub use cause::{Cause, CauseKind};

use super::pair::{self, Pair};
use super::settings::Settings;

/// Likely causes for two arrays of one shape.
pub(super) fn of_values(pair: &Pair, dtypes: [&str; 2]) -> Vec<Cause> {
    let noise = pair.noise();
    if let Some(cause) = precision::detect(pair, dtypes, noise) {
        return vec![cause];
    }
    if let Some(cause) = constant::detect(pair) {
        return vec![cause];
    }
    if let Some(cause) = arrangement::same_shape(pair, noise) {
        return vec![cause];
    }
    let confined = confinements(pair, noise);
    if !confined.is_empty() && confined.iter().all(|c| c.kind != CauseKind::Channels) {
        return confined;
    }
    let changed = scale::detect(pair, noise).or_else(|| transform::detect(pair, noise));
    let Some((cause, changed)) = changed else {
        return match mel_scale::detect(pair) {
            Some(cause) => vec![cause],
            None if confined.is_empty() => places::detect_larger(pair, noise),
            None => confined,
        };
    };
    // What the change leaves over may have a cause of its own.
    let rest = Pair { a: changed, b: pair.b.clone(), axes: pair.axes };
    let rest = confinements(&rest, 2.0 * noise);
    let after = |c: Cause| Cause { evidence: format!("of what that leaves: {}", c.evidence), ..c };
    std::iter::once(cause).chain(rest.into_iter().map(after)).collect()
}

/// That so many of the recordings in which a feature differs were made of other files.
pub(super) fn of_contents(other: usize, differing: usize) -> Option<Cause> {
    (other > 0).then(|| {
        let evidence = format!(
            "{other} of the {differing} that differ have another content, and the values show no \
             simpler cause"
        );
        Cause::new(CauseKind::Recordings, "recordings of b are not those of a", evidence)
    })
}

/// The keys of the configurations that differ and bear on a feature.
pub(super) fn of_settings(settings: &Settings, feature: &str) -> Option<Cause> {
    let bears = |key: &str| match key.strip_prefix("features.") {
        None => Some(key.to_owned()),
        Some(rest) => rest.strip_prefix(feature)?.starts_with('.').then(|| rest.to_owned()),
    };
    let keys: Vec<String> = settings.differences.iter().filter_map(|s| bears(&s.key)).collect();
    (!keys.is_empty()).then(|| {
        let cause = format!("the configuration: {}", keys.join(", "));
        let evidence = "these keys differ, and the values show no simpler cause";
        Cause::new(CauseKind::Configuration, cause, evidence)
    })
}

fn confinements(pair: &Pair, noise: f64) -> Vec<Cause> {
    match floor::detect(pair, noise) {
        Some(cause) => vec![cause],
        None => places::detect(pair, noise),
    }
}

/// Likely causes for two arrays of different shapes.
pub(super) fn of_shapes(a: ArrayD<f64>, b: ArrayD<f64>) -> Vec<Cause> {
    let noise = pair::noise(&b);
    arrangement::other_shape(a, b, noise).into_iter().collect()
}
