//! Capsules: cylinders with round ends, the pieces of a cable.

use crate::fittings::ray_hit::{Ray, RayHit};
use nalgebra::Vector3;

/// All points no farther than the radius from the line between two ends.
///
/// The round ends close the gaps between pieces that meet at an angle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Capsule {
    /// The ends of the axis, metres.
    pub ends: [Vector3<f64>; 2],
    /// Radius, metres.
    pub radius_m: f64,
}

impl Capsule {
    /// Intersects a ray that starts outside; `None` if it misses.
    ///
    /// With the axis `b` from end to end and the ray's start `o` from the first end, the cylinder
    /// is `|o + λ d|² b² − (b·(o + λ d))² = r² b²`. If the first of its two solutions lies beyond
    /// an end, the ray can only meet the sphere there, `|o' + λ d| = r`.
    pub fn intersect(&self, ray: &Ray) -> Option<RayHit> {
        let (b, o, d) = (self.ends[1] - self.ends[0], ray.t - self.ends[0], ray.d);
        let (bb, bd, bo) = (b.norm_squared(), b.dot(&d), b.dot(&o));
        let square = bb * d.norm_squared() - bd * bd;
        let linear = bb * o.dot(&d) - bo * bd;
        let radius_squared = self.radius_m * self.radius_m;
        let constant = bb * (o.norm_squared() - radius_squared) - bo * bo;
        let root = linear * linear - square * constant;
        if root < 0.0 {
            return None;
        }
        // A ray along the axis comes from before the first end or from behind the last.
        let lambda = (-linear - root.sqrt()) / square;
        let along = if square > 0.0 { bo + lambda * bd } else { -bd };
        if along > 0.0 && along < bb && square > 0.0 {
            let normal = (o + d * lambda - b * (along / bb)) / self.radius_m;
            return (lambda > 0.0).then_some(RayHit { lambda, normal });
        }
        let from_end = ray.t - self.ends[usize::from(along > 0.0)];
        let (square, linear) = (d.norm_squared(), from_end.dot(&d));
        let root = linear * linear - square * (from_end.norm_squared() - radius_squared);
        let lambda = (-linear - root.sqrt()) / square;
        let normal = (from_end + d * lambda) / self.radius_m;
        (lambda > 0.0).then_some(RayHit { lambda, normal })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CAPSULE: Capsule = Capsule {
        ends: [Vector3::new(0.0, 0.0, 3.0), Vector3::new(0.0, 2.0, 3.0)],
        radius_m: 0.02,
    };

    fn hit(t: [f64; 3], d: [f64; 3]) -> Option<RayHit> {
        CAPSULE.intersect(&Ray {
            t: Vector3::from(t),
            d: Vector3::from(d),
        })
    }

    /// Distances by elementary geometry: the cylinder from across and at an angle, both spheres.
    #[test]
    fn intersections_are_those_of_cylinder_and_spheres() {
        let across = hit([0.0, 1.0, 0.0], [0.0, 0.0, 1.0]).unwrap();
        assert!((across.lambda - 2.98).abs() < 1e-12);
        assert!((across.normal + Vector3::z()).norm() < 1e-9);
        // Half the radius off the axis, with a direction of length 2.
        let aside = hit([0.01, 1.0, 0.0], [0.0, 0.0, 2.0]).unwrap();
        let depth_m = 3.0 - (0.02f64.powi(2) - 0.01f64.powi(2)).sqrt();
        assert!((aside.lambda - 0.5 * depth_m).abs() < 1e-12);
        assert!((aside.normal.x - 0.5).abs() < 1e-9);
        // At 45° along the axis the near side is as far across.
        let slanted = hit([0.0, -1.0, 1.0], [0.0, 1.0, 1.0]).unwrap();
        assert!((slanted.lambda - 1.98).abs() < 1e-12);
        let below = hit([0.0, -0.01, 0.0], [0.0, 0.0, 1.0]).unwrap();
        assert!((below.lambda - depth_m).abs() < 1e-12);
        assert!((below.normal.y + 0.5).abs() < 1e-9);
        let along = hit([0.0, 5.0, 3.0], [0.0, -1.0, 0.0]).unwrap();
        assert!((along.lambda - 2.98).abs() < 1e-12 && (along.normal.y - 1.0).abs() < 1e-9);
    }

    #[test]
    fn rays_beside_beyond_and_away_miss() {
        for (t, d) in [
            ([0.021, 1.0, 0.0], [0.0, 0.0, 1.0]),
            ([0.0, 2.021, 0.0], [0.0, 0.0, 1.0]),
            ([0.0, 1.0, 0.0], [0.0, 0.0, -1.0]),
            ([0.0, 1.0, 2.0], [0.0, 1.0, 0.0]),
            ([0.019, -0.02, 0.0], [0.0, 0.0, 1.0]),
            ([0.0, 1.0, 0.0], [f64::NAN; 3]),
        ] {
            assert_eq!(hit(t, d), None, "{t:?} {d:?}");
        }
    }
}
