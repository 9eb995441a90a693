//! Marks on single observers of wall tiles.

/// A bit for each observer of a [`crate::samples::visibility::Visibility`].
#[derive(Clone, Debug)]
pub struct ObserverMarks {
    bits: Vec<u64>,
}

impl ObserverMarks {
    /// Marks of `observers` observers, none of them set.
    pub fn none(observers: usize) -> Self {
        Self {
            bits: vec![0; observers.div_ceil(64)],
        }
    }

    /// Marks an observer.
    pub fn set(&mut self, observer: usize) {
        self.bits[observer / 64] |= 1 << (observer % 64);
    }

    /// True if the observer is marked.
    pub fn has(&self, observer: usize) -> bool {
        self.bits[observer / 64] >> (observer % 64) & 1 == 1
    }
}
