//! Brick texture: bricks in running bond.

use crate::procedural_noise::{ValueNoise, derived_seed, uniform};
use crate::texture::wall_texture::WallTexture;

/// Nominal length of a brick with its joint, metres; adjusted to the perimeter.
const PITCH_S_M: f64 = 0.225;
/// Height of a course with its joint, metres.
const PITCH_H_M: f64 = 0.075;
/// Width of the joints, metres.
const JOINT_M: f64 = 0.010;
/// Grey level of the mortar.
const MORTAR: f32 = 200.0;
/// Range of the bricks' grey levels.
const TONES: [f32; 2] = [90.0, 170.0];
/// Grain: amplitude (grey levels) and cell size (metres) of each octave.
const GRAIN: [(f32, f64); 3] = [(8.0, 0.050), (8.0, 0.012), (6.0, 0.004)];
/// Bricks per course and courses of a repeating tile.
const TILE: [i64; 2] = [8, 6];

/// Bricks in running bond: every other course is shifted by half a brick.
pub(super) struct BrickWall {
    seed: u64,
    /// Length of a brick with its joint, metres.
    pitch_s_m: f64,
    /// Period of the tones along s, bricks: at most once around.
    period_s: i64,
    /// Period of the tones along h, courses, if they repeat.
    period_h: Option<i64>,
    grain: Vec<ValueNoise>,
}

impl BrickWall {
    /// A wall without repetition: every brick has its own tone.
    pub fn unique(seed: u64, perimeter_m: f64) -> Self {
        let bricks = (perimeter_m / PITCH_S_M).round().max(1.0);
        Self::new(seed, perimeter_m / bricks, bricks as i64, None)
    }

    /// A wall of repeated tiles of [`TILE`] bricks.
    pub fn tiled(seed: u64, perimeter_m: f64) -> Self {
        let tile_m = TILE[0] as f64 * PITCH_S_M;
        let tiles = (perimeter_m / tile_m).round().max(1.0);
        let pitch_s_m = perimeter_m / tiles / TILE[0] as f64;
        Self::new(seed, pitch_s_m, TILE[0], Some(TILE[1]))
    }

    fn new(seed: u64, pitch_s_m: f64, period_s: i64, period_h: Option<i64>) -> Self {
        let repeat_m = pitch_s_m * period_s as f64;
        let grain = (1..).zip(GRAIN).map(|(purpose, (amplitude, cell_m))| {
            let seed = derived_seed(seed, purpose);
            let noise = ValueNoise::unique(seed, amplitude, cell_m, repeat_m);
            match period_h {
                Some(courses) => noise.repeating(courses as f64 * PITCH_H_M),
                None => noise,
            }
        });
        Self {
            seed: derived_seed(seed, 0),
            pitch_s_m,
            period_s,
            period_h,
            grain: grain.collect(),
        }
    }
}

impl WallTexture for BrickWall {
    fn fill_row(&self, h_m: f64, texel_m: f64, row: &mut [f32]) {
        let course = (h_m / PITCH_H_M).floor();
        let across = share_of_brick(h_m - course * PITCH_H_M, PITCH_H_M, texel_m);
        let course = course as i64;
        let shift = 0.5 * (course.rem_euclid(2)) as f64;
        let course = self.period_h.map_or(course, |p| course.rem_euclid(p));
        for (k, value) in row.iter_mut().enumerate() {
            let x = (k as f64 + 0.5) * texel_m / self.pitch_s_m + shift;
            let brick = x.floor();
            let along = share_of_brick((x - brick) * self.pitch_s_m, self.pitch_s_m, texel_m);
            let brick = (brick as i64).rem_euclid(self.period_s);
            let tone = TONES[0] + (TONES[1] - TONES[0]) * uniform(self.seed, brick, course);
            *value = MORTAR + (tone - MORTAR) * along * across;
        }
        for grain in &self.grain {
            grain.add_to_row(h_m, texel_m, row);
        }
    }
}

/// Share of the interval of `width` around `x` that is brick, in a cell of length `pitch`.
///
/// The cell has half a joint at either end. Exact while `width` does not exceed the joint.
fn share_of_brick(x: f64, pitch: f64, width: f64) -> f32 {
    let from = (x - 0.5 * width).max(0.5 * JOINT_M);
    let to = (x + 0.5 * width).min(pitch - 0.5 * JOINT_M);
    ((to - from).max(0.0) / width) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    const PERIMETER_M: f64 = TAU * 3.0;

    fn row(wall: &BrickWall, h_m: f64) -> Vec<f32> {
        let mut row = vec![0.0; 6000];
        wall.fill_row(h_m, PERIMETER_M / 6000.0, &mut row);
        row
    }

    fn rms_difference(a: &[f32], b: &[f32]) -> f64 {
        let squares: f64 = a.iter().zip(b).map(|(a, b)| f64::from(a - b).powi(2)).sum();
        (squares / a.len() as f64).sqrt()
    }

    #[test]
    fn no_two_patches_are_alike() {
        let wall = BrickWall::unique(1, PERIMETER_M);
        let first = row(&wall, 0.03);
        // Two courses on, the joints coincide but the tones do not.
        for course in [2.0, 4.0, 6.0, 100.0] {
            assert!(rms_difference(&first, &row(&wall, 0.03 + course * PITCH_H_M)) > 15.0);
        }
        // 84 bricks around; rotate by any number of them.
        let brick = 6000 / 84;
        for bricks in [1, 8, 42] {
            let mut rotated = first.clone();
            rotated.rotate_left(bricks * brick);
            assert!(rms_difference(&first, &rotated) > 15.0);
        }
        assert!(rms_difference(&first, &row(&BrickWall::unique(2, PERIMETER_M), 0.03)) > 15.0);
    }

    #[test]
    fn tiles_repeat_exactly() {
        let wall = BrickWall::tiled(1, PERIMETER_M);
        let first = row(&wall, 0.03);
        assert!(rms_difference(&first, &row(&wall, 0.03 + 6.0 * PITCH_H_M)) < 1e-2);
        assert!(rms_difference(&first, &row(&wall, 0.03 + 2.0 * PITCH_H_M)) > 15.0);
        // Ten tiles around.
        let mut rotated = first.clone();
        rotated.rotate_left(600);
        assert!(rms_difference(&first, &rotated) < 1e-2);
        rotated.rotate_left(75);
        assert!(rms_difference(&first, &rotated) > 15.0);
    }

    #[test]
    fn joints_have_their_width_and_soft_edges() {
        let (pitch, width) = (0.075, 0.003);
        assert_eq!(share_of_brick(0.5 * pitch, pitch, width), 1.0);
        assert_eq!(share_of_brick(0.0, pitch, width), 0.0);
        assert!((share_of_brick(0.5 * JOINT_M, pitch, width) - 0.5).abs() < 1e-6);
        let steps = 1000;
        let mean = (0..steps)
            .map(|k| f64::from(share_of_brick(f64::from(k) / 1000.0 * pitch, pitch, width)))
            .sum::<f64>()
            / f64::from(steps);
        assert!((mean - (1.0 - JOINT_M / pitch)).abs() < 1e-3, "{mean}");
    }
}
