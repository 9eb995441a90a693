//! Frames and pixels that show a point of the wall.

use super::placement::Placement;
use nalgebra::{Matrix2, Vector2};
use serde::Serialize;
use tunnelstitch_core::frames::Masks;
use tunnelstitch_geometry::camera::{Camera, Cameras};
use tunnelstitch_geometry::surface::{Surface, WallFrame, WallPoint};
use tunnelstitch_geometry::trajectory::Pose;

/// A frame that shows a point of the wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Sighting {
    /// Index of the frame.
    pub frame: usize,
    /// The pixel that shows it (integers are pixels' centres).
    pub pixel: [f64; 2],
    /// Distance from the camera's centre, metres.
    pub distance_m: f64,
    /// Resolution of the frame there, pixels per metre of wall, along the direction in which it is
    /// least.
    pub px_per_metre: f64,
    /// Angle between the view and the wall's normal, degrees.
    pub obliqueness_deg: f64,
}

/// Margin beyond the outermost pixel centres within which a frame still shows a point, pixels:
/// rounding on the way to the wall and back.
const ROUNDING_PX: f64 = 1e-6;

/// Resolution at a wall point, pixels per metre, along the direction in which it is lowest: the
/// smaller singular value of `∂(u, v)/∂(s, h) = ∂π/∂x_c R_wcᵀ (e_s, e_h)`.
fn least_stretch(camera: &Camera, pose: &Pose, point: &WallFrame) -> f64 {
    let jacobian = camera.project_jacobian(&pose.to_camera(&point.x_w));
    let tangents = [point.e_s, point.e_h].map(|e| pose.r_wc.inverse_transform_vector(&e));
    let stretch = Matrix2::from_columns(&tangents.map(|e| jacobian * e));
    stretch.singular_values().min()
}

/// Resolution at a wall point, pixels per metre, along the direction in which it is lowest; None if
/// the frame does not show it.
pub(crate) fn px_per_metre(camera: &Camera, pose: &Pose, point: &WallFrame) -> Option<f64> {
    let pixel = camera.project(&pose.to_camera(&point.x_w))?;
    camera
        .is_in_image(&pixel, -ROUNDING_PX)
        .then(|| least_stretch(camera, pose, point))
}

/// Finds the frames that show `wall`, the one with the highest resolution there first; what their
/// `masks` hide shows nothing.
pub fn sightings(
    surface: &dyn Surface,
    cameras: impl Into<Cameras>,
    masks: &Masks,
    placements: &[Placement],
    wall: WallPoint,
) -> Vec<Sighting> {
    let (cameras, point) = (cameras.into(), surface.frame(wall));
    let sight = |(frame, placement): (usize, &Placement)| {
        let pose = &placement.pose;
        let camera = &placement.camera(cameras.of(frame));
        let mask = masks.of(frame);
        let x_c = pose.to_camera(&point.x_w);
        let pixel = camera
            .project(&x_c)
            .filter(|pixel| camera.is_in_image(pixel, -ROUNDING_PX))
            .filter(|pixel| {
                mask.is_none_or(|mask| mask.is_clear(pixel.x as f32, pixel.y as f32, 0.0))
            })?;
        let normal = point.e_s.cross(&point.e_h);
        let ray = point.x_w - pose.t_wc;
        let cosine = ray.dot(&normal).abs() / (ray.norm() * normal.norm());
        Some(Sighting {
            frame,
            pixel: Vector2::into(pixel),
            distance_m: ray.norm(),
            px_per_metre: least_stretch(camera, pose, &point),
            obliqueness_deg: cosine.min(1.0).acos().to_degrees(),
        })
    };
    let mut found: Vec<Sighting> = placements.iter().enumerate().filter_map(sight).collect();
    // Stable: of equals the earlier frame comes first.
    found.sort_by(|a, b| b.px_per_metre.total_cmp(&a.px_per_metre));
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::layout::placement::place_frames;
    use tunnelstitch_core::test_wall::{TestWall, waves};
    use tunnelstitch_geometry::trajectory::{Shutter, indexed};

    /// Each pixel's ray meets the point again, and its stretch is what its neighbours say.
    #[test]
    fn every_sighting_looks_at_the_point() {
        let wall = TestWall::ring(waves);
        let times = indexed(wall.poses.iter().copied());
        for readout_s in [0.0, 0.06] {
            let shutter = Shutter::new(readout_s, wall.camera.height, &times);
            look_at_points(&wall, &shutter);
        }
    }

    fn look_at_points(wall: &TestWall, shutter: &Shutter) {
        let placements = place_frames(&wall.circle, wall.camera, &wall.poses, shutter).unwrap();
        let mut seen = 0;
        for k in 0..40 {
            let point = WallPoint {
                s_m: wall.perimeter_m() * f64::from(k) / 40.0,
                h_m: 0.2 + 0.1 * (1.7 * f64::from(k)).sin(),
            };
            let found = sightings(&wall.circle, wall.camera, &Masks::NONE, &placements, point);
            assert!(found.is_sorted_by(|a, b| a.px_per_metre >= b.px_per_metre));
            for sighting in &found {
                seen += 1;
                let pose = &wall.poses[sighting.frame];
                let camera = placements[sighting.frame].camera(&wall.camera);
                let [u, v] = sighting.pixel;
                let meets = |u: f64, v: f64| {
                    let start = pose.to_world(&camera.origin(v));
                    let ray = pose.r_wc * camera.ray(u, v).unwrap();
                    wall.circle.hit(&start, &ray).unwrap()
                };
                let hit = meets(u, v);
                let x_w = wall.circle.frame(point).x_w;
                assert!((hit.x_w - x_w).norm() < 1e-9);
                assert!(((x_w - pose.t_wc).norm() - sighting.distance_m).abs() < 1e-9);
                // The farthest that a step of a hundredth of a pixel goes on the wall, in whatever
                // direction.
                let farthest = (0..360)
                    .map(|degree| {
                        let (sin, cos) = f64::from(degree).to_radians().sin_cos();
                        (meets(u + 0.01 * cos, v + 0.01 * sin).x_w - x_w).norm() / 0.01
                    })
                    .fold(0.0, f64::max);
                assert!((farthest * sighting.px_per_metre - 1.0).abs() < 1e-2);
                let outwards = nalgebra::Vector3::new(x_w.x, 0.0, x_w.z);
                let angle_deg = (x_w - pose.t_wc).angle(&outwards).to_degrees();
                assert!((sighting.obliqueness_deg - angle_deg).abs() < 1e-5);
            }
        }
        assert!(seen > 40, "{seen}");
    }
}
