//! Places of the frames on the unrolled wall.

use crate::error::RenderError;
use tunnelstitch_geometry::camera::{Camera, Cameras, Sweep};
use tunnelstitch_geometry::surface::{Footprint, Surface, viewing_distance};
use tunnelstitch_geometry::trajectory::{Pose, Shutter};

/// Index that stands in a map of frames where no frame sees the wall.
pub const NO_FRAME: u32 = u32::MAX;

/// A frame with its pose and its place on the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Camera-to-world pose; with a sweep, that of the middle row.
    pub pose: Pose,
    /// Its motion while the rows are read.
    pub sweep: Sweep,
    /// The part of the wall it sees.
    pub footprint: Footprint,
}

impl Placement {
    /// The frame's camera with its motion.
    pub fn camera(&self, camera: &Camera) -> Camera {
        camera.with_sweep(&self.sweep)
    }
}

/// Places every frame on the wall, taken by its camera, its rows read by `shutter`.
///
/// # Errors
/// [`RenderError::Frame`], for the first frame that has no place.
pub fn place_frames(
    surface: &dyn Surface,
    cameras: impl Into<Cameras>,
    poses: &[Pose],
    shutter: &Shutter,
) -> Result<Vec<Placement>, RenderError> {
    let cameras = cameras.into();
    poses
        .iter()
        .zip(shutter.sweeps(poses))
        .enumerate()
        .map(|(frame, (pose, sweep))| {
            Ok(Placement {
                pose: *pose,
                sweep,
                footprint: Footprint::trace(surface, &cameras.of(frame).with_sweep(&sweep), pose)
                    .map_err(|source| RenderError::Frame { frame, source })?,
            })
        })
        .collect()
}

/// The frames' own resolution at the wall: the median over the frames of `f / distance`, pixels per
/// metre, with the distance of the wall along the optical axis, metres, and `f = √(fx fy)`, pixels.
///
/// # Errors
/// [`RenderError::Frame`] for a camera that stands outside or looks along the axis.
pub fn native_px_per_metre<'a>(
    surface: &dyn Surface,
    cameras: impl Into<Cameras>,
    poses: impl IntoIterator<Item = &'a Pose>,
) -> Result<f64, RenderError> {
    let cameras = cameras.into();
    let mut resolutions = Vec::new();
    for (frame, pose) in poses.into_iter().enumerate() {
        let camera = cameras.of(frame);
        let distance_m = viewing_distance(surface, camera, pose)
            .map_err(|source| RenderError::Frame { frame, source })?;
        resolutions.push(camera.focal_px() / distance_m);
    }
    resolutions.sort_by(f64::total_cmp);
    match resolutions.get(resolutions.len() / 2) {
        Some(median) => Ok(*median),
        None => Err(RenderError::Count {
            poses: 0,
            frames: 0,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use std::f64::consts::TAU;
    use tunnelstitch_geometry::surface::Circle;
    use tunnelstitch_geometry::trajectory::so3;

    fn camera() -> Camera {
        Camera::from_vertical_fov(640, 480, 60f64.to_radians())
    }

    fn facing(turn: Vector3<f64>) -> Pose {
        Pose::new(so3::exp(&turn), Vector3::zeros())
    }

    #[test]
    fn native_resolution_is_focal_length_over_distance() {
        let circle = Circle::new(3.0).unwrap();
        let poses = [facing(Vector3::zeros()), facing(Vector3::y())];
        let ppm = native_px_per_metre(&circle, camera(), &poses).unwrap();
        assert!((ppm - camera().fx / 3.0).abs() < 1e-9);
    }

    #[test]
    fn a_frame_without_a_place_is_named_with_the_remedy() {
        let circle = Circle::new(3.0).unwrap();
        let poses = [
            facing(Vector3::zeros()),
            facing(Vector3::x() * (-TAU / 4.0)),
        ];
        let message = place_frames(&circle, camera(), &poses, &Shutter::default())
            .unwrap_err()
            .to_string();
        for part in ["frame 1", "vanishing point", "check its pose"] {
            assert!(message.contains(part), "{message}");
        }
    }
}
