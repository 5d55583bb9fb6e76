//! Lists that grow with every recording of a run.

/// Makes room for `more` items: an eighth more than are there, where a list would double. The largest
/// runs then take little more than they hold.
pub(crate) fn make_room<T>(list: &mut Vec<T>, more: usize) {
    if list.capacity() - list.len() < more {
        list.reserve_exact(more.max(list.len() / 8).max(16));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn room_is_an_eighth_more() {
        let mut list = Vec::new();
        for i in 0..10_000 {
            make_room(&mut list, 1);
            list.push(i);
            assert!(list.capacity() <= list.len() + list.len() / 8 + 16);
        }
        make_room(&mut list, 5000);
        assert!(list.capacity() - list.len() >= 5000);
    }
}
