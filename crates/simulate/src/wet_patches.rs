//! Wet patches of the wall, which reflect the camera's lamp specularly.

use crate::procedural_noise::{RandomStream, ValueNoise, derived_seed, uniform};
use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_4, LN_2, TAU};

/// Range of a patch's diameters, metres.
const DIAMETER_M: [f64; 2] = [0.05, 0.30];
/// Size of the wall's cells in which patches are drawn, metres.
const CELL_M: f64 = 0.2;
/// Half the width of a patch's rim, from dry to wet, as a share of its radius.
const RIM: f64 = 0.1;
/// Share of the diffuse light that a wet wall absorbs.
const WET_ABSORPTION: f32 = 0.25;
/// Maximum slope of the film of water against the wall, along s and along h, radians.
const MAX_SLOPE_RAD: f32 = 0.12;
/// Size of a ripple, metres.
const RIPPLE_M: f64 = 0.03;
/// Maximum brightness of a specular reflection, grey levels.
const GLINT_GREY: f64 = 200.0;
/// Angle between view and normal at which a reflection falls to half, radians.
const LOBE_RAD: f64 = 0.075;

/// WallRegions of water, distributed evenly over the wall.
///
/// Their centres are a Poisson process of λ ellipses per square metre; each diameter is uniform in
/// [`DIAMETER_M`]. A point is dry if no centre lies close enough, so the patches cover
///
/// ```text
/// P = 1 − exp(−λ E[A]),   E[A] = π/4 E[diameter]²
/// ```
///
/// of the wall (Boolean model; overlaps counted once), which gives λ.
#[derive(Clone, Debug)]
pub(super) struct WetPatches {
    seed: u64,
    perimeter_m: f64,
    /// Number of cells around the section.
    cells_around: i64,
    /// Mean number of patches per cell.
    per_cell: f64,
    /// Slopes of the water along s and h, in units of [`MAX_SLOPE_RAD`].
    ripple: [ValueNoise; 2],
}

/// Water on a texel of the wall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct WaterFilm {
    /// Wetness, 0–255.
    pub wet: u8,
    /// Slope of the surface along s and h, in units of [`MAX_SLOPE_RAD`] / 127.
    pub slope: [i8; 2],
}

/// Elliptic patch of water.
struct WetPatch {
    /// Centre (s, h) on the wall, metres.
    centre_m: [f64; 2],
    /// Semi-axes, metres.
    radii_m: [f64; 2],
    /// Sine and cosine of the angle from s to the first axis.
    turn: (f64, f64),
}

impl WetPatches {
    /// WallRegions on `percent` of a wall of the given perimeter (metres).
    pub fn new(seed: u64, percent: f64, perimeter_m: f64) -> Self {
        let seed = RandomStream::WetPatches.seed(seed);
        let around = (perimeter_m / CELL_M).round().max(1.0);
        let mean_m = 0.5 * (DIAMETER_M[0] + DIAMETER_M[1]);
        let density = -(1.0 - percent / 100.0).ln() / (FRAC_PI_4 * mean_m * mean_m);
        let ripple =
            |purpose| ValueNoise::unique(derived_seed(seed, purpose), 1.0, RIPPLE_M, perimeter_m);
        Self {
            perimeter_m,
            cells_around: around as i64,
            per_cell: density * CELL_M * perimeter_m / around,
            ripple: [ripple(1), ripple(2)],
            seed: derived_seed(seed, 0),
        }
    }

    /// Draws the patches of a cell, whose number is a Poisson variable.
    fn patches(&self, i: i64, j: i64) -> impl Iterator<Item = WetPatch> + '_ {
        let draw = move |purpose| f64::from(uniform(derived_seed(self.seed, purpose), i, j));
        // Inversion: the count is the first n whose cumulative probability exceeds the uniform
        // number.
        let (mut count, mut share) = (0, (-self.per_cell).exp());
        let mut left = draw(0) - share;
        while left >= 0.0 && count < 64 {
            count += 1;
            share *= self.per_cell / count as f64;
            left -= share;
        }
        let cell_s_m = self.perimeter_m / self.cells_around as f64;
        (0..count).map(move |k| {
            let draw = |what: i64| draw(1 + 5 * k + what);
            let radius_m =
                |what: i64| 0.5 * (DIAMETER_M[0] + (DIAMETER_M[1] - DIAMETER_M[0]) * draw(what));
            WetPatch {
                centre_m: [
                    (i as f64 + draw(0)) * cell_s_m,
                    (j as f64 + draw(1)) * CELL_M,
                ],
                radii_m: [radius_m(2), radius_m(3)],
                turn: (draw(4) * TAU).sin_cos(),
            }
        })
    }

    /// Fills a row of texels at `(s, h) = ((k + ½) texel_m, h_m)`, metres, once around.
    pub fn fill_row(&self, h_m: f64, texel_m: f64, row: &mut [WaterFilm]) {
        let reach_m = 0.5 * DIAMETER_M[1] * (1.0 + RIM);
        let cell = |h_m: f64| (h_m / CELL_M).floor() as i64;
        row.fill(WaterFilm::default());
        for j in cell(h_m - reach_m)..=cell(h_m + reach_m) {
            for i in 0..self.cells_around {
                for patch in self.patches(i, j) {
                    patch.wet_row(h_m, texel_m, row);
                }
            }
        }
        for (k, ripple) in self.ripple.iter().enumerate() {
            let mut slopes = vec![0.0; row.len()];
            ripple.add_to_row(h_m, texel_m, &mut slopes);
            for (water, slope) in row.iter_mut().zip(slopes) {
                water.slope[k] = (127.0 * slope).round() as i8;
            }
        }
    }
}

impl WetPatch {
    /// Wets the texels of a row that lie within the patch, also across s = 0.
    fn wet_row(&self, h_m: f64, texel_m: f64, row: &mut [WaterFilm]) {
        let dh_m = h_m - self.centre_m[1];
        let reach_m = self.radii_m[0].max(self.radii_m[1]) * (1.0 + RIM);
        if dh_m.abs() > reach_m {
            return;
        }
        let texel = |s_m: f64| (s_m / texel_m - 0.5).floor() as i64;
        for k in texel(self.centre_m[0] - reach_m)..=texel(self.centre_m[0] + reach_m) + 1 {
            let wet = self.wetness((k as f64 + 0.5) * texel_m - self.centre_m[0], dh_m);
            let water = &mut row[k.rem_euclid(row.len() as i64) as usize];
            water.wet = water.wet.max((255.0 * wet).round() as u8);
        }
    }

    /// Wetness at an offset from the centre, metres: 1 inside, 0 outside, ½ on the ellipse, with
    /// `3t² − 2t³` across the rim.
    fn wetness(&self, ds_m: f64, dh_m: f64) -> f64 {
        let (sin, cos) = self.turn;
        let (x, y) = (cos * ds_m + sin * dh_m, cos * dh_m - sin * ds_m);
        let radius = (x / self.radii_m[0]).hypot(y / self.radii_m[1]);
        let t = ((1.0 + RIM - radius) / (2.0 * RIM)).clamp(0.0, 1.0);
        t * t * (3.0 - 2.0 * t)
    }
}

impl WaterFilm {
    /// Share of the diffuse light that is reflected.
    pub fn albedo(self) -> f32 {
        1.0 - WET_ABSORPTION * f32::from(self.wet) / 255.0
    }

    /// Brightness of the specular reflection along a ray of direction d at angle θ (radians) of
    /// the wall, grey levels.
    ///
    /// The lamp is at the lens, so the water reflects it where it faces the camera (Phong's lobe).
    /// With e_s and e_h along the wall, n its normal into the tunnel, and α and β the water's
    /// slopes, the water's normal is `n' ∝ n + α e_s + β e_h`, and
    ///
    /// ```text
    /// glint = wet · GLINT_GREY · max(0, −n'·d/|d|)^m,   cos^m(LOBE_RAD) = ½.
    /// ```
    #[inline]
    pub fn glint(self, theta: f64, d: &Vector3<f64>) -> f32 {
        if self.wet == 0 {
            return 0.0;
        }
        let [alpha, beta] = self
            .slope
            .map(|slope| f64::from(MAX_SLOPE_RAD) * f64::from(slope) / 127.0);
        let (sin, cos) = theta.sin_cos();
        let (out, along) = (sin * d.x + cos * d.z, cos * d.x - sin * d.z);
        let facing = (out - alpha * along - beta * d.y)
            / (d.norm_squared() * (1.0 + alpha * alpha + beta * beta)).sqrt();
        // cos^m φ ≈ exp(−m φ²/2), so m = 2 ln 2/LOBE².
        let m = 2.0 * LN_2 / (LOBE_RAD * LOBE_RAD);
        (f64::from(self.wet) / 255.0 * GLINT_GREY * facing.max(0.0).powi(m as i32)) as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIMETER_M: f64 = TAU * 3.0;
    const COLUMNS: usize = 1900;

    fn rows(wet_patches: &WetPatches, h_m: impl Iterator<Item = f64>) -> Vec<Vec<WaterFilm>> {
        let texel_m = PERIMETER_M / COLUMNS as f64;
        h_m.map(|h_m| {
            let mut row = vec![WaterFilm::default(); COLUMNS];
            wet_patches.fill_row(h_m, texel_m, &mut row);
            row
        })
        .collect()
    }

    #[test]
    fn patches_cover_the_given_share_everywhere() {
        for percent in [2.0, 15.0, 60.0] {
            let wet_patches = WetPatches::new(4, percent, PERIMETER_M);
            let wall = rows(&wet_patches, (0..1500).map(|k| f64::from(k) * 0.02 - 7.0));
            let covered = |columns: std::ops::Range<usize>| {
                let wet = wall.iter().flat_map(|row| &row[columns.clone()]);
                let wet = wet.filter(|water| water.wet > 127).count();
                100.0 * wet as f64 / (wall.len() * columns.len()) as f64
            };
            let all = covered(0..COLUMNS);
            assert!((all / percent - 1.0).abs() < 0.1, "{percent}: {all}");
            for quarter in 0..4 {
                let part = covered(quarter * COLUMNS / 4..(quarter + 1) * COLUMNS / 4);
                assert!((part / percent - 1.0).abs() < 0.25, "{percent}: {part}");
            }
        }
        let dry = rows(&WetPatches::new(4, 0.0, PERIMETER_M), [0.3].into_iter());
        assert!(dry[0].iter().all(|water| water.wet == 0));
    }

    /// At low coverage patches rarely touch: wet runs along s are no longer than the largest
    /// diameter with its rim, also across s = 0.
    #[test]
    fn patches_have_their_size() {
        let wet_patches = WetPatches::new(1, 0.5, PERIMETER_M);
        let texel_m = PERIMETER_M / COLUMNS as f64;
        let mut runs = Vec::new();
        for row in rows(&wet_patches, (0..2000).map(|k| f64::from(k) * 0.05)) {
            let mut run = 0;
            for water in row {
                match water.wet > 127 {
                    true => run += 1,
                    false if run > 0 => runs.push(std::mem::take(&mut run) as f64 * texel_m),
                    false => {}
                }
            }
        }
        runs.sort_by(f64::total_cmp);
        assert!(runs.len() > 300, "{}", runs.len());
        // A few patches overlap.
        let most = runs[runs.len() * 98 / 100];
        assert!((0.2..0.32).contains(&most), "{most}");
    }

    #[test]
    fn the_glint_faces_the_camera_and_is_narrow() {
        let flat = WaterFilm {
            wet: 255,
            slope: [0, 0],
        };
        let theta = 0.7f64;
        let out = Vector3::new(theta.sin(), 0.0, theta.cos());
        let glint = |water: WaterFilm, aside: f64| {
            f64::from(water.glint(theta, &(3.0 * (out + Vector3::y() * aside.tan()))))
        };
        assert!((glint(flat, 0.0) - GLINT_GREY).abs() < 1e-3);
        for side in [-1.0, 1.0] {
            assert!((glint(flat, side * LOBE_RAD) / GLINT_GREY - 0.5).abs() < 0.01);
            assert!(glint(flat, side * 0.3) < 0.01);
        }
        // Water of slope β reflects towards a camera at that angle: the ray comes from below, where
        // the normal points.
        let leaning = WaterFilm {
            slope: [0, 127],
            ..flat
        };
        let lean = f64::from(MAX_SLOPE_RAD).atan();
        assert!((glint(leaning, -lean) - GLINT_GREY).abs() < 1e-3);
        assert!(glint(leaning, lean) < 0.1 * GLINT_GREY);
        let dry = WaterFilm::default();
        assert_eq!(dry.glint(theta, &out), 0.0);
        assert!(flat.albedo() < dry.albedo());
    }
}
