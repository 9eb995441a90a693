//! Cuboids: lamps and brackets.

use crate::fittings::ray_hit::{Ray, RayHit};
use nalgebra::{Matrix3, Vector3};

/// A box with edges along the columns of a rotation.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cuboid {
    /// Centre, metres.
    pub centre: Vector3<f64>,
    /// Unit directions of the edges.
    pub axes: Matrix3<f64>,
    /// Half the length of the edges, metres.
    pub half_m: Vector3<f64>,
}

impl Cuboid {
    /// Intersects a ray that starts outside; `None` if it misses.
    ///
    /// The ray is in the box while it is between all three pairs of faces,
    /// `−a_k ≤ o_k + λ d_k ≤ a_k`.
    pub fn intersect(&self, ray: &Ray) -> Option<RayHit> {
        let o = self.axes.tr_mul(&(ray.t - self.centre));
        let d = self.axes.tr_mul(&ray.d);
        let (mut enters, mut leaves, mut face) = (0.0, f64::INFINITY, None);
        for k in 0..3 {
            if d[k] == 0.0 {
                if o[k].abs() > self.half_m[k] {
                    return None;
                }
                continue;
            }
            let side = -d[k].signum();
            let near = (side * self.half_m[k] - o[k]) / d[k];
            let far = (-side * self.half_m[k] - o[k]) / d[k];
            if near > enters {
                (enters, face) = (near, Some(self.axes.column(k) * side));
            }
            leaves = far.min(leaves);
        }
        let normal = face.filter(|_| enters <= leaves)?;
        Some(RayHit {
            lambda: enters,
            normal,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box of 0.2 × 0.4 × 0.6 m, turned about y.
    fn cuboid(turn: f64) -> Cuboid {
        Cuboid {
            centre: Vector3::new(0.0, 1.0, 3.0),
            axes: *nalgebra::Rotation3::from_axis_angle(&Vector3::y_axis(), turn).matrix(),
            half_m: Vector3::new(0.1, 0.2, 0.3),
        }
    }

    fn hit(turn: f64, t: [f64; 3], d: [f64; 3]) -> Option<RayHit> {
        cuboid(turn).intersect(&Ray {
            t: Vector3::from(t),
            d: Vector3::from(d),
        })
    }

    #[test]
    fn intersections_are_those_of_the_faces() {
        let front = hit(0.0, [0.05, 1.1, 0.0], [0.0, 0.0, 2.0]).unwrap();
        assert!((front.lambda - 1.35).abs() < 1e-12 && front.normal == -Vector3::z());
        // From the side at 45°: the face x = 0.1 at z = 3.
        let side = hit(0.0, [1.1, 1.0, 2.0], [-1.0, 0.0, 1.0]).unwrap();
        assert!((side.lambda - 1.0).abs() < 1e-12 && side.normal == Vector3::x());
        let below = hit(0.0, [0.0, -1.0, 3.0], [0.0, 1.0, 0.0]).unwrap();
        assert!((below.lambda - 1.8).abs() < 1e-12 && below.normal == -Vector3::y());
        // Turned by 90°, its side of 0.2 m is along z.
        let turned = hit(
            0.25 * std::f64::consts::TAU,
            [0.25, 1.0, 0.0],
            [0.0, 0.0, 1.0],
        );
        assert!((turned.unwrap().lambda - 2.9).abs() < 1e-12);
        // Turned by 45°, its long side is the plane x = z − 3 + 0.1 √2.
        let aside = [0.1 * 2f64.sqrt(), 1.0, 0.0];
        let side = hit(0.125 * std::f64::consts::TAU, aside, [0.0, 0.0, 1.0]);
        assert!((side.unwrap().lambda - 3.0).abs() < 1e-12);
    }

    #[test]
    fn rays_beside_and_away_miss() {
        for (t, d) in [
            ([0.11, 1.0, 0.0], [0.0, 0.0, 1.0]),
            ([0.0, 1.21, 0.0], [0.0, 0.0, 1.0]),
            ([0.0, 1.0, 0.0], [0.0, 0.0, -1.0]),
            ([0.6, 1.0, 2.0], [-0.3, 0.0, 1.0]),
            ([0.0, 1.0, 0.0], [f64::NAN; 3]),
        ] {
            assert_eq!(hit(0.0, t, d), None, "{t:?} {d:?}");
        }
    }
}
