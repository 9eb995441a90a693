//! Places of all cables and lamps of a tunnel.

use crate::error::{SimulateError, check_option};
use crate::fittings::cable::Cable;
use crate::fittings::fitting_options::Fittings;
use crate::fittings::lamp_row::LampRow;
use crate::fittings::solid::Solid;
use crate::procedural_noise::RandomStream;
use crate::tunnel::Tunnel;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;

/// Smallest distance of the wall from the axis, metres: fittings are of the size of real ones.
const MIN_WALL_DISTANCE_M: f64 = 0.8;

/// All cables and lamps of a tunnel.
#[derive(Clone, Debug, Default)]
pub(crate) struct FittingLayout {
    cables: Vec<Cable>,
    lamp_rows: Vec<LampRow>,
}

impl FittingLayout {
    /// Draws cables and rows of lamps, each kind evenly around the section but for a random part.
    ///
    /// # Errors
    /// [`SimulateError::Option`] for fittings in a tunnel that is narrow or curved.
    pub fn new(options: &Fittings, seed: u64, tunnel: &Tunnel) -> Result<Self, SimulateError> {
        if options.is_empty() {
            return Ok(Self::default());
        }
        check_option(
            tunnel.is_straight() && tunnel.nearest_m() >= MIN_WALL_DISTANCE_M,
            "cables and lamps need a straight tunnel with walls at least 0.8 m from the axis",
        )?;
        let mut rng = ChaCha8Rng::seed_from_u64(RandomStream::Fittings.seed(seed));
        let around = |rng: &mut ChaCha8Rng, count: u32| -> Vec<f64> {
            let start = rng.random_range(0.0..1.0);
            let angle = |k: u32| f64::from(k) + start + rng.random_range(-0.3..0.3);
            (0..count)
                .map(angle)
                .map(|part| TAU * part / f64::from(count))
                .collect()
        };
        let cable_angles = around(&mut rng, options.cables);
        let cables = cable_angles.into_iter();
        let cables = cables.map(|angle| Cable::random(&mut rng, angle)).collect();
        let lamp_angles = around(&mut rng, options.lamps).into_iter();
        let spacing_m = options.lamp_spacing_m;
        let lamp_rows = lamp_angles
            .map(|angle| LampRow::random(&mut rng, angle, spacing_m))
            .collect();
        Ok(Self { cables, lamp_rows })
    }

    /// The solids from chainage `h_m[0]` to `h_m[1]`, metres.
    pub fn solids(&self, tunnel: &Tunnel, h_m: [f64; 2]) -> Vec<Solid> {
        let mut solids = Vec::new();
        for cable in &self.cables {
            cable.add_solids(tunnel, h_m, &mut solids);
        }
        for lamps in &self.lamp_rows {
            lamps.add_solids(tunnel, h_m, &mut solids);
        }
        solids
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::options::SimulateOptions;
    use tunnelstitch_core::survey::{Shape, TunnelSection};

    const SOME: Fittings = Fittings {
        cables: 5,
        lamps: 2,
        lamp_spacing_m: 3.0,
    };

    fn tunnel(section: TunnelSection) -> Tunnel {
        let options = SimulateOptions {
            tunnel: section,
            ..SimulateOptions::free()
        };
        Tunnel::new(&options).unwrap()
    }

    #[test]
    fn fittings_stand_inside_round_and_square_tunnels() {
        let square = TunnelSection {
            shape: Shape::Box,
            radius_m: None,
            width_m: Some(5.0),
            height_m: Some(4.0),
            ..TunnelSection::round(1.0)
        };
        for section in [TunnelSection::round(3.0), square] {
            let tunnel = tunnel(section);
            for seed in 0..20 {
                let layout = FittingLayout::new(&SOME, seed, &tunnel).unwrap();
                let solids = layout.solids(&tunnel, [-3.0, 3.0]);
                // Four spans of five cables, eight pieces and a bracket each; two rows of lamps.
                assert!(solids.len() >= 4 * 5 * 9 + 2 * 2, "{}", solids.len());
                for (centre, _) in solids.iter().map(Solid::bounding_sphere) {
                    assert!((0.8..1.0).contains(&tunnel.radial_position(&centre).0));
                }
            }
        }
    }

    #[test]
    fn the_seed_decides_where_they_are_and_the_stretch_does_not() {
        let tunnel = tunnel(TunnelSection::round(3.0));
        let solids = |seed: u64, h_m: [f64; 2]| {
            let layout = FittingLayout::new(&SOME, seed, &tunnel).unwrap();
            let solids = layout.solids(&tunnel, h_m);
            let text = solids.iter().map(|solid| format!("{solid:?}"));
            text.collect::<Vec<String>>()
        };
        let (short, long) = (solids(1, [0.0, 2.0]), solids(1, [-5.0, 9.0]));
        assert!(short.iter().all(|solid| long.contains(solid)));
        assert!(solids(2, [0.0, 2.0]) != short);
    }

    #[test]
    fn narrow_tunnels_have_no_room() {
        let narrow = tunnel(TunnelSection::round(0.5));
        assert!(FittingLayout::new(&SOME, 1, &narrow).is_err());
        assert!(FittingLayout::new(&Fittings::default(), 1, &narrow).is_ok());
    }
}
