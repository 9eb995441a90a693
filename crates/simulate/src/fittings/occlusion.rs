//! Occlusion of the wall by fittings.

use crate::fittings::ray_hit::Ray;
use crate::fittings::solid::Solid;
use crate::lamp_light::PosedLamp;
use crate::options::Illumination;
use nalgebra::Vector3;

/// Maximum angle that is added to the cone of a batch of rays, for lenses whose rays between the
/// corners of the batch lie outside of them; narrow cones are widened to twice their angle.
const MAX_CONE_MARGIN_RAD: f64 = 0.02;

/// The fittings that a frame may show.
pub(crate) struct Occluders {
    occluders: Vec<Occluder>,
}

/// A solid with what does not depend on the ray.
struct Occluder {
    solid: Solid,
    centre: Vector3<f64>,
    /// Radius of the sphere around it, metres.
    reach_m: f64,
    /// Share of the light there.
    light: f32,
}

impl Occluders {
    /// The solids under the given illumination.
    pub fn new(solids: Vec<Solid>, light: Illumination) -> Self {
        let occluder = |solid: Solid| {
            let (centre, reach_m) = solid.bounding_sphere();
            Occluder {
                light: light.shade(centre.x.atan2(centre.z)),
                solid,
                centre,
                reach_m,
            }
        };
        Self {
            occluders: solids.into_iter().map(occluder).collect(),
        }
    }

    /// Those that rays from `t` may meet, whose directions lie between those of `corners`.
    ///
    /// A sphere of radius ρ at the distance D is met within the angle `asin ρ/D` of its centre.
    pub fn towards(&self, t: &Vector3<f64>, corners: [Vector3<f64>; 4]) -> Candidates<'_> {
        Candidates(self.occluders.iter().collect()).towards(t, corners)
    }
}

/// The fittings that a batch of rays may meet.
pub(crate) struct Candidates<'a>(Vec<&'a Occluder>);

impl<'a> Candidates<'a> {
    /// Those of them that rays of a part of the batch may meet, as [`Occluders::towards`].
    pub fn towards(&self, t: &Vector3<f64>, corners: [Vector3<f64>; 4]) -> Candidates<'a> {
        if self.0.is_empty() {
            return Candidates(Vec::new());
        }
        let units = corners.map(|d| d.normalize());
        let axis: Vector3<f64> = units.iter().sum();
        let half = units.iter().map(|d| axis.angle(d)).fold(0.0, f64::max);
        let half = half + half.min(MAX_CONE_MARGIN_RAD);
        // Where a lens shows nothing at a corner, nothing is excluded.
        let is_cone = units.iter().all(|d| d.norm_squared().is_finite());
        let may_meet = |occluder: &&&'a Occluder| {
            let to = occluder.centre - t;
            let sine = (occluder.reach_m / to.norm()).min(1.0);
            !is_cone || axis.angle(&to) <= half + sine.asin() || sine == 1.0
        };
        Candidates(self.0.iter().filter(may_meet).copied().collect())
    }

    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Grey level of the first fitting on the ray from `t` along `d`, if it meets one, in the light
    /// of the camera's lamp, if it has one.
    pub fn grey(&self, t: Vector3<f64>, d: Vector3<f64>, lamp: Option<&PosedLamp>) -> Option<f32> {
        let ray = Ray { t, d };
        let hits = self.0.iter().filter_map(|occluder| {
            let hit = occluder.solid.intersect(&ray)?;
            Some((occluder, hit))
        });
        let (occluder, hit) = hits.min_by(|a, b| a.1.lambda.total_cmp(&b.1.lambda))?;
        let irradiance = |lamp: &PosedLamp| lamp.irradiance(&ray.at(hit.lambda), &hit.normal);
        let light = occluder.light * lamp.map_or(1.0, irradiance) as f32;
        Some(occluder.solid.grey(&ray, &hit, light))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fittings::cuboid::Cuboid;
    use crate::fittings::finish::Finish;
    use nalgebra::Matrix3;

    fn lamp(x_m: f64, z_m: f64) -> Solid {
        let cuboid = Cuboid {
            centre: Vector3::new(x_m, 0.3, z_m),
            axes: Matrix3::identity(),
            half_m: Vector3::new(0.1, 0.4, 0.1),
        };
        let glass = -Vector3::z();
        Solid::cuboid(cuboid, Finish::Lamp { glass })
    }

    #[test]
    fn the_nearest_is_seen() {
        let t = Vector3::zeros();
        let (ahead, aside) = (Vector3::new(0.0, 0.02, 1.0), Vector3::new(0.0, 0.9, 1.0));
        let solids = vec![lamp(0.0, 2.9), Solid::vertical_cable(0.0, 2.5, 0.02)];
        let occluders = Occluders::new(solids, Illumination::Even);
        let candidates = occluders.towards(&t, [ahead; 4]);
        // Metal that faces the camera, before glass.
        let grey = candidates.grey(t, ahead, None).unwrap();
        assert!((115.0..=120.0).contains(&grey), "{grey}");
        let glass = candidates
            .grey(t, Vector3::new(0.02, 0.01, 1.0), None)
            .unwrap();
        assert!(glass > 180.0, "{glass}");
        assert_eq!(candidates.grey(t, Vector3::new(0.3, 0.0, 1.0), None), None);
        assert_eq!(candidates.grey(t, -ahead, None), None);
        assert!(
            occluders
                .towards(&t, [aside; 4])
                .grey(t, aside, None)
                .is_some()
        );
    }

    /// Whatever any ray of a batch meets is among the candidates of the batch.
    #[test]
    fn candidates_are_all_that_rays_meet() {
        let solids = (0..40).map(|k| lamp(0.25 * f64::from(k - 20), 2.0));
        let occluders = Occluders::new(solids.collect(), Illumination::Even);
        let t = Vector3::new(0.1, 0.3, 0.2);
        let mut fewest = usize::MAX;
        for k in 0..60 {
            let left = -2.0 + f64::from(k) / 15.0;
            let corner = |x: f64, y: f64| Vector3::new(x, y, 1.0);
            let corners = [(0.0, 0.0), (0.1, 0.0), (0.0, 0.01), (0.1, 0.01)];
            let corners = corners.map(|(right, down)| corner(left + right, down));
            let candidates = occluders.towards(&t, corners);
            let all = Candidates(occluders.occluders.iter().collect());
            for step in 0..50 {
                let d = corner(left + 0.002 * f64::from(step), 0.005);
                assert_eq!(candidates.grey(t, d, None), all.grey(t, d, None));
            }
            fewest = fewest.min(candidates.0.len());
        }
        assert!(fewest < 40);
        let unseen = occluders.towards(&t, [Vector3::repeat(f64::NAN); 4]);
        assert_eq!(unseen.0.len(), 40);
    }
}
