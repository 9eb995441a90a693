//! Poses of the camera while the rows of a frame are taken.

use crate::camera_path::CameraPath;
use crate::motion_blur::MotionBlur;
use crate::options::SimulateOptions;
use crate::tunnel::Tunnel;
use tunnelstitch_geometry::trajectory::Pose;

/// Time from the even rows of an interlaced frame to the odd ones, as a share of that to the next
/// frame.
const FIELD_DELAY: f64 = 0.5;

/// Motion of the camera: along its path, by interlaced fields, and during an exposure.
pub(super) struct FrameMotion {
    path: CameraPath,
    interlaced: bool,
    blur: Option<MotionBlur>,
}

impl FrameMotion {
    /// The motion through the true poses, by the options of a survey.
    pub fn new(options: &SimulateOptions, truth: Vec<Pose>, tunnel: &Tunnel) -> Self {
        let readout_share = 1e-3 * options.readout_ms / options.interval_s;
        let camera = &options.camera;
        let path = CameraPath::new(truth, readout_share, camera.height);
        let blur_px = options.effects.motion_blur_px;
        let blur = |path| MotionBlur::new(blur_px, options.seed, path, camera, tunnel);
        Self {
            blur: (blur_px > 0.0).then(|| blur(&path)),
            interlaced: options.interlaced,
            path,
        }
    }

    /// The poses of the frames, at the time of the middle of their even rows.
    pub fn poses(&self) -> &[Pose] {
        self.path.poses()
    }

    /// Times of the sub-exposures of a frame, from −½ to ½ of its exposure.
    pub fn exposure_times(&self) -> Vec<f64> {
        self.blur.as_ref().map_or(vec![0.0], MotionBlur::times)
    }

    /// The pose of a frame while row number `row` is read, at a vertical position v within it and a
    /// time within the exposure.
    pub fn pose(&self, frame: usize, row: usize, v: f64, time: f64) -> Pose {
        let is_late = self.interlaced && row % 2 == 1;
        let delay = if is_late { FIELD_DELAY } else { 0.0 };
        match &self.blur {
            Some(blur) => blur.pose(&self.path, frame, v, delay, time),
            None => self.path.pose_at_row(frame, v, delay),
        }
    }

    /// The poses of a frame at vertical position v: those of both fields, at the beginning and at
    /// the end of the exposure.
    pub fn outermost_poses(&self, frame: usize, v: f64) -> Vec<Pose> {
        let times: &[f64] = if self.blur.is_some() {
            &[-0.5, 0.5]
        } else {
            &[0.0]
        };
        let fields = 0..=usize::from(self.interlaced);
        let poses = fields.flat_map(|row| times.iter().map(move |time| (row, *time)));
        poses
            .map(|(row, time)| self.pose(frame, row, v, time))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::spiral;

    fn motion(options: &SimulateOptions) -> FrameMotion {
        FrameMotion::new(options, spiral(5, 0.2, 0.5), &Tunnel::Round(3.0))
    }

    #[test]
    fn odd_rows_are_half_a_frame_later() {
        let interlaced = motion(&SimulateOptions {
            interlaced: true,
            ..SimulateOptions::free()
        });
        let progressive = motion(&SimulateOptions::free());
        for row in 0..4 {
            let pose = interlaced.pose(2, row, row as f64, 0.0);
            let share = 2.0 + 0.5 * (row % 2) as f64;
            assert!((pose.t_wc.y - 0.2 * share).abs() < 1e-12);
            assert!((pose.r_wc.angle() - 0.5 * share).abs() < 1e-12);
            let other = progressive.pose(2, row, row as f64, 0.0);
            assert_eq!(other, progressive.poses()[2]);
        }
        assert_eq!(interlaced.outermost_poses(2, 7.0).len(), 2);
        assert_eq!(progressive.outermost_poses(2, 7.0).len(), 1);
    }

    #[test]
    fn fields_and_exposures_add_up() {
        let mut options = SimulateOptions {
            interlaced: true,
            ..SimulateOptions::free()
        };
        options.effects.motion_blur_px = 4.0;
        let both = motion(&options);
        assert_eq!(both.exposure_times().len(), 6);
        let [start, end] = [-0.5, 0.5].map(|time| both.pose(1, 3, 3.0, time).t_wc.y);
        assert!(start < 0.3 && end > 0.3 && (start + end - 0.6).abs() < 1e-9);
        assert_eq!(both.outermost_poses(1, 3.0).len(), 4);
    }
}
