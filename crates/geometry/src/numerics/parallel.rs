//! A function of every element, on all threads.
//!
//! The threads know the work as `dyn Fn`, so that their code is compiled once and not for every
//! closure. It is for work of microseconds or more an element.

use rayon::prelude::*;
use std::ops::Range;
use std::sync::{Mutex, PoisonError};

/// Elements that can be worked on in any order.
pub trait ParallelMap<I>: Sized {
    /// The results of `work` in the order of the elements.
    fn par_map<T: Send>(self, work: impl Fn(I) -> T + Sync) -> Vec<T>;
}

impl<'a, E: Sync> ParallelMap<&'a E> for &'a [E] {
    fn par_map<T: Send>(self, work: impl Fn(&'a E) -> T + Sync) -> Vec<T> {
        map_indices(self.len(), &|k| work(&self[k]))
    }
}

impl ParallelMap<usize> for Range<usize> {
    fn par_map<T: Send>(self, work: impl Fn(usize) -> T + Sync) -> Vec<T> {
        map_indices(self.len(), &|k| work(self.start + k))
    }
}

/// The results of `work` for the indices below `count`, in their order.
fn map_indices<T: Send>(count: usize, work: &(dyn Fn(usize) -> T + Sync)) -> Vec<T> {
    let results: Vec<Mutex<Option<T>>> = (0..count).map(|_| Mutex::new(None)).collect();
    for_each_index(count, &|k| {
        let result = work(k);
        *results[k].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
    });
    let result = |slot: Mutex<Option<T>>| slot.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.into_iter().filter_map(result).collect()
}

fn for_each_index(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().for_each(work);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_are_in_the_order_of_the_elements() {
        let squares: Vec<usize> = (0..1000).map(|k| k * k).collect();
        assert_eq!((5..1000).par_map(|k| k * k), squares[5..]);
        let roots = squares.par_map(|square| square.isqrt());
        assert_eq!(roots, (0..1000).collect::<Vec<_>>());
        assert!((0..0).par_map(|k| k).is_empty());
    }
}
