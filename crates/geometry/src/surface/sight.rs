//! The wall that a frame sees: where its rays meet it within the camera's range.

use super::error::SurfaceError;
use super::shape::Surface;
use super::wall::Hit;
use crate::camera::Camera;
use crate::trajectory::Pose;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Range of a camera that is given none, radii of a circle with the section's perimeter: three
/// diameters.
///
/// A wall point at distance d of a camera at distance p from its line has the area `∝ p/d³` in the
/// picture: for a camera on the axis 1/216 of that of the wall beside it.
const DEFAULT_RANGE_RADII: f64 = 6.0;

/// Distance of the wall along the optical axis from which on a camera looks along the tunnel, radii
/// of a circle with the section's perimeter: 22° off the axis of a round tunnel.
const MAX_VIEWING_DISTANCE_RADII: f64 = 2.7;

/// Rays along each edge of a frame among which the nearest wall is sought.
const RAYS_PER_EDGE: usize = 8;

/// Radius of a circle with the section's perimeter, metres.
pub fn mean_radius_m(surface: &dyn Surface) -> f64 {
    surface.perimeter_m() / TAU
}

/// The camera with a range in this tunnel: its own, or, if that is unlimited, six radii of a circle
/// with the section's perimeter.
pub fn with_range(camera: &Camera, surface: &dyn Surface) -> Camera {
    let default_m = DEFAULT_RANGE_RADII * mean_radius_m(surface);
    let is_limited = camera.max_range_m.is_finite();
    Camera {
        max_range_m: if is_limited {
            camera.max_range_m
        } else {
            default_m
        },
        ..*camera
    }
}

/// Intersects the ray `ray_c` of a camera at `pose` with the wall within the camera's range.
///
/// # Errors
/// The errors of [`Surface::hit`]; [`SurfaceError::BeyondRange`].
pub fn sighted_wall(
    surface: &dyn Surface,
    camera: &Camera,
    pose: &Pose,
    ray_c: &Vector3<f64>,
) -> Result<Hit, SurfaceError> {
    let hit = surface.hit(&pose.t_wc, &(pose.r_wc * ray_c))?;
    let range_m = hit.range * ray_c.norm();
    if range_m <= camera.max_range_m {
        Ok(hit)
    } else {
        Err(SurfaceError::BeyondRange {
            range_m,
            max_range_m: camera.max_range_m,
        })
    }
}

/// Distance of the wall where a frame sees it best, metres: along the optical axis, or, if the
/// camera looks along the tunnel, of the nearest wall on the border of the picture.
///
/// # Errors
/// The errors of [`Surface::hit`]; of a camera that looks along the tunnel,
/// [`SurfaceError::LooksAlongTheAxis`] if no ray of the border meets the wall.
pub fn viewing_distance(
    surface: &dyn Surface,
    camera: &Camera,
    pose: &Pose,
) -> Result<f64, SurfaceError> {
    if let Some(distance_m) = distance_across(surface, pose)? {
        return Ok(distance_m);
    }
    let rays = camera.border(RAYS_PER_EDGE, 0.0).into_iter();
    let ranges_m = rays
        .filter_map(|pixel| camera.ray(pixel.x, pixel.y))
        .filter_map(|ray_c| {
            let hit = surface.hit(&pose.t_wc, &(pose.r_wc * ray_c)).ok()?;
            Some(hit.range * ray_c.norm())
        });
    ranges_m
        .min_by(f64::total_cmp)
        .ok_or(SurfaceError::LooksAlongTheAxis)
}

/// True if a camera's optical axis meets no wall, or only where it looks along the tunnel.
pub fn looks_along(surface: &dyn Surface, pose: &Pose) -> bool {
    !matches!(distance_across(surface, pose), Ok(Some(_)))
}

/// Distance of the wall along a camera's optical axis, metres; None if the camera looks along the
/// tunnel.
fn distance_across(surface: &dyn Surface, pose: &Pose) -> Result<Option<f64>, SurfaceError> {
    let farthest_m = MAX_VIEWING_DISTANCE_RADII * mean_radius_m(surface);
    match surface.hit(&pose.t_wc, &(pose.r_wc * Vector3::z())) {
        Ok(hit) => Ok(Some(hit.range).filter(|range_m| *range_m <= farthest_m)),
        Err(SurfaceError::Parallel) => Ok(None),
        Err(error) => Err(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::circle::Circle;
    use crate::trajectory::so3;

    fn facing(turn: Vector3<f64>) -> Pose {
        Pose::new(so3::exp(&turn), Vector3::zeros())
    }

    #[test]
    fn a_forward_camera_sees_the_wall_best_at_its_border() {
        let circle = Circle::new(3.0).unwrap();
        let camera = Camera::from_vertical_fov(640, 480, 90f64.to_radians());
        let along = facing(Vector3::x() * (-TAU / 4.0));
        // The corners are 59.04° off the axis: tan = hypot(319.5, 239.5)/240.
        let half_angle = (319.5f64.hypot(239.5) / 240.0).atan();
        let distance_m = viewing_distance(&circle, &camera, &along).unwrap();
        assert!((distance_m - 3.0 / half_angle.sin()).abs() < 1e-9);
        let across = facing(Vector3::zeros());
        assert_eq!(viewing_distance(&circle, &camera, &across), Ok(3.0));
        assert!(looks_along(&circle, &along) && !looks_along(&circle, &across));
    }

    #[test]
    fn wall_beyond_the_range_is_not_sighted() {
        let circle = Circle::new(3.0).unwrap();
        let mut camera = Camera::from_vertical_fov(640, 480, 90f64.to_radians());
        let ray_c = Vector3::new(0.0, 2.0, 1.0);
        let sighted =
            |camera: &Camera| sighted_wall(&circle, camera, &facing(Vector3::zeros()), &ray_c);
        // The ray meets the wall at (0, 6, 3), √45 m away.
        assert_eq!(sighted(&camera).unwrap().wall.h_m, 6.0);
        camera.max_range_m = 6.8;
        assert!(sighted(&camera).is_ok());
        camera.max_range_m = 6.7;
        let error = sighted(&camera).unwrap_err();
        assert!(matches!(
            error,
            SurfaceError::BeyondRange {
                max_range_m: 6.7,
                ..
            }
        ));
    }
}
