//! Isolation forests (Liu, Ting and Zhou 2008) with scikit-learn's defaults: 100 trees of 256 points,
//! outliers by the threshold 0.5.

use rand::Rng;

const TREES: usize = 100;
const SAMPLE: usize = 256;
/// Logarithm of the sample size.
const DEPTH: usize = 8;

/// Which points are no outliers, for points with `N` coordinates.
pub fn inliers<const N: usize>(points: &[[f32; N]], rng: &mut impl Rng) -> Vec<bool> {
    if points.len() < 2 {
        return vec![true; points.len()];
    }
    let size = SAMPLE.min(points.len());
    // The depth of a tree is the next whole logarithm of its sample.
    let depth = (size as f64).log2().ceil().min(DEPTH as f64) as usize;
    let mut sum = vec![0.0f32; points.len()];
    for _ in 0..TREES {
        let mut sample: Vec<[f32; N]> =
            rand::seq::index::sample(rng, points.len(), size).iter().map(|i| points[i]).collect();
        let mut tree = Tree { nodes: Vec::new() };
        tree.grow(&mut sample, depth, 0.0, rng);
        for (point, sum) in points.iter().zip(&mut sum) {
            *sum += tree.path(point);
        }
    }
    let expected = TREES as f64 * average_path(size);
    // 2^(-mean path / expected path) below 0.5.
    sum.into_iter().map(|sum| 2f64.powf(-f64::from(sum) / expected) <= 0.5).collect()
}

/// Average length of an unsuccessful search among `n` points.
fn average_path(n: usize) -> f64 {
    match n {
        0 | 1 => 0.0,
        2 => 1.0,
        n => {
            let n = n as f64;
            2.0 * ((n - 1.0).ln() + 0.577_215_664_901_532_9) - 2.0 * (n - 1.0) / n
        }
    }
}

#[derive(Clone, Copy)]
struct Node {
    threshold: f32,
    /// Axis, or the number of axes in a leaf.
    axis: u16,
    /// The right branch; the left one follows the node.
    right: u16,
    /// Length of the path to a leaf.
    path: f32,
}

struct Tree {
    nodes: Vec<Node>,
}

impl Tree {
    fn grow<const N: usize>(
        &mut self,
        points: &mut [[f32; N]],
        depth: usize,
        path: f32,
        rng: &mut impl Rng,
    ) {
        let mut axes = [(0usize, 0.0f32, 0.0f32); N];
        let mut count = 0;
        for axis in 0..N {
            let (low, high) = points
                .iter()
                .fold((f32::MAX, f32::MIN), |(low, high), p| (low.min(p[axis]), high.max(p[axis])));
            if low < high {
                axes[count] = (axis, low, high);
                count += 1;
            }
        }
        let at = self.nodes.len();
        if depth == 0 || count == 0 {
            let path = path + average_path(points.len()) as f32;
            self.nodes.push(Node { threshold: 0.0, axis: N as u16, right: 0, path });
            return;
        }
        let (axis, low, high) = axes[rng.gen_range(0..count)];
        let threshold = rng.gen_range(low..high);
        self.nodes.push(Node { threshold, axis: axis as u16, right: 0, path: 0.0 });
        let mut left = 0;
        for i in 0..points.len() {
            if points[i][axis] <= threshold {
                points.swap(left, i);
                left += 1;
            }
        }
        let (below, above) = points.split_at_mut(left);
        self.grow(below, depth - 1, path + 1.0, rng);
        self.nodes[at].right = self.nodes.len() as u16;
        self.grow(above, depth - 1, path + 1.0, rng);
    }

    fn path<const N: usize>(&self, point: &[f32; N]) -> f32 {
        let mut at = 0;
        loop {
            let node = &self.nodes[at];
            let axis = usize::from(node.axis);
            if axis == N {
                return node.path;
            }
            at = if point[axis] <= node.threshold { at + 1 } else { usize::from(node.right) };
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_xoshiro::Xoshiro256PlusPlus;

    #[test]
    fn far_points_are_outliers() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let mut points: Vec<[f32; 2]> =
            (0..2000).map(|_| [rng.gen_range(-1.0..1.0), rng.gen_range(-1.0..1.0)]).collect();
        points.push([30.0, 30.0]);
        let kept = inliers(&points, &mut rng);
        assert!(!kept[2000]);
        let share = kept.iter().filter(|k| **k).count() as f64 / 2001.0;
        // scikit-learn 1.9.1 keeps 0.52 to 0.61 of a uniform square (seeds 0 to 4).
        assert!((0.35..0.8).contains(&share), "{share}");
    }

    #[test]
    fn one_point_and_equal_points_stay() {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        assert_eq!(inliers(&[[1.0f32; 3]], &mut rng), [true]);
        assert_eq!(inliers(&[[1.0f32; 3]; 5], &mut rng), [true; 5]);
    }
}
