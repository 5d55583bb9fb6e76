//! The k nearest of rows that are offered one by one.

/// The k smallest (distance, row) so far: a binary heap with the largest on top. Which of several
/// equal distances survive follows from this very layout, so it is spelled out here.
#[derive(Clone, Debug)]
pub(super) struct Nearest(Vec<(f64, usize)>);

impl Nearest {
    /// Room for `k`.
    pub(super) fn new(k: usize) -> Self {
        Self(vec![(f64::INFINITY, usize::MAX); k])
    }

    /// Keeps the row if it is nearer than the farthest one kept.
    pub(super) fn push(&mut self, distance: f64, row: usize) {
        let heap = &mut self.0;
        let distance = bounded(distance);
        if distance >= heap[0].0 {
            return;
        }
        let mut at = 0;
        loop {
            let (left, right) = (2 * at + 1, 2 * at + 2);
            let child = match (heap.get(left), heap.get(right)) {
                (None, _) => break,
                (Some(l), Some(r)) if r.0 > l.0 => right,
                _ => left,
            };
            if heap[child].0 <= distance {
                break;
            }
            heap[at] = heap[child];
            at = child;
        }
        heap[at] = (distance, row);
    }

    /// The k nearest of all these (at least k); `None` where rows at the same distance would have
    /// to be chosen from, which depends on what was pushed before.
    pub(super) fn of(k: usize, mut all: Vec<(f64, usize)>) -> Option<Self> {
        all.iter_mut().for_each(|(d, _)| *d = bounded(*d));
        if all.len() > k {
            let (_, next, _) = all.select_nth_unstable_by(k, |a, b| a.0.total_cmp(&b.0));
            let next = next.0;
            all.truncate(k);
            if all.iter().any(|(d, _)| *d == next) {
                return None;
            }
        }
        Some(Self(all))
    }

    /// These, which are the k nearest already.
    pub(super) fn exactly(mut all: Vec<(f64, usize)>) -> Self {
        all.iter_mut().for_each(|(d, _)| *d = bounded(*d));
        Self(all)
    }

    /// The largest distance kept; infinite until there are k.
    pub(super) fn farthest(&self) -> f64 {
        self.0[0].0
    }

    /// Nearest first, lower rows first among equals.
    pub(super) fn sorted(mut self) -> Vec<(f64, usize)> {
        self.0.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.0
    }
}

/// Overflow gives infinity or NaN: farthest of all. Rounding can take cosine distances a little below zero.
fn bounded(distance: f64) -> f64 {
    if distance < f64::MAX { distance.max(0.0) } else { f64::MAX }
}
