//! Planned stations of the carrier.

use crate::trajectory::pose::Pose;
use crate::trajectory::so3;
use nalgebra::Vector3;

/// The carrier's planned position, and its rotation about the tunnel's axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Station {
    /// Chainage, metres.
    pub chainage_m: f64,
    /// Angle θ of the carrier's z axis about the tunnel's, radians; not confined to one turn.
    pub angle_rad: f64,
    /// Offset from the axis along the world's x and z, metres.
    pub offset_m: [f64; 2],
}

impl Station {
    /// The pose of the carrier in the tunnel: its y axis along the tunnel's, its z axis towards θ.
    ///
    /// `R = [[c, 0, s], [0, 1, 0], [−s, 0, c]]` with `c, s` of the angle: a positive rotation moves
    /// the view towards larger θ.
    pub fn carrier(&self) -> Pose {
        let [x_m, z_m] = self.offset_m;
        Pose::new(
            so3::exp(&Vector3::new(0.0, self.angle_rad, 0.0)),
            Vector3::new(x_m, self.chainage_m, z_m),
        )
    }

    /// Interpolates linearly to another station, each number separately, so that full turns count.
    pub fn towards(&self, other: &Self, share: f64) -> Self {
        let between = |from: f64, to: f64| from + share * (to - from);
        Self {
            chainage_m: between(self.chainage_m, other.chainage_m),
            angle_rad: between(self.angle_rad, other.angle_rad),
            offset_m: [0, 1].map(|k| between(self.offset_m[k], other.offset_m[k])),
        }
    }
}

/// A spiral of `count` poses on the axis of the tunnel: pose k is at chainage `k · advance_m`
/// (metres), rotated by `k · turn_rad` about the axis. The camera coincides with the carrier.
pub fn spiral(count: usize, advance_m: f64, turn_rad: f64) -> Vec<Pose> {
    let station = |k: usize| Station {
        chainage_m: k as f64 * advance_m,
        angle_rad: k as f64 * turn_rad,
        offset_m: [0.0; 2],
    };
    (0..count).map(|k| station(k).carrier()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_view_turns_towards_larger_theta() {
        let poses = spiral(4, 0.1, 30f64.to_radians());
        let ahead = poses[1].r_wc * Vector3::z();
        assert!((ahead.x.atan2(ahead.z) - 30f64.to_radians()).abs() < 1e-12);
        assert!((poses[3].t_wc - Vector3::new(0.0, 0.3, 0.0)).norm() < 1e-12);
    }
}
