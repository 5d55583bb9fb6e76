//! Names that users type: which known name a mistyped one probably means.
//!
//! Every refusal of an unknown preset, feature, key, classifier, column or label ends with
//! [`choices`], so that all of them read alike:
//!
//! ```
//! let known = ["logmel", "mfcc-zcr", "esc26"];
//! let message = format!("preset \"mfcc_zcr\" is unknown: {}", corsmal_names::choices("mfcc_zcr", known));
//! assert_eq!(
//!     message,
//!     "preset \"mfcc_zcr\" is unknown: did you mean \"mfcc-zcr\"? Known are logmel, mfcc-zcr, esc26"
//! );
//! ```

/// Most names that a message lists.
const LISTED: usize = 40;

/// The known name that is most like `given`, if one is like it: equal apart from case, `-`, `_` and
/// spaces; a few letters off (one in three at most); or the only one that begins or ends with it.
pub fn closest<'k>(given: &str, known: impl IntoIterator<Item = &'k str>) -> Option<&'k str> {
    let plain = |name: &str| -> String {
        let letters = name.chars().filter(|c| !matches!(c, '-' | '_' | ' '));
        letters.flat_map(char::to_lowercase).collect()
    };
    let wanted = plain(given);
    let length = wanted.chars().count();
    if length == 0 {
        return None;
    }
    let known: Vec<(&str, String)> = known.into_iter().map(|name| (name, plain(name))).collect();
    let distance = |name: &str| strsim::damerau_levenshtein(&wanted, name);
    let best = known.iter().map(|(name, plain)| (distance(plain), *name)).min_by_key(|(d, _)| *d);
    // Two letters have nothing in common with two others.
    let allowed = |name: &str| length.max(plain(name).chars().count()) / 3;
    if let Some((distance, name)) = best
        && distance <= allowed(name)
    {
        return Some(name);
    }
    let mut around = known
        .iter()
        .filter(|(_, name)| length > 1 && (name.starts_with(&wanted) || name.ends_with(&wanted)));
    match (around.next(), around.next()) {
        (Some((name, _)), None) => Some(name),
        _ => None,
    }
}

/// Whether other programs call the column so that names recordings.
pub fn names_files(column: &str) -> bool {
    const NAMES: [&str; 9] =
        ["file", "filename", "file_name", "fname", "name", "clip", "wav", "audio", "recording"];
    NAMES.contains(&&*column.to_lowercase())
}

/// What a message about an unknown name ends with: the probable one, and those that there are (the
/// first forty of them).
pub fn choices<'k>(given: &str, known: impl IntoIterator<Item = &'k str>) -> String {
    let known: Vec<&str> = known.into_iter().collect();
    if known.is_empty() {
        return "there are none".into();
    }
    let listed = known.iter().take(LISTED).copied().collect::<Vec<_>>().join(", ");
    let more = match known.len().saturating_sub(LISTED) {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    match closest(given, known.iter().copied()) {
        Some(name) => format!("did you mean \"{name}\"? Known are {listed}{more}"),
        None => format!("known are {listed}{more}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_slips_find_their_name() {
        let presets = ["logmel", "mfcc-zcr", "esc26", "esc28", "af193", "spec9216-code"];
        for (given, meant) in [
            ("mfcc_zcr", Some("mfcc-zcr")),
            ("MFCC-ZCR", Some("mfcc-zcr")),
            ("logmell", Some("logmel")),
            ("lgomel", Some("logmel")),
            ("esc-26", Some("esc26")),
            ("spec9216", Some("spec9216-code")),
            ("foo", None),
            ("", None),
            ("-", None),
            ("x", None),
        ] {
            assert_eq!(closest(given, presets), meant, "{given}");
        }
        let keys = ["n_mfcc", "n_fft", "hop_length", "n_mels", "sample_rate"];
        assert_eq!(closest("n_mel", keys), Some("n_mels"));
        assert_eq!(closest("hop", keys), Some("hop_length"));
        assert_eq!(closest("rate", keys), Some("sample_rate"));
        assert_eq!(closest("n_", keys), None, "several begin so");
    }

    #[test]
    fn a_message_lists_what_there_is() {
        assert_eq!(choices("a", []), "there are none");
        assert_eq!(choices("zzz", ["knn", "svm"]), "known are knn, svm");
        let many: Vec<String> = (0..50).map(|i| format!("column{i}")).collect();
        let message = choices("colum7", many.iter().map(String::as_str));
        assert!(message.starts_with("did you mean \"column7\"? Known are column0, "), "{message}");
        assert!(message.ends_with("column39 and 10 more"), "{message}");
    }
}
