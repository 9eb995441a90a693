//! Camera position from which a wall is seen more or less squarely, near or far.

use crate::samples::footprints::MIN_RESOLVED_SHARE;
use nalgebra::Vector3;
use tunnelstitch_geometry::trajectory::Pose;

/// A camera position, from which walls that are far off or oblique are hardly resolved.
pub struct Viewpoint {
    /// The camera's centre relative to the origin of wall points, metres.
    centre: Vector3<f32>,
    /// The distance at which a wall that is seen squarely counts as 1, metres.
    distance_m: f32,
}

impl Viewpoint {
    /// The position of `pose`; wall points will be given relative to `origin`.
    pub fn new(pose: &Pose, origin: &Vector3<f64>, distance_m: f64) -> Self {
        Self {
            centre: (pose.t_wc - origin).cast(),
            distance_m: distance_m as f32,
        }
    }

    /// The area that a piece of the wall with this unit normal has in the picture, over that of the
    /// piece seen squarely from the distance that counts as 1: `cos β (distance/d)²` at distance d
    /// and angle β to the normal.
    #[inline]
    pub fn area_share(&self, point: &[f32; 3], normal: &Vector3<f32>) -> f32 {
        let ray = Vector3::from(*point) - self.centre;
        let square = ray.norm_squared();
        ray.dot(normal).abs() * self.distance_m * self.distance_m / (square * square.sqrt())
    }

    /// True if a wall point is seen with at least [`MIN_RESOLVED_SHARE`] of the area.
    #[inline]
    pub fn resolves(&self, point: &[f32; 3], normal: &Vector3<f32>) -> bool {
        is_resolved(self.area_share(point, normal))
    }
}

#[inline]
fn is_resolved(area_share: f32) -> bool {
    area_share > MIN_RESOLVED_SHARE as f32
}

/// Ratio of the areas of pixels at neighbouring levels of a pyramid.
const MAX_AREA_RATIO: f32 = 4.0;

/// True if two pictures, in which a piece of the wall has these shares of the area
/// ([`Viewpoint::area_share`]), show the same detail of it: both resolve it, and neither is more
/// than a pyramid level coarser than the other.
#[inline]
pub fn is_resolved_alike(a: f32, b: f32) -> bool {
    let (less, more) = (a.min(b), a.max(b));
    is_resolved(less) && more < MAX_AREA_RATIO * less
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a pipe of radius 1: beside the camera, and at 45° ahead, `cos 45° (1/√2)²`.
    #[test]
    fn walls_are_smaller_far_along_the_tunnel() {
        let viewpoint = Viewpoint::new(&Pose::identity(), &Vector3::zeros(), 1.0);
        let share = |y: f32| viewpoint.area_share(&[0.0, y, 1.0], &Vector3::z());
        assert!((share(0.0) - 1.0).abs() < 1e-6);
        assert!((share(1.0) - 0.5f32.powf(1.5)).abs() < 1e-6);
        let resolves = |y: f32| viewpoint.resolves(&[0.0, y, 1.0], &Vector3::z());
        assert!(resolves(2.4) && !resolves(2.6));
    }
}
