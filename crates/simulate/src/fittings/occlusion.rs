//! Occlusion of the wall by fittings.

use crate::fittings::ray_hit::Ray;
use crate::fittings::solid::Solid;
use crate::options::Illumination;
use nalgebra::Vector3;

/// Angle that is added to the cone of a batch of rays, for lenses whose rays between the corners of
/// the batch lie outside of them.
const CONE_MARGIN_RAD: f64 = 0.02;

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
        if self.occluders.is_empty() {
            return Candidates(Vec::new());
        }
        let units = corners.map(|d| d.normalize());
        let axis: Vector3<f64> = units.iter().sum();
        let half = units.iter().map(|d| axis.angle(d)).fold(0.0, f64::max) + CONE_MARGIN_RAD;
        // Where a lens shows nothing at a corner, nothing is excluded.
        let is_cone = units.iter().all(|d| d.norm_squared().is_finite());
        let may_meet = |occluder: &&Occluder| {
            let to = occluder.centre - t;
            let sine = (occluder.reach_m / to.norm()).min(1.0);
            !is_cone || axis.angle(&to) <= half + sine.asin() || sine == 1.0
        };
        Candidates(self.occluders.iter().filter(may_meet).collect())
    }
}

/// The fittings that a batch of rays may meet.
pub(crate) struct Candidates<'a>(Vec<&'a Occluder>);

impl Candidates<'_> {
    /// True if there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Grey level of the first fitting on the ray from `t` along `d`, if it meets one.
    pub fn grey(&self, t: Vector3<f64>, d: Vector3<f64>) -> Option<f32> {
        let ray = Ray { t, d };
        let hits = self.0.iter().filter_map(|occluder| {
            let hit = occluder.solid.intersect(&ray)?;
            Some((occluder, hit))
        });
        let (occluder, hit) = hits.min_by(|a, b| a.1.lambda.total_cmp(&b.1.lambda))?;
        Some(occluder.solid.grey(&ray, &hit, occluder.light))
    }
}
