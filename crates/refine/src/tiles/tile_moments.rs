//! Moments of a tile: its part of the cost and of the normal equations.

use crate::tiles::grid::{Plane, SIDE};
use crate::tiles::tile_arrays::{Rows, ZERO_ROWS, dot, sum};
use nalgebra::{Matrix4, Vector4};

/// Moments of one observer of a tile, in the symbols of [`crate::tiles::tile`].
#[derive(Clone, Copy, Debug, Default)]
pub struct ObserverMoments {
    /// `g = Σ_x w r φ`.
    pub gradient: Vector4<f64>,
    /// Mean weight `w̄`.
    pub weight: f64,
    /// `Σ_x q τ ρ(e)`.
    pub cost: f64,
    /// `Σ_x q ω(e) e²`, grey levels².
    pub square: f64,
    /// `Σ_x q` over the samples with a value: the number of pixels compared.
    pub pixels: f64,
    /// `Σ_x q ω(e)`: the pixels by robust weight.
    pub inliers: f64,
}

/// Moments of a tile.
#[derive(Clone, Debug, Default)]
pub struct TileMoments {
    /// Moments of each observer, in the order of the observations.
    pub observers: Vec<ObserverMoments>,
    /// `M = Σ_x p φ φᵀ`.
    pub features: Matrix4<f64>,
}

/// The first three features of a texture, `∂S/∂s, ∂S/∂h, S`, with zero slopes where it is not
/// `covered`. `slopes`: half the inverse spacing of the samples along s and h, 1/m.
#[inline(always)]
pub fn features(texture: &Plane, slopes: [f32; 2], covered: &Rows) -> [Rows; 3] {
    let mut phi = [ZERO_ROWS; 3];
    for k in 0..ZERO_ROWS.len() {
        let c = k + SIDE;
        phi[0][k] = (texture[c + 1] - texture[c - 1]) * slopes[0] * covered[k];
        phi[1][k] = (texture[c + SIDE] - texture[c - SIDE]) * slopes[1] * covered[k];
        phi[2][k] = texture[c];
    }
    phi
}

/// `M = Σ_x p φ φᵀ`; `information`: p, zero on the ring.
#[inline(always)]
pub fn feature_moments(phi: &[Rows; 3], information: &Rows) -> Matrix4<f64> {
    let mut moments = Matrix4::zeros();
    for a in 0..3 {
        let mut weighted = *information;
        for k in 0..ZERO_ROWS.len() {
            weighted[k] *= phi[a][k];
        }
        for b in a..3 {
            moments[(a, b)] = f64::from(dot(&weighted, &phi[b]));
        }
        moments[(a, 3)] = f64::from(sum(&weighted));
    }
    moments[(3, 3)] = f64::from(sum(information));
    moments.fill_lower_triangle_with_upper_triangle();
    moments
}
