//! Scores of estimated amounts: capacity, masses, dimensions and the simulator's measurements.

/// Distance in mm from which a delivery scores nothing.
const FARTHEST_DELIVERY_MM: f64 = 500.0;

/// Mean over rows of `f(truth, estimate)`; rows with estimate <= -1 count 0.
fn mean_score(truth: &[f64], estimate: &[f64], f: impl Fn(f64, f64) -> f64) -> f64 {
    let rows = truth.iter().zip(estimate).filter(|(_, e)| **e > -1.0);
    rows.map(|(&t, &e)| f(t, e)).sum::<f64>() / truth.len() as f64
}

/// Capacity and container mass: mean of `exp(-|e - t| / t)`.
pub(super) fn amount(truth: &[f64], estimate: &[f64]) -> f64 {
    mean_score(truth, estimate, |t, e| (-(e - t).abs() / t).exp())
}

/// Dimensions: mean of `1 - |e - t| / t`, 0 where the error reaches the true size.
pub(super) fn dimension(truth: &[f64], estimate: &[f64]) -> f64 {
    mean_score(truth, estimate, |t, e| {
        let error = (e - t).abs();
        if t == 0.0 && e == 0.0 {
            1.0
        } else if error < t {
            1.0 - error / t
        } else {
            0.0
        }
    })
}

/// Filling mass: mean of `exp(-error)`, the error being relative where there is something and the
/// estimate itself, in grams, where there is nothing.
pub(super) fn filling_mass(truth: &[f64], estimate: &[f64]) -> f64 {
    mean_score(truth, estimate, |t, e| {
        let error = if t == 0.0 { e } else { (e - t).abs() / t };
        (-error).exp()
    })
}

/// Object safety: mean of the simulator's values.
pub(super) fn safety(estimate: &[f64]) -> f64 {
    estimate.iter().filter(|&&e| e > -1.0).sum::<f64>() / estimate.len() as f64
}

/// Delivery: *sum* (not mean, a defect of the official evaluators) of `1 - distance / 500 mm`
/// where the distance is below 500 mm and the angle below pi/4. The angle's column is documented
/// in degrees but compared as it stands.
pub(super) fn delivery(distance: &[f64], angle: &[f64]) -> f64 {
    distance
        .iter()
        .zip(angle)
        .filter(|&(&d, &a)| d > -1.0 && d < FARTHEST_DELIVERY_MM && a < std::f64::consts::FRAC_PI_4)
        .map(|(d, _)| 1.0 - d / FARTHEST_DELIVERY_MM)
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() < 1e-12, "{a} {b}");
    }

    #[test]
    fn perfect_missing_and_wrong_rows() {
        close(amount(&[100.0, 100.0], &[100.0, -1.0]), 0.5);
        close(amount(&[100.0], &[150.0]), (-0.5f64).exp());
        close(dimension(&[100.0, 100.0, 100.0], &[100.0, 50.0, 200.0]), 0.5);
        close(filling_mass(&[0.0, 0.0, 50.0], &[0.0, 2.0, 50.0]), (2.0 + (-2.0f64).exp()) / 3.0);
        close(safety(&[1.0, 0.5, -1.0]), 0.5);
    }

    #[test]
    fn delivery_is_a_sum() {
        let distance = [0.0, 250.0, 600.0, 0.0, -1.0];
        let angle = [0.0, 0.5, 0.0, 1.0, -1.0];
        close(delivery(&distance, &angle), 1.5);
    }
}
