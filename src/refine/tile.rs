//! One tile of the wall: texture, residuals and their first and second moments.
//!
//! For wall samples x of the tile and the frames i that see it, with values `z_i(x) = (I_i(x) − b_i)/a_i`:
//!
//! - residual in the frame's own grey levels `e_i = I_i − b_i − a_i S = a_i r_i` with `r_i = z_i − S`: noise is
//!   equal there, whatever the gain (in the wall's units a large gain would hide any residual);
//! - weight `w_i = q_i a_i² ω(e_i)` of `r_i²`, with q the pixels per sample and ω the robust weight;
//! - texture `S(x) = Σ w_i z_i / Σ w_i`, the robust weighted mean: for given poses and exposures this is the
//!   minimiser, so S is eliminated exactly (variable projection);
//! - derivative. If frame i moves by ξ, the pixel that looks at x shows the wall at `x − A_i ξ` instead,
//!   with `A_i = ∂(s, h)/∂ξ` ([`crate::surface::wall_jacobian`]), hence `∂e_i/∂ξ = −a_i ∇Sᵀ A_i`;
//!   `∂e_i/∂α_i = −a_i S` and `∂e_i/∂b_i = −1`. All frames share one feature vector
//!   `φ(x) = (∂S/∂s, ∂S/∂h, S, 1)`:
//!
//!   `∂e_i = −a_i φ(x)ᵀ B_i`,   `B_i = diag(A_i, 1, 1/a_i)`  (4 × 8).
//!
//! With each frame's own gradient instead of the fused one, its noise would add to the diagonal blocks of
//! the normal matrix but not to the others, and the weak modes of the trajectory would turn stiff.
//!
//! Within a tile A_i is nearly constant, so the normal equations need only moments:
//!
//! - `g_i = Σ_x w_i r_i φ` (4), the gradient of frame i being `−B_iᵀ g_i`;
//! - `M = Σ_x φ φᵀ` (4 × 4), and the mean weights `w̄_i`: eliminating S leaves
//!   `H_ij = (w̄_i δ_ij − w̄_i w̄_j / Σ_k w̄_k) B_iᵀ M B_j`.
//!
//! Rows of the bracket sum to zero, so what moves all frames of a tile alike costs nothing: the gauge
//! directions are exact null vectors of the data term.

use super::grid::{AREA, SIDE, TILE, TilePoints};
use super::robust::Loss;
use super::view::View;
use nalgebra::{Matrix4, Vector4};

/// Samples of a tile without its ring.
pub const SAMPLES: usize = TILE * TILE;

/// Moments of one observer of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub struct ObserverMoments {
    /// `Σ_x w r φ`.
    pub gradient: Vector4<f64>,
    /// Mean weight `w̄`.
    pub weight: f64,
    /// `Σ_x q ρ(e)`.
    pub cost: f64,
    /// `Σ_x q ω(e) e²`, grey levels².
    pub square: f64,
    /// `Σ_x q`: pixels that the samples stand for.
    pub pixels: f64,
    /// `Σ_x q ω(e)`: what the robust loss leaves of them.
    pub inliers: f64,
}

/// What one frame shows of a tile.
struct Samples {
    /// `z` at every wall sample.
    values: [f32; AREA],
    /// Pixels per wall sample, q.
    pixels: f32,
    /// Gain a.
    gain: f32,
}

/// Room for the work on one tile, reused from tile to tile.
#[derive(Default)]
pub struct TileWork {
    samples: Vec<Samples>,
    /// Moments of each observer, in the order given.
    pub observers: Vec<ObserverMoments>,
    /// `Σ_x φ φᵀ`.
    pub features: Matrix4<f64>,
}

impl TileWork {
    /// Samples all observers.
    fn sample<'a>(&mut self, points: &TilePoints, views: impl Iterator<Item = &'a View<'a>>) {
        self.samples.clear();
        for view in views {
            let mut values = [0.0; AREA];
            let pixels = view.sample(points, &mut values);
            self.samples.push(Samples {
                values,
                pixels,
                gain: view.gain(),
            });
        }
    }

    /// The texture: the weighted mean, then once more with the robust weights around it.
    fn texture(&self, loss: &Loss) -> [f32; AREA] {
        let mut sum = [0.0f32; AREA];
        let mut total = 0.0f32;
        for frame in &self.samples {
            let q = frame.pixels * frame.gain * frame.gain;
            total += q;
            for k in 0..AREA {
                sum[k] += q * frame.values[k];
            }
        }
        let mean = sum.map(|s| s / total);
        let mut sum = [0.0f32; AREA];
        let mut weights = [0.0f32; AREA];
        for frame in &self.samples {
            let q = frame.pixels * frame.gain * frame.gain;
            for k in 0..AREA {
                let w = q * loss.weight(frame.gain * (frame.values[k] - mean[k]));
                weights[k] += w;
                sum[k] += w * frame.values[k];
            }
        }
        // Where every value is an outlier to all others the mean is as good as any.
        let mut texture = mean;
        for k in 0..AREA {
            if weights[k] > 1e-6 * total {
                texture[k] = sum[k] / weights[k];
            }
        }
        texture
    }

    /// Fills [`TileWork::observers`] and [`TileWork::features`] for the frames `views`.
    ///
    /// `spacing_m`: distance between samples along s and h.
    pub fn moments<'a>(
        &mut self,
        points: &TilePoints,
        views: impl Iterator<Item = &'a View<'a>>,
        spacing_m: (f64, f64),
        loss: &Loss,
    ) {
        self.sample(points, views);
        let texture = self.texture(loss);
        let slope_s = (0.5 / spacing_m.0) as f32;
        let slope_h = (0.5 / spacing_m.1) as f32;
        let mut phi = [[0.0f32; SAMPLES]; 3];
        for j in 0..TILE {
            for i in 0..TILE {
                let (k, c) = (j * TILE + i, (j + 1) * SIDE + i + 1);
                phi[0][k] = (texture[c + 1] - texture[c - 1]) * slope_s;
                phi[1][k] = (texture[c + SIDE] - texture[c - SIDE]) * slope_h;
                phi[2][k] = texture[c];
            }
        }
        self.features = feature_moments(&phi);
        self.observers.clear();
        for frame in &self.samples {
            self.observers.push(observer_moments(frame, &phi, loss));
        }
    }

    /// Adds the magnitudes of the residuals around the plain mean to `histogram` (bins of `bin` grey
    /// levels), each scaled by `√(n/(n−1))` for the share of the mean it has itself made.
    pub fn residual_histogram<'a>(
        &mut self,
        points: &TilePoints,
        views: impl Iterator<Item = &'a View<'a>>,
        bin: f32,
        histogram: &mut [u64],
    ) {
        self.sample(points, views);
        let n = self.samples.len() as f32;
        let scale = (n / (n - 1.0)).sqrt() / bin;
        let last = histogram.len() - 1;
        for k in 0..AREA {
            let mean = self
                .samples
                .iter()
                .map(|frame| frame.values[k])
                .sum::<f32>()
                / n;
            for frame in &self.samples {
                let e = frame.gain * (frame.values[k] - mean);
                histogram[((e.abs() * scale) as usize).min(last)] += 1;
            }
        }
    }
}

fn feature_moments(phi: &[[f32; SAMPLES]; 3]) -> Matrix4<f64> {
    let mut moments = Matrix4::zeros();
    for a in 0..3 {
        for b in a..3 {
            moments[(a, b)] = f64::from(dot(&phi[a], &phi[b]));
        }
        moments[(a, 3)] = f64::from(lanes(&phi[a], |v| v));
    }
    moments[(3, 3)] = SAMPLES as f64;
    moments.fill_lower_triangle_with_upper_triangle();
    moments
}

fn observer_moments(frame: &Samples, phi: &[[f32; SAMPLES]; 3], loss: &Loss) -> ObserverMoments {
    let mut e = [0.0f32; SAMPLES];
    for j in 0..TILE {
        for i in 0..TILE {
            let k = j * TILE + i;
            e[k] = frame.gain * (frame.values[(j + 1) * SIDE + i + 1] - phi[2][k]);
        }
    }
    let w = e.map(|e| loss.weight(e));
    let mut we = [0.0f32; SAMPLES];
    for k in 0..SAMPLES {
        we[k] = w[k] * e[k];
    }
    let (q, a) = (f64::from(frame.pixels), f64::from(frame.gain));
    let inliers = f64::from(lanes(&w, |v| v));
    // w r = q a² ω r = q a (ω e).
    ObserverMoments {
        gradient: Vector4::new(
            f64::from(dot(&we, &phi[0])),
            f64::from(dot(&we, &phi[1])),
            f64::from(dot(&we, &phi[2])),
            f64::from(lanes(&we, |v| v)),
        ) * (q * a),
        weight: q * a * a * inliers / SAMPLES as f64,
        cost: q * f64::from(lanes(&e, |e| loss.value(e))),
        square: q * f64::from(dot(&we, &e)),
        pixels: q * SAMPLES as f64,
        inliers: q * inliers,
    }
}

/// Sum of products, in eight running sums so that it vectorises and never depends on anything else.
fn dot(a: &[f32; SAMPLES], b: &[f32; SAMPLES]) -> f32 {
    let mut sums = [0.0f32; 8];
    for k in (0..SAMPLES).step_by(8) {
        for lane in 0..8 {
            sums[lane] += a[k + lane] * b[k + lane];
        }
    }
    sums.iter().sum()
}

/// Sum of `f` of every value, in eight running sums.
fn lanes(a: &[f32; SAMPLES], f: impl Fn(f32) -> f32) -> f32 {
    let mut sums = [0.0f32; 8];
    for k in (0..SAMPLES).step_by(8) {
        for lane in 0..8 {
            sums[lane] += f(a[k + lane]);
        }
    }
    sums.iter().sum()
}
