//! Marks on single observations of wall tiles.

/// Marks on some of the observers of a [`crate::refine::samples::visibility::Visibility`], a bit each.
#[derive(Clone, Debug)]
pub struct Marks {
    bits: Vec<u64>,
}

impl Marks {
    /// None of so many observers.
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
