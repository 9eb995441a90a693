//! The plan: what the carrier was told to do.

use super::{Pose, so3};
use nalgebra::Vector3;

/// `count` poses on the axis of the tunnel: step k stands at chainage `k · advance_m` (metres), turned by
/// `k · turn_rad` about the axis.
///
/// `R_k = [[c, 0, s], [0, 1, 0], [−s, 0, c]]` with `c, s` of `k · turn_rad`: a positive turn moves the view
/// towards larger θ.
pub fn spiral(count: usize, advance_m: f64, turn_rad: f64) -> Vec<Pose> {
    (0..count)
        .map(|k| {
            Pose::new(
                so3::exp(&Vector3::new(0.0, k as f64 * turn_rad, 0.0)),
                Vector3::new(0.0, k as f64 * advance_m, 0.0),
            )
        })
        .collect()
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
