//! ObserverMarks on single observations of wall tiles.

/// ObserverMarks on some of the observers of a [`crate::refine::samples::visibility::Visibility`], a bit each.
#[derive(Clone, Debug)]
pub struct ObserverMarks {
    bits: Vec<u64>,
}

impl ObserverMarks {
    /// None of so many observers.
    pub fn none(observers: usize) -> Self {
        Self {
            bits: vec![0; observers.div_ceil(64)],
        }
    }

    /// ObserverMarks an observer.
    pub fn set(&mut self, observer: usize) {
        self.bits[observer / 64] |= 1 << (observer % 64);
    }

    /// True if the observer is marked.
    pub fn has(&self, observer: usize) -> bool {
        self.bits[observer / 64] >> (observer % 64) & 1 == 1
    }
}
