//! Nested lists as Parquet stores them: beside each value, which lists begin with it.

/// Definition and repetition levels of a column.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Levels {
    /// How deep the lists reach that are there; with a value, as deep as the column goes.
    pub definition: Vec<i16>,
    /// The outermost list that goes on: 0 begins a row.
    pub repetition: Vec<i16>,
}

impl Levels {
    /// Appends the row that is an array of this shape, outermost axis first.
    pub fn push(&mut self, shape: &[usize]) {
        // An axis of length 0 ends the lists there, and one entry stands for the empty list.
        let depth = shape.iter().position(|n| *n == 0).unwrap_or(shape.len());
        let entries: usize = shape[..depth].iter().product();
        self.definition.resize(self.definition.len() + entries, depth as i16);
        self.repetition.extend((0..entries).map(|entry| repetition(&shape[..depth], entry)));
    }

    /// The shape of the one row that they are of, with this many axes; `None` where its lists differ
    /// in length. Axes inside of an empty one are 0.
    pub fn shape(&self, axes: usize) -> Option<Vec<usize>> {
        let depth = usize::try_from(*self.definition.first()?).ok().filter(|d| *d <= axes)?;
        let mut shape = vec![0; axes];
        let mut outer = 1;
        for (axis, length) in shape.iter_mut().enumerate().take(depth) {
            let begun = self.repetition.iter().filter(|r| **r <= axis as i16 + 1).count();
            *length = begun.checked_div(outer)?;
            outer = begun;
        }
        let lists = &shape[..depth];
        let entries: usize = lists.iter().product();
        let whole = [self.definition.len(), self.repetition.len()] == [entries; 2]
            && self.definition.iter().all(|d| *d as usize == depth)
            && self.repetition.iter().enumerate().all(|(i, r)| *r == repetition(lists, i));
        whole.then_some(shape)
    }
}

/// Repetition level of one entry of an array.
fn repetition(shape: &[usize], entry: usize) -> i16 {
    let mut rest = entry;
    for (axis, length) in shape.iter().enumerate().rev() {
        if !rest.is_multiple_of(*length) {
            return axis as i16 + 1;
        }
        rest /= length;
    }
    0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shapes_come_back() {
        for shape in [[2, 3, 4], [1, 1, 1], [8, 13, 1], [1, 5, 2], [2, 3, 0], [2, 0, 0], [0, 0, 0]]
        {
            let mut levels = Levels::default();
            levels.push(&shape);
            assert_eq!(levels.shape(3), Some(shape.to_vec()), "{levels:?}");
        }
    }

    #[test]
    fn levels_are_those_of_the_specification() {
        let mut levels = Levels::default();
        levels.push(&[2, 2]);
        levels.push(&[0, 2]);
        assert_eq!(levels.definition, [2, 2, 2, 2, 0]);
        assert_eq!(levels.repetition, [0, 2, 1, 2, 0]);
    }

    #[test]
    fn lists_of_different_lengths_are_no_array() {
        for repetition in [[0, 2, 1], [0, 1, 2], [0, 0, 0], [0, 3, 1]] {
            let levels = Levels { definition: vec![2; 3], repetition: repetition.into() };
            assert_eq!(levels.shape(2), None, "{repetition:?}");
        }
        let mixed = Levels { definition: vec![2, 1], repetition: vec![0, 1] };
        assert_eq!((mixed.shape(2), Levels::default().shape(2)), (None, None));
    }
}
