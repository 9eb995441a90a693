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
use super::robust::{Loss, NoiseHistogram, NoiseModel};
use super::view::View;
use nalgebra::{Matrix4, Vector4};

/// Samples of a tile without its ring.
pub const SAMPLES: usize = TILE * TILE;

/// Steps of reweighting from the plain mean to the robust texture.
const REWEIGHTINGS: usize = 2;

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

/// A frame that sees a tile.
pub struct Seen<'a> {
    /// The frame.
    pub view: &'a View<'a>,
    /// Pixels per wall sample, q.
    pub pixels: f32,
}

/// What one frame shows of a tile.
struct Samples {
    /// `z` at every wall sample.
    values: [f32; AREA],
    /// Pixels per wall sample, q.
    pixels: f32,
    /// Gain a.
    gain: f32,
    /// Robust weight ω at every wall sample.
    weights: [f32; AREA],
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
    fn sample<'a>(&mut self, points: &TilePoints, observers: impl Iterator<Item = Seen<'a>>) {
        self.samples.clear();
        for Seen { view, pixels } in observers {
            let mut values = [0.0; AREA];
            view.sample(points, &mut values);
            self.samples.push(Samples {
                values,
                pixels,
                gain: view.gain(),
                weights: [1.0; AREA],
            });
        }
    }

    /// The weighted mean of all observers.
    fn mean(&self) -> [f32; AREA] {
        let mut sum = [0.0f32; AREA];
        let mut total = 0.0f32;
        for frame in &self.samples {
            let q = frame.pixels * frame.gain * frame.gain;
            total += q;
            for (sum, value) in sum.iter_mut().zip(&frame.values) {
                *sum += q * value;
            }
        }
        sum.map(|s| s / total)
    }

    /// One step of iteratively reweighted least squares: sets every weight by the residual from `reference`
    /// and returns the mean with these weights.
    ///
    /// The weighted residuals from that mean sum to zero at every sample, exactly; otherwise the gradient
    /// would have a part along the gauge, where nothing but the weak prior resists.
    fn reweight(&mut self, reference: &[f32; AREA], precision: &[f32; AREA]) -> [f32; AREA] {
        let mut sum = [0.0f32; AREA];
        let mut total = [1e-12f32; AREA];
        for frame in &mut self.samples {
            let q = frame.pixels * frame.gain * frame.gain;
            for k in 0..AREA {
                let difference = frame.values[k] - reference[k];
                let e = frame.gain * difference;
                let w = Loss::weight(e * e, precision[k]);
                frame.weights[k] = w;
                total[k] += q * w;
                sum[k] += q * w * difference;
            }
        }
        let mut texture = *reference;
        for k in 0..AREA {
            texture[k] += sum[k] / total[k];
        }
        texture
    }

    /// Fills [`TileWork::observers`] and [`TileWork::features`] for a tile's observers.
    ///
    /// `spacing_m`: distance between samples along s and h.
    pub fn moments<'a>(
        &mut self,
        points: &TilePoints,
        observers: impl Iterator<Item = Seen<'a>>,
        spacing_m: (f64, f64),
        noise: &NoiseModel,
    ) {
        self.sample(points, observers);
        let mean = self.mean();
        let precision = gradient_squares(&mean).map(|g2| noise.precision(g2));
        let mut texture = mean;
        for _ in 0..REWEIGHTINGS {
            texture = self.reweight(&texture, &precision);
        }
        let slope_s = (0.5 / spacing_m.0) as f32;
        let slope_h = (0.5 / spacing_m.1) as f32;
        let mut phi = [[0.0f32; SAMPLES]; 3];
        let mut inner_precision = [0.0f32; SAMPLES];
        for j in 0..TILE {
            for i in 0..TILE {
                let (k, c) = (j * TILE + i, (j + 1) * SIDE + i + 1);
                phi[0][k] = (texture[c + 1] - texture[c - 1]) * slope_s;
                phi[1][k] = (texture[c + SIDE] - texture[c - SIDE]) * slope_h;
                phi[2][k] = texture[c];
                inner_precision[k] = precision[c];
            }
        }
        self.features = feature_moments(&phi);
        self.observers.clear();
        for frame in &self.samples {
            self.observers
                .push(observer_moments(frame, &phi, &inner_precision));
        }
    }

    /// Counts the residuals around the plain mean, each scaled by `√(n/(n−1))` for the share of the mean
    /// that it has itself made.
    pub fn count_residuals<'a>(
        &mut self,
        points: &TilePoints,
        observers: impl Iterator<Item = Seen<'a>>,
        histogram: &mut NoiseHistogram,
    ) {
        self.sample(points, observers);
        let n = self.samples.len() as f32;
        let scale = (n / (n - 1.0)).sqrt();
        let mean = self.mean();
        let squares = gradient_squares(&mean);
        for frame in &self.samples {
            for k in 0..AREA {
                let e = frame.gain * (frame.values[k] - mean[k]);
                histogram.add(scale * e, squares[k]);
            }
        }
    }
}

/// Squared length of a texture's gradient in grey levels a sample; the ring takes its neighbours' value.
fn gradient_squares(texture: &[f32; AREA]) -> [f32; AREA] {
    let mut squares = [0.0f32; AREA];
    for j in 1..=TILE {
        for i in 1..=TILE {
            let c = j * SIDE + i;
            let square = |n: usize| (texture[n] - texture[c]).powi(2);
            squares[c] =
                0.5 * (square(c - 1) + square(c + 1) + square(c - SIDE) + square(c + SIDE));
        }
        squares[j * SIDE] = squares[j * SIDE + 1];
        squares[j * SIDE + TILE + 1] = squares[j * SIDE + TILE];
    }
    squares.copy_within(SIDE..2 * SIDE, 0);
    squares.copy_within(TILE * SIDE..(TILE + 1) * SIDE, (TILE + 1) * SIDE);
    squares
}

fn feature_moments(phi: &[[f32; SAMPLES]; 3]) -> Matrix4<f64> {
    let mut moments = Matrix4::zeros();
    for a in 0..3 {
        for b in a..3 {
            moments[(a, b)] = f64::from(dot(&phi[a], &phi[b]));
        }
        moments[(a, 3)] = f64::from(sum(&phi[a]));
    }
    moments[(3, 3)] = SAMPLES as f64;
    moments.fill_lower_triangle_with_upper_triangle();
    moments
}

fn observer_moments(
    frame: &Samples,
    phi: &[[f32; SAMPLES]; 3],
    precision: &[f32; SAMPLES],
) -> ObserverMoments {
    let (mut e, mut w) = ([0.0f32; SAMPLES], [0.0f32; SAMPLES]);
    for j in 0..TILE {
        for i in 0..TILE {
            let (k, c) = (j * TILE + i, (j + 1) * SIDE + i + 1);
            e[k] = frame.gain * (frame.values[c] - phi[2][k]);
            w[k] = frame.weights[c];
        }
    }
    let (mut we, mut loss) = ([0.0f32; SAMPLES], [0.0f32; SAMPLES]);
    for k in 0..SAMPLES {
        we[k] = w[k] * e[k];
        loss[k] = Loss::value(e[k] * e[k], precision[k]);
    }
    let (q, a) = (f64::from(frame.pixels), f64::from(frame.gain));
    let inliers = f64::from(sum(&w));
    // w r = q a² ω r = q a (ω e).
    ObserverMoments {
        gradient: Vector4::new(
            f64::from(dot(&we, &phi[0])),
            f64::from(dot(&we, &phi[1])),
            f64::from(dot(&we, &phi[2])),
            f64::from(sum(&we)),
        ) * (q * a),
        weight: q * a * a * inliers / SAMPLES as f64,
        cost: q * f64::from(sum(&loss)),
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

/// Sum, in eight running sums.
fn sum(a: &[f32; SAMPLES]) -> f32 {
    let mut sums = [0.0f32; 8];
    for k in (0..SAMPLES).step_by(8) {
        for lane in 0..8 {
            sums[lane] += a[k + lane];
        }
    }
    sums.iter().sum()
}
