//! Distance between two poses of a frame, measured on the wall.

use crate::camera::Camera;
use crate::surface::{Surface, shortest_arc};
use crate::trajectory::Pose;

/// Distance on the wall between what two poses of a frame show, metres: the mean over the middle
/// and the corners of the picture, as far as the lens shows them and both poses see the wall there.
///
/// Infinity if no such point is left: two poses that see no wall through a common pixel cannot be
/// taken for one, so the ambiguity test must find them apart.
pub fn separation_m(surface: &dyn Surface, camera: &Camera, a: &Pose, b: &Pose) -> f64 {
    let perimeter = surface.perimeter_m();
    let (mut sum_m, mut count) = (0.0, 0.0);
    for ray_c in camera.corner_and_centre_rays() {
        let hit = |pose: &Pose| surface.hit(&pose.t_wc, &(pose.r_wc * ray_c)).ok();
        if let (Some(a), Some(b)) = (hit(a), hit(b)) {
            let (a, b) = (a.wall, b.wall);
            sum_m += shortest_arc(a.s_m - b.s_m, perimeter).hypot(a.h_m - b.h_m);
            count += 1.0;
        }
    }
    if count > 0.0 {
        sum_m / count
    } else {
        f64::INFINITY
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::{KannalaBrandt, Lens};
    use crate::surface::Circle;
    use nalgebra::{UnitQuaternion, Vector3};

    /// A fisheye of which the lens shows the middle, but not the corners of the picture.
    #[test]
    fn separation_counts_only_pixels_that_the_lens_shows() {
        let circle = Circle::new(3.0).unwrap();
        let fisheye = KannalaBrandt::new([0.0; 4]).limited_to(0.3);
        let camera = Camera {
            lens: Lens::KannalaBrandt(fisheye),
            ..Camera::from_vertical_fov(160, 120, 60f64.to_radians())
        };
        assert_eq!(camera.corner_and_centre_rays().len(), 1);
        let pose = |h_m: f64| Pose::new(UnitQuaternion::identity(), Vector3::new(0.0, h_m, 0.0));
        let separation_m = |b: &Pose| separation_m(&circle, &camera, &pose(0.0), b);
        assert!((separation_m(&pose(0.25)) - 0.25).abs() < 1e-12);
        let outside = Pose::new(UnitQuaternion::identity(), Vector3::new(0.0, 0.0, 9.0));
        assert_eq!(separation_m(&outside), f64::INFINITY);
    }
}
