//! Solids: shape, finish and place of a piece of a fitting.

use crate::fittings::capsule::Capsule;
use crate::fittings::cuboid::Cuboid;
use crate::fittings::finish::Finish;
use crate::fittings::ray_hit::{Ray, RayHit};
use nalgebra::Vector3;

/// Piece of a fitting.
#[derive(Clone, Debug)]
pub(crate) struct Solid {
    shape: SolidShape,
    finish: Finish,
}

#[derive(Clone, Copy, Debug)]
enum SolidShape {
    Capsule(Capsule),
    Cuboid(Cuboid),
}

impl Solid {
    /// A capsule with its finish.
    pub(super) fn capsule(capsule: Capsule, finish: Finish) -> Self {
        Self {
            shape: SolidShape::Capsule(capsule),
            finish,
        }
    }

    /// A cuboid with its finish.
    pub(super) fn cuboid(cuboid: Cuboid, finish: Finish) -> Self {
        Self {
            shape: SolidShape::Cuboid(cuboid),
            finish,
        }
    }

    /// Centre and radius of a sphere around the solid, metres.
    pub fn bounding_sphere(&self) -> (Vector3<f64>, f64) {
        match &self.shape {
            SolidShape::Capsule(Capsule { ends, radius_m }) => {
                let [from, to] = ends;
                ((from + to) * 0.5, (to - from).norm() * 0.5 + radius_m)
            }
            SolidShape::Cuboid(cuboid) => (cuboid.centre, cuboid.half_m.norm()),
        }
    }

    /// Intersects a ray that starts outside; `None` if it misses.
    pub fn intersect(&self, ray: &Ray) -> Option<RayHit> {
        match &self.shape {
            SolidShape::Capsule(capsule) => capsule.intersect(ray),
            SolidShape::Cuboid(cuboid) => cuboid.intersect(ray),
        }
    }

    /// Grey level where a ray meets the solid and the wall has the share `light` of the light.
    pub fn grey(&self, ray: &Ray, hit: &RayHit, light: f32) -> f32 {
        let to_camera = -ray.d.normalize();
        self.finish
            .grey(&ray.at(hit.lambda), &hit.normal, &to_camera, light)
    }

    /// A metal cable along y, for tests.
    #[cfg(test)]
    pub fn vertical_cable(x_m: f64, z_m: f64, radius_m: f64) -> Self {
        let ends = [-5.0, 5.0].map(|y_m| Vector3::new(x_m, y_m, z_m));
        Self::capsule(Capsule { ends, radius_m }, Finish::Metal)
    }
}
