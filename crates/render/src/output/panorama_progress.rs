//! Progress of a job that draws one panorama or several.

use super::plan::DRAWING;
use std::sync::atomic::{AtomicUsize, Ordering};
use tunnelstitch_core::progress::{JobStage, Progress};

/// Share of a panorama's work that comes before its first band: decoding, exposures, seams.
/// Measured on 48 frames of 480 × 360 px and 1,000 of 320 × 240 px, at their own resolution.
const SETTLE_SHARE: f64 = 0.6;

/// A job that draws panoramas, or a part of one.
#[derive(Clone, Copy)]
pub struct PanoramaJob<'p> {
    progress: &'p dyn Progress,
    /// Index of the first panorama of this part in the job.
    first: usize,
    /// Number of panoramas of the job.
    of: usize,
}

impl<'p> PanoramaJob<'p> {
    /// A job of so many panoramas, which reports to `progress`.
    pub fn new(progress: &'p dyn Progress, of: usize) -> Self {
        let first = 0;
        Self {
            progress,
            first,
            of,
        }
    }

    /// The part of the job after its first `count` panoramas.
    #[must_use]
    pub fn after(self, count: usize) -> Self {
        let first = self.first + count;
        Self { first, ..self }
    }

    /// Reports of the panorama with this index in this part of the job.
    pub fn panorama(&self, index: usize) -> PanoramaProgress<'p> {
        PanoramaProgress {
            progress: self.progress,
            panorama: self.first + index,
            of: self.of,
            stage: AtomicUsize::new(0),
        }
    }
}

/// Reports of one of the panoramas of a job, with its place in the job: each has two stages, what
/// comes before the drawing, and the drawing. All are taken to need the same time.
pub struct PanoramaProgress<'p> {
    progress: &'p dyn Progress,
    /// Index of the panorama in the job.
    panorama: usize,
    /// Number of panoramas.
    of: usize,
    /// Number of the stage of the job under way.
    stage: AtomicUsize,
}

impl PanoramaProgress<'_> {
    /// The place of a stage of the panorama in the job.
    fn place(&self, is_drawing: bool) -> JobStage {
        let (before, share) = match is_drawing {
            false => (0.0, SETTLE_SHARE),
            true => (SETTLE_SHARE, 1.0 - SETTLE_SHARE),
        };
        let of = self.of as f64;
        JobStage {
            number: 2 * self.panorama + 1 + usize::from(is_drawing),
            of: 2 * self.of,
            done_share: (self.panorama as f64 + before) / of,
            share: share / of,
        }
    }
}

impl Progress for PanoramaProgress<'_> {
    fn start(&self, stage: &str, total: usize) {
        let place = self.place(stage == DRAWING);
        if self.stage.swap(place.number, Ordering::Relaxed) != place.number {
            self.progress.enter_job_stage(place);
        }
        self.progress.start(stage, total);
    }

    fn advance(&self, parts: usize) {
        self.progress.advance(parts);
    }

    fn detail(&self, text: &str) {
        self.progress.detail(text);
    }

    fn finish(&self) {
        self.progress.finish();
    }
}

impl Drop for PanoramaProgress<'_> {
    fn drop(&mut self) {
        if self.panorama + 1 == self.of {
            self.progress.leave_job();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    /// A receiver that notes the stages of the job.
    #[derive(Default)]
    struct Places(Mutex<Vec<Option<JobStage>>>);

    impl Progress for Places {
        fn start(&self, _stage: &str, _total: usize) {}
        fn advance(&self, _parts: usize) {}
        fn detail(&self, _text: &str) {}
        fn finish(&self) {}
        fn enter_job_stage(&self, stage: JobStage) {
            self.0.lock().unwrap().push(Some(stage));
        }
        fn leave_job(&self) {
            self.0.lock().unwrap().push(None);
        }
    }

    #[test]
    fn stages_of_all_panoramas_add_up_to_the_whole_job() {
        let places = Places::default();
        let job = PanoramaJob::new(&places, 3);
        let panoramas = [
            job.panorama(0),
            job.after(1).panorama(0),
            job.after(1).panorama(1),
        ];
        for progress in panoramas {
            for stage in ["frames", "thumbnails", "seams", DRAWING] {
                progress.start(stage, 1);
            }
        }
        let mut places = places.0.into_inner().unwrap();
        // The job is over after the last.
        assert_eq!(places.pop(), Some(None));
        let places: Vec<JobStage> = places.into_iter().flatten().collect();
        let mut done_share = 0.0;
        for (k, place) in places.iter().enumerate() {
            assert_eq!((place.number, place.of), (k + 1, 6));
            assert!((place.done_share - done_share).abs() < 1e-12, "{place:?}");
            done_share += place.share;
        }
        assert!((done_share - 1.0).abs() < 1e-12);
    }
}
