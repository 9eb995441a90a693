//! The cameras of a survey, and the one that took each frame.

use super::projection::Camera;
use std::sync::Arc;

/// The cameras of a survey: a single one, or those of a rig, whose pictures have one size.
///
/// The frames of a rig are in the order of their moments, and within a moment in that of its
/// cameras: frame k is taken by camera k modulo their number.
#[derive(Clone, Debug, PartialEq)]
pub struct Cameras {
    /// At least one.
    cameras: Arc<[Camera]>,
}

impl Cameras {
    /// The cameras of a rig; None if there are none.
    pub fn of_rig(cameras: Vec<Camera>) -> Option<Self> {
        (!cameras.is_empty()).then(|| Self {
            cameras: cameras.into(),
        })
    }

    /// Number of cameras, and of the frames of a moment.
    pub fn count(&self) -> usize {
        self.cameras.len()
    }

    /// True if there is more than one camera.
    pub fn is_rig(&self) -> bool {
        self.count() > 1
    }

    /// The camera that took frame `frame`.
    #[inline]
    pub fn of(&self, frame: usize) -> &Camera {
        &self.cameras[frame % self.cameras.len()]
    }

    /// All cameras.
    pub fn all(&self) -> &[Camera] {
        &self.cameras
    }

    /// Width and height of the pictures, pixels.
    pub fn size(&self) -> [u32; 2] {
        let first = self.of(0);
        [first.width, first.height]
    }

    /// The shorter side of the pictures, pixels.
    pub fn shorter_side(&self) -> u32 {
        self.of(0).shorter_side()
    }

    /// Each camera changed by a function.
    #[must_use]
    pub fn map(&self, change: impl FnMut(&Camera) -> Camera) -> Self {
        Self {
            cameras: self.cameras.iter().map(change).collect(),
        }
    }

    /// The cameras of pictures at a pyramid level.
    #[must_use]
    pub fn at_level(&self, level: usize) -> Self {
        self.map(|camera| camera.at_level(level))
    }

    /// The cameras of some of the frames, which are numbered anew; these same without frames.
    #[must_use]
    pub fn of_frames(&self, frames: &[usize]) -> Self {
        if !self.is_rig() || frames.is_empty() {
            return self.clone();
        }
        Self {
            cameras: frames.iter().map(|frame| *self.of(*frame)).collect(),
        }
    }
}

impl From<&Self> for Cameras {
    fn from(cameras: &Self) -> Self {
        cameras.clone()
    }
}

impl From<&Camera> for Cameras {
    fn from(camera: &Camera) -> Self {
        Self::from(*camera)
    }
}

impl From<Camera> for Cameras {
    fn from(camera: Camera) -> Self {
        Self {
            cameras: [camera].into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_a_rig_are_taken_by_its_cameras_in_turn() {
        let camera = |fov_deg: f64| Camera::from_vertical_fov(64, 48, fov_deg.to_radians());
        let cameras = Cameras::of_rig(vec![camera(50.0), camera(60.0), camera(70.0)]).unwrap();
        assert!(cameras.is_rig());
        assert_eq!(*cameras.of(4), camera(60.0));
        let chosen = cameras.of_frames(&[2, 4]);
        assert_eq!(chosen.all(), [camera(70.0), camera(60.0)]);
        assert!(Cameras::of_rig(Vec::new()).is_none());
    }

    #[test]
    fn a_single_camera_takes_all_frames() {
        let camera = Camera::from_vertical_fov(64, 48, 1.0);
        let cameras = Cameras::from(camera);
        assert!(!cameras.is_rig());
        assert_eq!(*cameras.of(17), camera);
        assert_eq!(cameras.at_level(1).size(), [32, 24]);
        assert_eq!(cameras.of_frames(&[3, 5]), cameras);
    }
}
