//! Small matrices.

/// Three rows of three.
pub type Matrix3 = [[f64; 3]; 3];
/// Three rows of four.
pub type Matrix34 = [[f64; 4]; 3];

pub(crate) fn times(m: &Matrix3, v: [f64; 3]) -> [f64; 3] {
    m.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

fn cofactor(m: &Matrix3, r: usize, c: usize) -> f64 {
    let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
    m[r1][c1] * m[r2][c2] - m[r1][c2] * m[r2][c1]
}

pub(crate) fn determinant(m: &Matrix3) -> f64 {
    (0..3).map(|c| m[0][c] * cofactor(m, 0, c)).sum()
}

/// Inverse by cofactors; `None` for a singular matrix.
pub(crate) fn inverse(m: &Matrix3) -> Option<Matrix3> {
    let determinant = determinant(m);
    let inverse: Matrix3 =
        std::array::from_fn(|r| std::array::from_fn(|c| cofactor(m, c, r) / determinant));
    inverse.iter().flatten().all(|v| v.is_finite()).then_some(inverse)
}

/// The rotation by a vector whose length is the angle (Rodrigues).
pub(crate) fn rotation(v: [f64; 3]) -> Matrix3 {
    let angle = v.iter().map(|x| x * x).sum::<f64>().sqrt();
    let axis = if angle > 0.0 { v.map(|x| x / angle) } else { [0.0, 0.0, 1.0] };
    let (sin, cos) = angle.sin_cos();
    let cross = [[0.0, -axis[2], axis[1]], [axis[2], 0.0, -axis[0]], [-axis[1], axis[0], 0.0]];
    std::array::from_fn(|r| {
        std::array::from_fn(|c| {
            let same = if r == c { cos } else { 0.0 };
            same + (1.0 - cos) * axis[r] * axis[c] + sin * cross[r][c]
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_undoes_and_rotations_turn() {
        let m = [[2.0, 1.0, 0.5], [0.0, 3.0, 1.0], [1.0, 0.0, 4.0]];
        let back = times(&inverse(&m).unwrap(), times(&m, [1.0, -2.0, 3.0]));
        for (a, b) in back.iter().zip([1.0, -2.0, 3.0]) {
            assert!((a - b).abs() < 1e-14);
        }
        assert_eq!(inverse(&[[1.0, 2.0, 3.0], [2.0, 4.0, 6.0], [0.0, 0.0, 1.0]]), None);
        let turned = times(&rotation([0.0, 0.0, std::f64::consts::FRAC_PI_2]), [1.0, 0.0, 0.0]);
        assert!((turned[1] - 1.0).abs() < 1e-15 && turned[0].abs() < 1e-15);
    }
}
