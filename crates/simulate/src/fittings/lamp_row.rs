//! A row of lamps along the tunnel.

use crate::fittings::cuboid::Cuboid;
use crate::fittings::finish::Finish;
use crate::fittings::solid::Solid;
use crate::tunnel::Tunnel;
use nalgebra::{Matrix3, Vector3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Width, length along the tunnel, and depth of a lamp, metres.
const SIZE_M: [f64; 3] = [0.14, 0.6, 0.08];
/// Distance between a lamp and the wall, metres.
const GAP_M: f64 = 0.03;

/// Equal lamps at equal distances.
#[derive(Clone, Debug)]
pub(super) struct LampRow {
    /// Direction from the axis of the tunnel.
    angle: f64,
    spacing_m: f64,
    /// Chainage of the middle of a lamp, metres.
    first_m: f64,
}

impl LampRow {
    /// Draws a row of lamps `spacing_m` apart in the given direction from the axis.
    pub fn random(rng: &mut ChaCha8Rng, angle: f64, spacing_m: f64) -> Self {
        Self {
            angle,
            spacing_m,
            first_m: rng.random_range(0.0..spacing_m),
        }
    }

    /// Adds the lamps from chainage `h_m[0]` to `h_m[1]`, metres.
    pub fn add_solids(&self, tunnel: &Tunnel, h_m: [f64; 2], solids: &mut Vec<Solid>) {
        let lamp = |h_m: f64| ((h_m - self.first_m) / self.spacing_m).round() as i64;
        for i in lamp(h_m[0])..=lamp(h_m[1]) {
            let h_m = self.first_m + i as f64 * self.spacing_m;
            let outwards = Vector3::new(self.angle.sin(), 0.0, self.angle.cos());
            let wall_m = tunnel.wall_distance_m(self.angle, h_m);
            let axes = [outwards.cross(&Vector3::y()), Vector3::y(), outwards];
            let cuboid = Cuboid {
                centre: outwards * (wall_m - GAP_M - 0.5 * SIZE_M[2]) + Vector3::y() * h_m,
                axes: Matrix3::from_columns(&axes),
                half_m: Vector3::from(SIZE_M) * 0.5,
            };
            solids.push(Solid::cuboid(cuboid, Finish::Lamp { glass: -outwards }));
        }
    }
}
