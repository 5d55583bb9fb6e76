//! Samples a constant distance apart.

use crate::simd::vectorized;

/// Writes `of` every `stride`-th of `data`, from `first` on, into `slots`; stops at the shorter end.
pub(super) fn strided<T: Copy, U>(
    data: &[T],
    first: usize,
    stride: usize,
    slots: &mut [U],
    of: impl Fn(T) -> U,
) {
    let data = data.get(first..).unwrap_or_default();
    match stride {
        1 => slots.iter_mut().zip(data).for_each(|(slot, x)| *slot = of(*x)),
        2 => by::<2, _, _>(data, slots, of),
        4 => by::<4, _, _>(data, slots, of),
        8 => by::<8, _, _>(data, slots, of),
        _ => slots.iter_mut().zip(data.iter().step_by(stride)).for_each(|(slot, x)| *slot = of(*x)),
    }
}

fn by<const STRIDE: usize, T: Copy, U>(data: &[T], slots: &mut [U], of: impl Fn(T) -> U) {
    let (groups, rest) = data.as_chunks::<STRIDE>();
    vectorized(
        #[inline(always)]
        || slots.iter_mut().zip(groups).for_each(|(slot, group)| *slot = of(group[0])),
    );
    if let (Some(slot), Some(x)) = (slots.get_mut(groups.len()), rest.first()) {
        *slot = of(*x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stride_and_end() {
        let data: Vec<usize> = (0..37).collect();
        for stride in 1..12 {
            for first in 0..40 {
                for room in 0..40 {
                    let mut slots = vec![usize::MAX; room];
                    strided(&data, first, stride, &mut slots, |x| x);
                    let mut want: Vec<usize> =
                        data.iter().skip(first).step_by(stride).copied().take(room).collect();
                    want.resize(room, usize::MAX);
                    assert_eq!(slots, want);
                }
            }
        }
    }
}
