//! Whole runs of `refine` and of `stitch` on files of poses and of a camera with a fuzzer's
//! numbers: nine bytes for a number to change, its place and its bits.

use super::super::{file, small_survey};
use std::sync::Arc;
use tunnelstitch::camera::format_calibration;
use tunnelstitch::progress::{Progress, Silent};
use tunnelstitch::refine::{RefineInput, RefineOptions, refine};
use tunnelstitch::render::{Stitch, StitchOptions};
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::tum;

/// Runs both. They fail, or give finite poses and a panorama.
pub fn run(data: &[u8]) {
    let mut survey = Survey::open(small_survey()).unwrap();
    let mut camera = *survey.cameras.of(0);
    for change in data.chunks_exact(9) {
        let Some(value) = change[1..].first_chunk().copied().map(f64::from_le_bytes) else {
            return;
        };
        let frame = usize::from(change[0] / 16) % survey.initial.len();
        let pose = &mut survey.initial[frame].pose;
        match change[0] % 16 {
            0 => pose.t_wc.x = value,
            1 => pose.t_wc.y = value,
            2 => pose.t_wc.z = value,
            3 => camera.fx = value,
            4 => camera.fy = value,
            5 => camera.cx = value,
            6 => camera.cy = value,
            _ => survey.initial[frame].time_s = value,
        }
    }
    let (_folder, initial) = file("poses.tum", tum::format(&survey.initial).as_bytes());
    let (_folder, camera) = file("camera.json", format_calibration(&camera).as_bytes());
    let opened = Survey::open_with(small_survey(), |file| {
        file.poses.initial = initial.clone();
        file.camera.first_mut().file = Some(camera.clone());
    });
    let Ok(survey) = opened else {
        return;
    };
    let poses = survey.initial_poses();
    let options = StitchOptions {
        px_per_metre: Some(5.0),
        ..StitchOptions::default()
    };
    if let Ok(mut stitch) = Stitch::new(
        survey.surface.as_ref(),
        &survey.cameras,
        &survey.frames,
        &poses,
        &survey.shutter(),
        &options,
    ) && let Ok(budget) = stitch.budget(0)
        && let Ok(settled) = stitch.settle(&budget, &Silent)
    {
        let (plan, frames) = stitch.plan(settled);
        let _ = plan.draw(frames, budget.room, &mut [], &Silent);
    }
    let progress: Arc<dyn Progress> = Arc::new(Silent);
    if let Ok(refined) = refine(
        RefineInput::from(&survey),
        &RefineOptions::default(),
        &progress,
    ) {
        let finite = |v: &f64| v.is_finite();
        assert!((refined.trajectory.iter()).all(|stamped| stamped.pose.t_wc.iter().all(finite)));
    }
}
