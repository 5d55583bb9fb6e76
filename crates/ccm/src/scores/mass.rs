//! Filling mass from level, capacity and density.

use crate::submission::Submission;

/// Standard gravity as the challenge uses it, m/s^2.
const GRAVITY: f64 = 9.81;

/// Weight in N of the object: empty container and filling, both in g.
pub fn object_weight(container_mass_g: f64, filling_mass_g: f64) -> f64 {
    (container_mass_g + filling_mass_g) / 1000.0 * GRAVITY
}

/// A submission with every task of the filling mass addressed.
pub(super) struct MassInput {
    kind: Vec<f64>,
    level: Vec<f64>,
    capacity: Vec<f64>,
    /// How many of the three tasks the submission itself addressed.
    pub(super) addressed: usize,
}

impl MassInput {
    /// Takes whole columns that are not addressed from the (aligned) baseline.
    pub(super) fn new(submission: &Submission, baseline: &Submission) -> Self {
        let mut addressed = 0;
        let mut column = |own: &crate::submission::Estimates,
                          other: &crate::submission::Estimates| {
            let use_own = own.addressed();
            addressed += usize::from(use_own);
            if use_own { own.values.clone() } else { other.values.clone() }
        };
        Self {
            kind: column(&submission.kind, &baseline.kind),
            level: column(&submission.level, &baseline.level),
            capacity: column(&submission.capacity, &baseline.capacity),
            addressed,
        }
    }

    /// Mass per row in g: level · capacity · `density(row, type)`; -1 where level or capacity is
    /// not estimated. A missing type is passed on as `None`.
    pub(super) fn masses(&self, density: impl Fn(usize, Option<usize>) -> Option<f64>) -> Vec<f64> {
        (0..self.kind.len())
            .map(|row| {
                let (level, capacity) = (self.level[row], self.capacity[row]);
                if level == -1.0 || capacity == -1.0 {
                    return -1.0;
                }
                let percent = match level {
                    1.0 => 50.0,
                    2.0 => 90.0,
                    other => other,
                };
                let kind = (self.kind[row] >= 0.0).then_some(self.kind[row] as usize);
                density(row, kind).map_or(-1.0, |density| percent / 100.0 * capacity * density)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weight_is_in_newton() {
        assert!((object_weight(15.0, 85.0) - 0.981).abs() < 1e-12);
    }
}
