//! Keyframe selection: subsampling of a video by the rotation of the view.

use super::associate::Associate;
use super::error::SurveyError;
use super::open::Survey;
use super::poses_section::PosesSection;
use std::path::Path;
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_geometry::trajectory::{Pose, poses_of};

impl Survey {
    /// Keeps frames whose view is rotated by `step_deg` against the previous kept frame, by the
    /// initial poses, which are those of the tunnel as planned.
    ///
    /// # Errors
    /// An impossible step; poses that are not associated by time, as the selection requires.
    pub(super) fn select_keyframes(
        &mut self,
        step_deg: f64,
        toml_path: &Path,
        planned: &dyn Surface,
    ) -> Result<(), SurveyError> {
        let fail = |what: String| {
            Err(SurveyError::Value {
                path: toml_path.to_owned(),
                what,
            })
        };
        if !(step_deg > 0.0 && step_deg <= 180.0) {
            return fail(format!(
                "frames.angle_step_deg is {step_deg}; it must be above 0 and up to 180 degrees"
            ));
        }
        let section = &self.file.poses;
        if section.associate() != Some(Associate::Time) {
            return fail(
                "frames.angle_step_deg needs poses.associate = \"time\": the poses determine \
                 which pictures are frames"
                    .to_owned(),
            );
        }
        let path = self.folder.join(&section.initial);
        // A shift counts the frames that are selected.
        let unmoved = PosesSection {
            shift_frames: None,
            ..section.clone()
        };
        let all = self.read_as(&unmoved, &path, planned, section.missing_poses())?;
        let kept = keyframe_indices(&poses_of(&all.trajectory), step_deg.to_radians());
        self.frames = self.frames.only(&kept);
        if let Some(times_s) = &mut self.times_s {
            *times_s = kept.iter().map(|k| times_s[*k]).collect();
        }
        Ok(())
    }
}

/// Indices of the first pose and of each pose rotated by at least `step_rad` (to rounding) against
/// the previous selected one.
fn keyframe_indices(poses: &[Pose], step_rad: f64) -> Vec<usize> {
    const ANGLE_TOLERANCE_RAD: f64 = 1e-6;
    let mut kept: Vec<usize> = Vec::new();
    for (k, pose) in poses.iter().enumerate() {
        let last = kept.last().map(|last| &poses[*last]);
        if last.is_none_or(|last| last.r_wc.angle_to(&pose.r_wc) >= step_rad - ANGLE_TOLERANCE_RAD)
        {
            kept.push(k);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::spiral;

    #[test]
    fn views_are_as_far_apart_as_asked() {
        let poses = spiral(20, 0.01, 4f64.to_radians());
        let kept = |step_deg: f64| keyframe_indices(&poses, step_deg.to_radians());
        assert_eq!(kept(12.0), [0, 3, 6, 9, 12, 15, 18]);
        assert_eq!(kept(30.0), [0, 8, 16]);
        assert_eq!(kept(1.0).len(), 20);
        // A carrier that stands still adds nothing.
        assert_eq!(keyframe_indices(&[poses[0]; 5], 0.1), [0]);
    }
}
