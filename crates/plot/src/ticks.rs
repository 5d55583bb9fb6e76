//! Round axis values and their labels.

/// Round values inside `low..=high`, about `count` of them: steps of 1, 2 or 5 times a power of
/// ten. Empty for an empty or non-finite range.
pub(crate) fn ticks(low: f64, high: f64, count: usize) -> Vec<f64> {
    let span = high - low;
    if !(span.is_finite() && span > 0.0) || count == 0 {
        return Vec::new();
    }
    let rough = span / count as f64;
    let power = 10f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0, 10.0].into_iter().find(|f| f * power >= rough * 0.999);
    let step = factor.unwrap_or(10.0) * power;
    let first = (low / step - 1e-9).ceil();
    let last = (high / step + 1e-9).floor();
    // Adding 0 turns -0 into 0.
    (0..=(last - first).max(-1.0) as usize).map(|i| (first + i as f64) * step + 0.0).collect()
}

/// Most decimals of a label; smaller steps have exponents.
const DECIMALS: f64 = 6.0;

/// Labels of `values` with as few decimals as tell them apart, and a true minus sign.
pub(crate) fn labels(values: &[f64]) -> Vec<String> {
    let step = values.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min);
    let wanted = match step.is_finite() && step > 0.0 {
        true => (-(step * 1.0001).log10().floor()).max(0.0),
        false => 1.0,
    };
    if wanted > DECIMALS {
        let most = values.iter().fold(step, |most, v| most.max(v.abs()));
        let digits = ((most * 1.0001).log10().floor() + wanted) as usize;
        let label =
            |v: &f64| if *v == 0.0 { "0".into() } else { signed(&format!("{v:.digits$e}")) };
        return values.iter().map(label).collect();
    }
    let decimals = wanted as usize;
    values.iter().map(|v| signed(&format!("{v:.decimals$}"))).collect()
}

/// A number as text with a true minus sign.
pub(crate) fn signed(number: &str) -> String {
    number.replace('-', "\u{2212}")
}

/// A frequency in Hz, shortened from 1000 on: `50`, `1k`, `2.5k`.
pub(crate) fn frequency(hz: f64) -> String {
    if hz < 1000.0 { format!("{hz:.0}") } else { format!("{}k", hz / 1000.0) }
}

/// Of labelled places between 0 and `length`, given from the most to the least wanted, those that
/// keep `gap` from each other.
pub(crate) fn apart(wanted: &[(f64, f64)], length: f64, gap: f64) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for &(value, place) in wanted {
        let at = place * length;
        if (0.0..=length).contains(&at) && kept.iter().all(|k| (k.1 * length - at).abs() >= gap) {
            kept.push((value, place));
        }
    }
    kept.sort_by(|a, b| a.1.total_cmp(&b.1));
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_values_that_fill_the_range() {
        assert_eq!(ticks(0.0, 1.25, 6), [0.0, 0.5, 1.0]);
        assert_eq!(ticks(-80.0, 0.0, 4), [-80.0, -60.0, -40.0, -20.0, 0.0]);
        assert_eq!(ticks(0.0, 100.0, 5), [0.0, 20.0, 40.0, 60.0, 80.0, 100.0]);
        assert_eq!(labels(&ticks(0.0, 0.3, 3)), ["0.0", "0.1", "0.2", "0.3"]);
        assert_eq!(labels(&ticks(-40.0, 0.0, 2)), ["\u{2212}40", "\u{2212}20", "0"]);
        assert_eq!(labels(&ticks(0.0, 1e-9, 2)), ["0", "5.0e\u{2212}10", "1.0e\u{2212}9"]);
        assert_eq!(labels(&[2e-8, 4e-8]), ["2e\u{2212}8", "4e\u{2212}8"]);
        assert!(ticks(1.0, 1.0, 5).is_empty() && ticks(0.0, f64::NAN, 5).is_empty());
        assert_eq!([50.0, 1000.0, 2500.0].map(frequency), ["50", "1k", "2.5k"]);
    }

    #[test]
    fn crowded_places_leave_the_less_wanted_out() {
        let wanted = [(1000.0, 0.5), (100.0, 0.1), (10_000.0, 0.9), (900.0, 0.48), (5e4, 1.2)];
        assert_eq!(apart(&wanted, 100.0, 10.0), [(100.0, 0.1), (1000.0, 0.5), (10_000.0, 0.9)]);
    }
}
