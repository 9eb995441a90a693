//! Distance between two poses of a frame, measured on the wall or in the picture.

use nalgebra::Vector3;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{Surface, shortest_arc, sighted_wall};
use tunnelstitch_geometry::trajectory::Pose;

/// Distance on the wall between two poses of a frame, metres: the mean over those of the picture's
/// middle and corners through which both poses see the wall.
///
/// It is infinite if there is none: two poses that see no wall through a common pixel cannot be
/// taken for one, so the ambiguity test must find them different.
pub fn separation_m(surface: &dyn Surface, camera: &Camera, a: &Pose, b: &Pose) -> f64 {
    let perimeter = surface.perimeter_m();
    mean_over_view(camera, |ray_c| {
        let hit = |pose: &Pose| sighted_wall(surface, camera, pose, ray_c).ok();
        let (a, b) = (hit(a)?.wall, hit(b)?.wall);
        Some(shortest_arc(a.s_m - b.s_m, perimeter).hypot(a.h_m - b.h_m))
    })
}

/// Distance between two poses of a frame in its picture, pixels: between where the wall is that the
/// first one sees through the middle and the corners, the mean over those that both see.
///
/// It is infinite if there is none.
pub fn separation_px(surface: &dyn Surface, camera: &Camera, a: &Pose, b: &Pose) -> f64 {
    mean_over_view(camera, |ray_c| {
        let hit = sighted_wall(surface, camera, a, ray_c).ok()?;
        let seen = camera.project(&b.to_camera(&hit.x_w))?;
        Some((seen - camera.project(ray_c)?).norm())
    })
}

/// Mean of a distance over the rays of the picture's middle and corners that have one; infinite if
/// none has.
fn mean_over_view(camera: &Camera, distance: impl Fn(&Vector3<f64>) -> Option<f64>) -> f64 {
    let rays = camera.corner_and_centre_rays();
    let distances = rays.iter().filter_map(distance);
    let (sum, count) = distances.fold((0.0, 0.0), |(sum, count), d| (sum + d, count + 1.0));
    if count > 0.0 {
        sum / count
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use tunnelstitch_geometry::surface::Circle;

    /// A camera that looks along the tunnel: its corners see the wall, its middle does not.
    #[test]
    fn separation_counts_only_pixels_that_see_the_wall() {
        let circle = Circle::new(3.0).unwrap();
        let camera = Camera::from_vertical_fov(160, 120, 60f64.to_radians());
        let along =
            UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -0.5 * std::f64::consts::PI);
        let pose = |h_m: f64| Pose::new(along, Vector3::new(0.0, h_m, 0.0));
        let middle = pose(0.0).r_wc * Vector3::z();
        assert!(circle.hit(&pose(0.0).t_wc, &middle).is_err());
        let separation_m = |b: &Pose| separation_m(&circle, &camera, &pose(0.0), b);
        assert!((separation_m(&pose(0.25)) - 0.25).abs() < 1e-12);
        // Outside the tunnel no pixel sees the wall.
        let outside = Pose::new(along, Vector3::new(0.0, 0.0, 9.0));
        assert_eq!(separation_m(&outside), f64::INFINITY);
    }
}
