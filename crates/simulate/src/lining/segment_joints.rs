//! Joints of segments: dark lines over any texture.

use crate::lining::segments::SegmentRings;
use crate::texture::wall_texture::WallTexture;
use std::f64::consts::TAU;

/// Grey level of a joint.
const JOINT_GREY: f32 = 35.0;

/// A texture with the joints of segments over it.
pub(crate) struct JointedWall {
    texture: Box<dyn WallTexture>,
    rings: SegmentRings,
}

impl JointedWall {
    /// The texture with the joints of the rings.
    pub fn new(texture: Box<dyn WallTexture>, rings: SegmentRings) -> Self {
        Self { texture, rings }
    }
}

impl WallTexture for JointedWall {
    fn fill_row(&self, h_m: f64, texel_m: f64, row: &mut [f32]) {
        self.texture.fill_row(h_m, texel_m, row);
        let joint_m = self.rings.joint_m();
        let length_m = self.rings.ring_length_m();
        // Distance from the nearest joint between rings.
        let across_m = h_m - (h_m / length_m).round() * length_m;
        let across = joint_share(across_m, joint_m, texel_m);
        row.iter_mut().for_each(|value| darken(value, across));
        let columns = row.len() as i64;
        for theta in self.rings.joint_angles(self.rings.ring_at(h_m)) {
            let centre = theta / TAU * columns as f64;
            let reach = 0.5 * joint_m / texel_m + 1.0;
            for column in (centre - reach).floor() as i64..=(centre + reach).ceil() as i64 {
                let aside_m = (column as f64 + 0.5 - centre) * texel_m;
                let share = joint_share(aside_m, joint_m, texel_m);
                darken(&mut row[column.rem_euclid(columns) as usize], share);
            }
        }
    }
}

/// Blends a grey level with that of a joint that covers a share of the texel.
fn darken(value: &mut f32, share: f32) {
    *value += share * (JOINT_GREY - *value);
}

/// Share of a texel of size `texel_m` at the distance `x_m` from the middle of a joint that the
/// joint covers.
fn joint_share(x_m: f64, joint_m: f64, texel_m: f64) -> f32 {
    let from = (x_m - 0.5 * texel_m).max(-0.5 * joint_m);
    let to = (x_m + 0.5 * texel_m).min(0.5 * joint_m);
    ((to - from).max(0.0) / texel_m) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::as_built::Segments;

    struct White;

    impl WallTexture for White {
        fn fill_row(&self, _: f64, _: f64, row: &mut [f32]) {
            row.fill(JOINT_GREY + 100.0);
        }
    }

    /// Six joints of 8 mm around, also across θ = 0, and one a ring, whatever the texels.
    #[test]
    fn joints_have_their_width_and_places() {
        let segments = Segments {
            count: 6,
            ring_length_m: 1.5,
            step_mm: 3.0,
            joint_mm: 8.0,
        };
        let wall = JointedWall::new(Box::new(White), SegmentRings::new(segments, 1));
        let perimeter_m = TAU * 3.0;
        for columns in [2000, 7001] {
            let texel_m = perimeter_m / columns as f64;
            let row = |h_m: f64| {
                let mut row = vec![0.0; columns];
                wall.fill_row(h_m, texel_m, &mut row);
                row
            };
            let dark_m = |row: &[f32]| {
                let dark = row.iter().map(|v| 1.0 - (f64::from(*v) - 35.0) / 100.0);
                dark.sum::<f64>() * texel_m
            };
            for h_m in [0.7, 2.0, -0.4] {
                assert!((dark_m(&row(h_m)) - 6.0 * 0.008).abs() < 1e-5);
            }
            let (even, odd) = (row(0.7), row(2.0));
            assert!(even[0] < 135.0 && even[columns - 1] < 135.0 && odd[0] == 135.0);
            let middle = columns / 12;
            assert!(odd[middle - 1..=middle + 1].iter().any(|v| *v < 135.0));
            // Where no joint within a ring is, the one between rings.
            let along = (0..(1.0 / texel_m) as usize).map(|k| 1.0 + k as f64 * texel_m);
            let dark = along.map(|h_m| 1.35 - 0.01 * f64::from(row(h_m)[columns / 24]));
            assert!((dark.sum::<f64>() * texel_m - 0.008).abs() < 1e-5);
        }
    }
}
