//! Fog: the end of sight of a camera that looks along the tunnel.

use crate::tunnel::Tunnel;
use std::f64::consts::TAU;

/// Maximum distance of wall from the camera along the tunnel, radii.
const MAX_SIGHT_RADII: f64 = 60.0;
/// Share of that distance up to which the air is clear.
const CLEAR_SHARE: f64 = 0.5;
/// Grey level of the fog.
const FOG_GREY: f64 = 4.0;

/// Dark fog that begins at half of the distance of sight and hides all beyond it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Fog {
    /// Distance of sight along the tunnel, metres.
    pub reach_m: f64,
}

impl Fog {
    /// The fog of a tunnel, by its mean radius.
    pub fn new(tunnel: &Tunnel) -> Self {
        Self {
            reach_m: MAX_SIGHT_RADII * tunnel.perimeter_m() / TAU,
        }
    }

    /// Share of the light that arrives from a distance along the tunnel (metres), and the grey
    /// level that the fog adds to it.
    pub fn at(&self, distance_m: f64) -> [f64; 2] {
        let into = distance_m / self.reach_m - CLEAR_SHARE;
        let t = (into / (1.0 - CLEAR_SHARE)).clamp(0.0, 1.0);
        let share = 1.0 - t * t * (3.0 - 2.0 * t);
        [share, FOG_GREY * (1.0 - share)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_wall_fades_into_dark_fog() {
        let fog = Fog::new(&Tunnel::Round(2.0));
        assert!((fog.reach_m - 120.0).abs() < 1e-9);
        assert_eq!(fog.at(59.0), [1.0, 0.0]);
        assert_eq!(fog.at(120.0), [0.0, FOG_GREY]);
        assert_eq!(fog.at(1e9), [0.0, FOG_GREY]);
        let [share, added] = fog.at(90.0);
        assert!((share - 0.5).abs() < 1e-9 && (added - 2.0).abs() < 1e-9);
    }
}
