//! Random numbers for initial values, shuffles and dropout.
//!
//! Own numbers, because the backend's seed is global to the process. Every number is a function of
//! a seed, the name of what it is for, and its index: any thread can make any of them, and a
//! training that resumes needs no stored state.

/// A stream of numbers: seed and purpose.
#[derive(Clone, Copy, Debug)]
pub struct Stream(u64);

impl Stream {
    /// The stream of this seed for this purpose (a parameter's name, "shuffle", …).
    pub fn new(seed: u64, purpose: &str) -> Self {
        // FNV-1a, then mixed.
        let hash = purpose
            .bytes()
            .fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
        Self(mix(hash ^ mix(seed)))
    }

    /// The stream of a part of this one (an epoch, a step, a layer).
    pub fn part(self, index: u64) -> Self {
        Self(mix(self.0 ^ mix(index.wrapping_add(1))))
    }

    /// 64 random bits.
    pub fn bits(self, index: u64) -> u64 {
        mix(self.0.wrapping_add(index.wrapping_mul(0x9e37_79b9_7f4a_7c15)))
    }

    /// Uniform in `[0, 1)`, 24 bits.
    pub fn uniform(self, index: u64) -> f32 {
        (self.bits(index) >> 40) as f32 * (1.0 / (1 << 24) as f32)
    }

    /// Uniform integer below `n`; the bias of at most `n / 2^64` does not matter here.
    pub fn below(self, index: u64, n: usize) -> usize {
        ((u128::from(self.bits(index)) * n as u128) >> 64) as usize
    }

    /// `0..n` in random order.
    pub fn permutation(self, n: usize) -> Vec<usize> {
        let mut order: Vec<usize> = (0..n).collect();
        for i in (1..n).rev() {
            order.swap(i, self.below(i as u64, i + 1));
        }
        order
    }
}

/// SplitMix64's finaliser.
fn mix(mut x: u64) -> u64 {
    x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_permutation_has_every_index_once_and_follows_the_seed() {
        let order = Stream::new(7, "shuffle").permutation(1000);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..1000).collect::<Vec<_>>());
        assert_eq!(order, Stream::new(7, "shuffle").permutation(1000));
        assert_ne!(order, Stream::new(8, "shuffle").permutation(1000));
        assert_ne!(order, Stream::new(7, "other").permutation(1000));
    }

    #[test]
    fn uniform_numbers_fill_the_unit_interval_evenly() {
        let stream = Stream::new(0, "weights").part(3);
        let n = 100_000u64;
        let values: Vec<f64> = (0..n).map(|i| f64::from(stream.uniform(i))).collect();
        let mean = values.iter().sum::<f64>() / n as f64;
        let var = values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n as f64;
        assert!((mean - 0.5).abs() < 0.005, "{mean}");
        assert!((var - 1.0 / 12.0).abs() < 0.001, "{var}");
        assert!(values.iter().all(|v| (0.0..1.0).contains(v)));
    }
}
