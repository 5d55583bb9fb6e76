//! The smallest and the largest values of a few.

use std::cmp::Ordering;

use crate::real::Real;

/// Values that are compared at a time.
pub(super) const AT_ONCE: usize = 16;

/// Candidates whose ranks are counted, each against all; more are partitioned.
const RANKED: usize = 4 * AT_ONCE;

/// Means of the `count` smallest and the `count` largest values; NaN where there are none, or one is. `scratch`
/// holds as many values, rounded up to whole blocks of [`AT_ONCE`].
#[inline(always)]
pub(super) fn extremes<T: Real>(values: &[T], count: usize, scratch: &mut [T]) -> (f64, f64) {
    // The first and the last of every column.
    let (mut low, mut high) = ([T::infinity(); AT_ONCE], [T::neg_infinity(); AT_ONCE]);
    let mut nans = [false; AT_ONCE];
    let (blocks, rest) = values.as_chunks::<AT_ONCE>();
    let smaller = |a: T, b: T| if b < a { b } else { a };
    let larger = |a: T, b: T| if b > a { b } else { a };
    for block in blocks {
        for i in 0..AT_ONCE {
            low[i] = smaller(low[i], block[i]);
        }
        for i in 0..AT_ONCE {
            high[i] = larger(high[i], block[i]);
        }
        for i in 0..AT_ONCE {
            nans[i] |= block[i].is_nan();
        }
    }
    for (i, x) in rest.iter().enumerate() {
        (low[i], high[i]) = (smaller(low[i], *x), larger(high[i], *x));
        nans[i] |= x.is_nan();
    }
    // Contrast with a NaN is NaN, however the others are ordered.
    if values.is_empty() || nans.contains(&true) {
        return (f64::NAN, f64::NAN);
    }
    if count == 1 {
        let (low, high) = (low.into_iter().reduce(smaller), high.into_iter().reduce(larger));
        return (low.map_or(f64::NAN, T::wide), high.map_or(f64::NAN, T::wide));
    }
    (
        mean_of_first(values, count, scratch, low, |a, b| a < b),
        mean_of_first(values, count, scratch, high, |a, b| a > b),
    )
}

/// Mean of the first `count` values in the order of `before`; `columns[i]` is the first of every 16th value from
/// the `i`-th on.
#[inline(always)]
fn mean_of_first<T: Real>(
    values: &[T],
    count: usize,
    scratch: &mut [T],
    columns: [T; AT_ONCE],
    before: impl Fn(T, T) -> bool,
) -> f64 {
    // Nothing follows it.
    let last = if before(T::zero(), T::infinity()) { T::infinity() } else { T::neg_infinity() };
    let mut found = 0;
    if count <= AT_ONCE {
        // At least `count` values do not follow the `count`-th of these.
        let bound = ranked(&[columns], count, last, &before);
        let mut keep = |x: T| {
            scratch[found] = x;
            found += usize::from(!before(bound, x));
        };
        let (blocks, rest) = values.as_chunks::<AT_ONCE>();
        for block in blocks {
            // Most blocks hold nothing that may be among the first.
            if !block.iter().fold(true, |none, x| none & before(bound, *x)) {
                block.iter().for_each(|x| keep(*x));
            }
        }
        rest.iter().for_each(|x| keep(*x));
    } else {
        found = values.len();
        scratch[..found].copy_from_slice(values);
    }
    let nth = if found <= RANKED {
        scratch[found..found.next_multiple_of(AT_ONCE)].fill(last);
        let blocks = scratch[..found.next_multiple_of(AT_ONCE)].as_chunks().0;
        ranked(blocks, count, last, &before)
    } else {
        let order = |a: &T, b: &T| match (before(*a, *b), before(*b, *a)) {
            (true, _) => Ordering::Less,
            (_, true) => Ordering::Greater,
            _ => Ordering::Equal,
        };
        *scratch[..found].select_nth_unstable_by(count - 1, order).1
    };
    let (mut sum, mut summed) = (0.0, 0);
    for x in &scratch[..found] {
        let counts = before(*x, nth);
        sum += if counts { x.wide() } else { 0.0 };
        summed += usize::from(counts);
    }
    (sum + (count - summed) as f64 * nth.wide()) / count as f64
}

/// The `count`-th value in the order of `before`; `last` where there are fewer.
#[inline(always)]
fn ranked<T: Real>(
    blocks: &[[T; AT_ONCE]],
    count: usize,
    last: T,
    before: &impl Fn(T, T) -> bool,
) -> T {
    let mut found = last;
    for block in blocks {
        let mut ranks = [0_u32; AT_ONCE];
        for other in blocks.as_flattened() {
            for (rank, x) in ranks.iter_mut().zip(block) {
                *rank += u32::from(!before(*x, *other));
            }
        }
        for (rank, x) in ranks.iter().zip(block) {
            if *rank as usize >= count && before(*x, found) {
                found = *x;
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn extremes_are_those_of_the_sorted_band(
            values in prop::collection::vec(0.0_f64..1.0, 1..300),
            steps in prop::sample::select(vec![2.0, 20.0, 1e9]),
            share in 0.0..1.0_f64,
        ) {
            // Coarse steps make ties.
            let values: Vec<f64> = values.iter().map(|x| (x * steps).round() / steps).collect();
            let count = ((share * values.len() as f64) as usize).max(1);
            let mut sorted = values.clone();
            sorted.sort_by(f64::total_cmp);
            let mean = |x: &[f64]| x.iter().sum::<f64>() / count as f64;
            let mut scratch = vec![0.0; values.len().next_multiple_of(AT_ONCE)];
            let (low, high) = extremes(&values, count, &mut scratch);
            prop_assert!((low - mean(&sorted[..count])).abs() < 1e-12);
            prop_assert!((high - mean(&sorted[values.len() - count..])).abs() < 1e-12);
        }
    }

    #[test]
    fn one_nan_makes_both_ends_nan() {
        for n in [5_usize, 40, 900] {
            let mut values: Vec<f32> = (0..n).map(|i| i as f32).collect();
            values[n / 2] = f32::NAN;
            let mut scratch = vec![0.0; n.next_multiple_of(AT_ONCE)];
            for count in [1, 3, n / 3 + 1] {
                let (low, high) = extremes(&values, count, &mut scratch);
                assert!(low.is_nan() && high.is_nan());
            }
        }
    }
}
