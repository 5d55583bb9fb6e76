//! Names of statistics over frames, and of the columns that hold them.

/// Names without numbers; percentiles are `p` and a number of 0 to 100.
pub const NAMES: [&str; 7] = ["mean", "std", "min", "max", "median", "skew", "kurtosis"];

/// Whether a column is called as our summaries are: `mfcc[3].mean`, `ch1/rms.p95`, `af193[7]`.
pub fn is_column(name: &str) -> bool {
    let is_percentile = |(feature, p): (&str, &str)| {
        !feature.is_empty() && p.parse::<f64>().is_ok_and(|p| (0.0..=100.0).contains(&p))
    };
    let is_named = |(feature, stat): (&str, &str)| !feature.is_empty() && NAMES.contains(&stat);
    // Those of `a34f136` have names for places.
    let is_place = |(feature, place): (&str, &str)| {
        let vector = feature.rsplit('/').next().unwrap_or_default();
        !place.is_empty() && place.bytes().all(|b| b.is_ascii_digit()) && !vector.is_empty()
            || vector == "a34f136"
    };
    name.rsplit_once('.').is_some_and(is_named)
        || name.rsplit_once(".p").is_some_and(is_percentile)
        || name.strip_suffix(']').and_then(|name| name.split_once('[')).is_some_and(is_place)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_summaries_are_told_from_labels() {
        for name in [
            "mfcc[0].mean",
            "ch1/rms.p95",
            "rms.std",
            "af193[7]",
            "age.max",
            "x.p2.5",
            "a34f136[mfcc_1]",
            "ch2/a34f136[zcr]",
        ] {
            assert!(is_column(name), "{name}");
        }
        for name in [
            "label.code",
            "speaker.id",
            "fold.1",
            "st.a",
            ".mean",
            "[0]",
            "mean",
            "x.px",
            "x.pinf",
            "a.means",
            "x[0",
            "meta[class]",
            "ch1/[0]",
            "x[]",
            "x.p-5",
            "x.p101",
            "[1]",
            "",
        ] {
            assert!(!is_column(name), "{name}");
        }
    }
}
