//! Accuracy of the estimator on surveys with true poses, a line per survey:
//! `cargo bench --bench ablation -- SURVEY...`.
//!
//! A line has the survey's name, the root mean square wall error of the photometric frames in
//! pixels (the gauge fixed by the majority), the number of frames, of photometric ones, and of
//! false successes. `benches/ablation.py` builds this program without one technique at a time and
//! compares the lines.

use std::sync::Arc;
use tunnelstitch::evaluate::converge::majority_error;
use tunnelstitch::progress::{Progress, Silent};
use tunnelstitch::refine::{FrameFlag, RefineOptions, refine};
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::poses_of;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    for path in std::env::args()
        .skip(1)
        .filter(|argument| argument != "--bench")
    {
        let survey = Survey::open(path.as_ref())?;
        let refined = refine(&survey, &RefineOptions::default(), &silent)?;
        let truth = poses_of(survey.truth.as_deref().unwrap_or_default());
        let poses = poses_of(&refined.trajectory);
        let error = majority_error(survey.surface.as_ref(), &survey.cameras, &poses, &truth)?;
        let frames = &refined.report.frames;
        let photometric = (frames.iter().zip(&error.frame_rms_px))
            .filter(|(frame, _)| frame.flag == FrameFlag::Photometric)
            .map(|(_, px)| px.powi(2));
        let (squares, count) = photometric.fold((0.0, 0), |(sum, n), square| (sum + square, n + 1));
        println!(
            "{path}\t{:.5}\t{}\t{count}\t{}",
            (squares / f64::from(count)).sqrt(),
            frames.len(),
            error.false_successes(frames)
        );
    }
    Ok(())
}
