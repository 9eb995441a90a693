//! Progress reports of long computations.

/// A receiver of progress reports. The library calls it from any thread; the program draws progress
/// bars.
pub trait Progress: Send + Sync {
    /// Begins a stage of `total` equal parts, which replaces the previous one.
    fn start(&self, stage: &str, total: usize);
    /// Reports that `parts` more parts of the stage are done.
    fn advance(&self, parts: usize);
    /// Reports the current state of the stage in a few words.
    fn detail(&self, text: &str);
    /// Ends the stage.
    fn finish(&self);
}

/// A receiver that ignores all reports.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn start(&self, _stage: &str, _total: usize) {}
    fn advance(&self, _parts: usize) {}
    fn detail(&self, _text: &str) {}
    fn finish(&self) {}
}
