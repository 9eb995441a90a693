//! Wall error with the gauge fixed by the majority of the frames.

use crate::error::EvaluateError;
use crate::error::check_pairs;
use crate::wall_error::{FrameOffsets, frame_offsets, mean_arc};
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::surface::{Surface, shortest_arc};
use tunnelstitch_geometry::trajectory::Pose;
use tunnelstitch_refine::{FrameFlag, FrameReport};

/// Root mean square wall error below which a frame is good, pixels.
pub const GOOD_PX: f64 = 0.5;

/// Deviation of a photometric frame beyond which its stated σ is wrong, σ.
const MAX_DEVIATION_SIGMA: f64 = 3.5;

/// Wall errors of frames with the gauge fixed by the majority of them.
#[derive(Clone, Debug, PartialEq)]
pub struct MajorityError {
    /// Root mean square wall error of each frame, pixels at its centre.
    ///
    /// It is infinite for a frame whose estimated pose does not see the wall.
    pub frame_rms_px: Vec<f64>,
}

impl MajorityError {
    /// Number of frames below [`GOOD_PX`].
    pub fn good_count(&self) -> usize {
        self.frame_rms_px.iter().filter(|px| **px < GOOD_PX).count()
    }

    /// Number of photometric frames that are neither good nor within 3.5 of their stated σ:
    /// undetected failures.
    pub fn false_successes(&self, frames: &[FrameReport]) -> usize {
        // NaN does not count as good.
        let is_good = |px: f64, sigma_px: f64| px < GOOD_PX.max(MAX_DEVIATION_SIGMA * sigma_px);
        (frames.iter().zip(&self.frame_rms_px))
            .filter(|(frame, _)| frame.flag == FrameFlag::Photometric)
            .filter(|(frame, px)| !is_good(**px, frame.sigma.wall_px))
            .count()
    }

    /// Error of the worst frame, pixels.
    pub fn worst_px(&self) -> f64 {
        self.frame_rms_px.iter().copied().fold(0.0, f64::max)
    }

    /// Root mean square error of all frames, pixels.
    pub fn rms_px(&self) -> f64 {
        crate::error_statistics::root_mean_square(&self.frame_rms_px)
    }
}

/// Computes wall errors with the gauge fixed by the majority of the frames.
///
/// It differs from [`wall_error()`](crate::wall_error()) in the gauge shift (Δs, Δh),
/// which is found by consensus. Every frame proposes its own mean, and the proposal with the most
/// good frames wins (of equals, that of the least median error). The shift is then the mean over
/// the good frames, repeated until they stay the same. Lost frames have no influence. If the
/// frames fall into two parts, each consistent in itself, the larger counts as right and the other
/// as lost. If all frames are good, the shift equals that of `wall_error`.
///
/// # Errors
/// [`EvaluateError::Count`], [`EvaluateError::Empty`].
pub fn majority_error(
    surface: &dyn Surface,
    cameras: impl Into<Cameras>,
    estimated: &[Pose],
    truth: &[Pose],
) -> Result<MajorityError, EvaluateError> {
    check_pairs(estimated.len(), truth.len())?;
    let cameras = cameras.into();
    // True poses are inside and look at the wall, or there would be no images. Only an estimated
    // pose can miss the wall.
    let offsets: Vec<Option<FrameOffsets>> = estimated
        .iter()
        .zip(truth)
        .enumerate()
        .map(|(frame, (estimate, truth))| {
            frame_offsets(surface, cameras.of(frame), frame, estimate, truth).ok()
        })
        .collect();
    let frames = AllOffsets {
        surface,
        frames: &offsets,
    };
    let mut best: Option<MajorityError> = None;
    for (proposer, _) in offsets.iter().enumerate().filter(|(_, o)| o.is_some()) {
        let error = frames.errors(frames.shift(|frame| frame == proposer));
        if best.as_ref().is_none_or(|best| is_better(&error, best)) {
            best = Some(error);
        }
    }
    let Some(mut best) = best else {
        return Ok(MajorityError {
            frame_rms_px: vec![f64::INFINITY; offsets.len()],
        });
    };
    // The number of good frames never falls, so the iteration ends; a few iterations suffice.
    for _ in 0..offsets.len() {
        if best.good_count() == 0 {
            break;
        }
        let error = frames.errors(frames.shift(|frame| best.frame_rms_px[frame] < GOOD_PX));
        if error.good_count() < best.good_count() || error == best {
            break;
        }
        best = error;
    }
    Ok(best)
}

/// True if `a` has more good frames than `b`, or as many and a smaller median.
fn is_better(a: &MajorityError, b: &MajorityError) -> bool {
    let median = |error: &MajorityError| {
        let mut sorted = error.frame_rms_px.clone();
        sorted.sort_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    };
    match a.good_count().cmp(&b.good_count()) {
        std::cmp::Ordering::Equal => median(a) < median(b),
        order => order.is_gt(),
    }
}

/// Displacements of all frames.
struct AllOffsets<'a> {
    surface: &'a dyn Surface,
    frames: &'a [Option<FrameOffsets>],
}

impl AllOffsets<'_> {
    /// Mean (Δs, Δh) of the selected frames, metres, as far as the gauge leaves it free.
    fn shift(&self, is_selected: impl Fn(usize) -> bool) -> [f64; 2] {
        let (mut delta_s, mut delta_h) = (Vec::new(), Vec::new());
        for (frame, offsets) in self.frames.iter().enumerate() {
            if let Some(offsets) = offsets
                && is_selected(frame)
            {
                delta_s.extend_from_slice(&offsets.delta_s_m);
                delta_h.extend_from_slice(&offsets.delta_h_m);
            }
        }
        let gauge = self.surface.gauge();
        let shift_s_m = if gauge.turn {
            mean_arc(&delta_s, self.surface.perimeter_m())
        } else {
            0.0
        };
        let shift_h_m = if gauge.shift {
            delta_h.iter().sum::<f64>() / delta_h.len() as f64
        } else {
            0.0
        };
        [shift_s_m, shift_h_m]
    }

    /// Errors after removing a shift, metres.
    fn errors(&self, [shift_s_m, shift_h_m]: [f64; 2]) -> MajorityError {
        let perimeter_m = self.surface.perimeter_m();
        let rms_px = |offsets: &FrameOffsets| {
            let pairs = offsets.delta_s_m.iter().zip(&offsets.delta_h_m);
            let squares: f64 = pairs
                .map(|(s, h)| {
                    shortest_arc(s - shift_s_m, perimeter_m).powi(2) + (h - shift_h_m).powi(2)
                })
                .sum();
            (squares / offsets.delta_s_m.len() as f64).sqrt() / offsets.pixel_m
        };
        let frame_rms_px = self
            .frames
            .iter()
            .map(|offsets| offsets.as_ref().map_or(f64::INFINITY, rms_px))
            .collect();
        MajorityError { frame_rms_px }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wall_error::wall_error;
    use tunnelstitch_geometry::camera::Camera;
    use tunnelstitch_geometry::surface::{Circle, GaugeMotion};
    use tunnelstitch_geometry::trajectory::spiral;

    fn scene() -> (Circle, Camera, Vec<Pose>) {
        let circle = Circle::new(3.0).unwrap();
        let camera = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
        (circle, camera, spiral(24, 0.1, 30f64.to_radians()))
    }

    fn gauge(turn_rad: f64, shift_m: f64) -> GaugeMotion {
        GaugeMotion::about_y(turn_rad, shift_m)
    }

    #[test]
    fn a_lost_frame_does_not_affect_the_others() {
        let (circle, camera, truth) = scene();
        let mut estimated = gauge(2.9, -7.0).apply_all(&truth);
        estimated[5].t_wc.y += 1.0;
        estimated[9].t_wc.x = 5.0;
        let error = majority_error(&circle, camera, &estimated, &truth).unwrap();
        assert_eq!(error.good_count(), 22);
        assert!(error.frame_rms_px[4] < 1e-6, "{}", error.frame_rms_px[4]);
        let expected = camera.fx / 3.0;
        assert!((error.frame_rms_px[5] - expected).abs() < 1e-6);
        assert_eq!(error.frame_rms_px[9], f64::INFINITY);
        // A least-squares gauge spreads the error over all frames.
        estimated[9] = gauge(2.9, -7.0).apply(&truth[9]);
        let wall = wall_error(&circle, camera, &estimated, &truth).unwrap();
        assert!(wall.frame_rms_px[4] > 5.0);
    }

    #[test]
    fn of_two_parts_the_larger_is_right() {
        let (circle, camera, truth) = scene();
        let mut estimated = truth.clone();
        for pose in &mut estimated[13..] {
            *pose = gauge(0.1, 0.3).apply(pose);
        }
        let error = majority_error(&circle, camera, &estimated, &truth).unwrap();
        assert_eq!(error.good_count(), 13);
        assert!(error.frame_rms_px[..13].iter().all(|px| *px < 1e-6));
    }

    #[test]
    fn where_all_are_good_it_is_the_wall_error() {
        let (circle, camera, truth) = scene();
        let estimated: Vec<Pose> = truth
            .iter()
            .enumerate()
            .map(|(k, pose)| gauge(1.0, 3.0 + 1e-4 * (k % 5) as f64).apply(pose))
            .collect();
        let error = majority_error(&circle, camera, &estimated, &truth).unwrap();
        let wall = wall_error(&circle, camera, &estimated, &truth).unwrap();
        assert_eq!(error.good_count(), 24);
        for (ours, theirs) in error.frame_rms_px.iter().zip(&wall.frame_rms_px) {
            assert!((ours - theirs).abs() < 1e-9, "{ours} {theirs}");
        }
        assert!((error.worst_px() - wall.worst_frame_rms_px).abs() < 1e-9);
        assert!((error.rms_px() - wall.px.rms).abs() < 1e-9);
    }
}
