//! News of long work, for whoever wants to show it.

/// Receives the progress of long work. The library calls it from any thread; the program draws
/// bars.
pub trait Progress: Send + Sync {
    /// A stage of `total` equal parts begins; it replaces the one before.
    fn start(&self, stage: &str, total: usize);
    /// `parts` more parts of the stage are done.
    fn advance(&self, parts: usize);
    /// A few words on what the stage is at.
    fn detail(&self, text: &str);
    /// The stage is over.
    fn finish(&self);
}

/// Says nothing.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn start(&self, _stage: &str, _total: usize) {}
    fn advance(&self, _parts: usize) {}
    fn detail(&self, _text: &str) {}
    fn finish(&self) {}
}
