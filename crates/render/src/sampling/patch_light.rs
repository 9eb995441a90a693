//! Factor that undoes gain and shading over a patch.

use crate::warp::patches::PATCH_SCALE;

/// Factor `1/(a V)` of [`super::exposure`] over a patch: quadratic in each of the patch's
/// coordinates `x, y ∈ [−1, 1]`, through its values at −1, 0 and 1. Shading changes so slowly that
/// this is exact enough.
#[derive(Clone, Copy, Debug)]
pub struct PatchLight([[f32; 3]; 3]);

impl PatchLight {
    /// Fits the factors at −1, 0 and 1 along x, for y at −1, 0 and 1.
    pub fn through(at: [[f32; 3]; 3]) -> Self {
        let along_x = at.map(quadratic);
        let mut c = [[0.0; 3]; 3];
        for k in 0..3 {
            let along_y = quadratic(along_x.map(|row| row[k]));
            for l in 0..3 {
                c[l][k] = along_y[l];
            }
        }
        Self(c)
    }

    /// Constant factor.
    pub fn even(factor: f32) -> Self {
        Self([[factor, 0.0, 0.0], [0.0; 3], [0.0; 3]])
    }

    /// Factor along a row of the patch, by powers of x.
    #[inline(always)]
    pub fn row(&self, row: usize) -> [f32; 3] {
        let y = row as f32 * PATCH_SCALE - 1.0;
        let Self([a, b, c]) = self;
        [0, 1, 2].map(|k| (c[k] * y + b[k]) * y + a[k])
    }
}

/// Coefficients of a quadratic, the lowest power first, from its values at −1, 0 and 1.
fn quadratic([before, middle, after]: [f32; 3]) -> [f32; 3] {
    [
        middle,
        0.5 * (after - before),
        0.5 * (after + before) - middle,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quadratics_are_found_as_they_are() {
        let truth = |x: f32, y: f32| (1.0 + 0.3 * x - 0.2 * x * x) * (2.0 - 0.5 * y + 0.1 * y * y);
        let nodes = [-1.0, 0.0, 1.0];
        let light = PatchLight::through(nodes.map(|y| nodes.map(|x| truth(x, y))));
        for row in 0..32 {
            let [a, b, c] = light.row(row);
            let y = row as f32 / 16.0 - 1.0;
            for x in [-1.0, -0.3, 0.4, 0.9] {
                assert!(((c * x + b) * x + a - truth(x, y)).abs() < 1e-5);
            }
        }
        assert_eq!(PatchLight::even(1.5).row(9), [1.5, 0.0, 0.0]);
    }
}
