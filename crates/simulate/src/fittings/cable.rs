//! A cable on brackets, between which it sags.

use crate::fittings::capsule::Capsule;
use crate::fittings::cuboid::Cuboid;
use crate::fittings::finish::Finish;
use crate::fittings::solid::Solid;
use crate::procedural_noise::{ValueNoise, derived_seed};
use crate::tunnel::Tunnel;
use nalgebra::{Matrix3, Vector3};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

/// Distance between brackets, metres.
const BRACKET_SPACING_M: f64 = 1.5;
/// Length of a bracket along the tunnel, metres.
const BRACKET_LENGTH_M: f64 = 0.03;
/// Length of a bracket beyond the cable, to the sides and inwards, metres.
const BRACKET_RIM_M: f64 = 0.01;
/// Straight pieces from bracket to bracket.
const PIECES: i64 = 8;
/// Range of the radius, metres.
const RADIUS_M: [f64; 2] = [0.01, 0.025];
/// Range of the distance of its axis from the wall at the brackets, metres.
const CLEARANCE_M: [f64; 2] = [0.07, 0.12];
/// Range of the sag in the middle between brackets, metres.
const SAG_M: [f64; 2] = [0.005, 0.02];
/// Range of the grey level.
const TONES: [f32; 2] = [25.0, 110.0];
/// Amplitude (grey levels) and cell size (metres) of the scratches.
const SCRATCHES: (f32, f64) = (12.0, 0.015);

/// A cable along all of the tunnel.
///
/// Between the brackets P_i and P_{i+1}, which stand `clearance` before the wall, its axis is
/// `P_i + τ (P_{i+1} − P_i) − 4 sag τ (1 − τ) e_z` for τ from 0 to 1: it hangs down, which is away
/// from θ = 0.
#[derive(Clone, Debug)]
pub(super) struct Cable {
    /// Direction from the axis of the tunnel.
    angle: f64,
    radius_m: f64,
    clearance_m: f64,
    sag_m: f64,
    /// Chainage of a bracket, metres.
    first_m: f64,
    finish: Finish,
}

impl Cable {
    /// Draws a cable in the given direction from the axis.
    pub fn random(rng: &mut ChaCha8Rng, angle: f64) -> Self {
        let mut within = |range: [f64; 2]| rng.random_range(range[0]..range[1]);
        let (radius_m, clearance_m, sag_m) = (within(RADIUS_M), within(CLEARANCE_M), within(SAG_M));
        let first_m = within([0.0, BRACKET_SPACING_M]);
        let (amplitude, cell_m) = SCRATCHES;
        let seed = derived_seed(rng.random(), 0);
        Self {
            angle,
            radius_m,
            clearance_m,
            sag_m,
            first_m,
            finish: Finish::Cable {
                tone: rng.random_range(TONES[0]..TONES[1]),
                scratches: ValueNoise::unique(seed, amplitude, cell_m, 1.0),
            },
        }
    }

    /// Adds the pieces and brackets from chainage `h_m[0]` to `h_m[1]`, metres.
    pub fn add_solids(&self, tunnel: &Tunnel, h_m: [f64; 2], solids: &mut Vec<Solid>) {
        let span = |h_m: f64| ((h_m - self.first_m) / BRACKET_SPACING_M).floor() as i64;
        for i in span(h_m[0])..=span(h_m[1]) {
            solids.push(self.bracket(tunnel, i));
            let nodes: Vec<_> = (0..=PIECES).map(|k| self.axis(tunnel, i, k)).collect();
            solids.extend(nodes.windows(2).map(|ends| {
                let capsule = Capsule {
                    ends: [ends[0], ends[1]],
                    radius_m: self.radius_m,
                };
                Solid::capsule(capsule, self.finish)
            }));
        }
    }

    /// Direction from the axis of the tunnel, as a unit vector.
    fn outwards(&self) -> Vector3<f64> {
        Vector3::new(self.angle.sin(), 0.0, self.angle.cos())
    }

    /// Chainage of a bracket, and the distance of the wall from the tunnel's axis there, metres.
    fn wall_at_bracket(&self, tunnel: &Tunnel, bracket: i64) -> (f64, f64) {
        let h_m = self.first_m + bracket as f64 * BRACKET_SPACING_M;
        (h_m, tunnel.wall_distance_m(self.angle, h_m))
    }

    /// Node k (0 to [`PIECES`]) of the axis after a bracket.
    fn axis(&self, tunnel: &Tunnel, bracket: i64, k: i64) -> Vector3<f64> {
        let [from, to] = [bracket, bracket + 1].map(|bracket| {
            let (h_m, wall_m) = self.wall_at_bracket(tunnel, bracket);
            self.outwards() * (wall_m - self.clearance_m) + Vector3::y() * h_m
        });
        let tau = k as f64 / PIECES as f64;
        let sag_m = 4.0 * self.sag_m * tau * (1.0 - tau);
        from + (to - from) * tau - Vector3::z() * sag_m
    }

    /// A bracket, from the wall over the cable.
    fn bracket(&self, tunnel: &Tunnel, bracket: i64) -> Solid {
        let (h_m, wall_m) = self.wall_at_bracket(tunnel, bracket);
        let outwards = self.outwards();
        let depth_m = self.clearance_m + self.radius_m + BRACKET_RIM_M;
        let cuboid = Cuboid {
            centre: outwards * (wall_m - 0.5 * depth_m) + Vector3::y() * h_m,
            axes: Matrix3::from_columns(&[outwards.cross(&Vector3::y()), Vector3::y(), outwards]),
            half_m: Vector3::new(
                self.radius_m + BRACKET_RIM_M,
                0.5 * BRACKET_LENGTH_M,
                0.5 * depth_m,
            ),
        };
        Solid::cuboid(cuboid, Finish::Metal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    /// Held at the brackets, lowest in the middle between them, without gaps.
    #[test]
    fn a_cable_hangs_between_its_brackets() {
        let tunnel = Tunnel::Round(3.0);
        let cable = Cable::random(&mut ChaCha8Rng::seed_from_u64(1), 1.5);
        let node = |k: i64| cable.axis(&tunnel, 2, k);
        let held_m = 3.0 - cable.clearance_m;
        for end in [0, PIECES] {
            assert!((node(end).xz().norm() - held_m).abs() < 1e-12);
        }
        assert_eq!(node(PIECES), cable.axis(&tunnel, 3, 0));
        let sags_m: Vec<f64> = (0..=PIECES).map(|k| node(0).z - node(k).z).collect();
        let middle = PIECES as usize / 2;
        assert!((sags_m[middle] - cable.sag_m).abs() < 1e-12);
        assert!(sags_m[..=middle].is_sorted() && sags_m[middle..].is_sorted_by(|a, b| a >= b));
    }
}
