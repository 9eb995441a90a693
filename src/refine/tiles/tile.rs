//! One tile of the wall: texture, residuals and their first and second moments.
//!
//! For wall samples x of the tile and the frames i that see it, with gain `a_i = exp(α_i) V` (the
//! frame's own times the camera's shading V there) and values `z_i(x) = (I_i(x) − b_i)/a_i`:
//!
//! - residual in the frame's own grey levels `e_i = I_i − b_i − a_i S = a_i r_i` with
//!   `r_i = z_i − S`: noise is equal there, whatever the gain (in the wall's units a large gain
//!   would hide any residual);
//! - weight `w_i = q_i a_i² ω(e_i) τ` of `r_i²`, with q the pixels per sample, ω the robust weight,
//!   and, in the last solve, `τ = σ²/v` by the variance v of residuals where the texture is as
//!   steep as here ([`crate::refine::tiles::residual_weighting::NoiseModel`]), else 1: it is aliasing that makes residuals at
//!   edges large, and without τ the sharpest edges would decide all; like the v in ω, τ is taken to
//!   stay as it is while the poses move;
//! - texture `S(x) = Σ w_i z_i / Σ w_i`, the robust weighted mean: for given poses and exposures
//!   this is the minimiser, so S is eliminated exactly (variable projection);
//! - derivative. If frame i moves by ξ, the pixel that looks at x shows the wall at `x − A_i ξ`
//!   instead, with `A_i = ∂(s, h)/∂ξ` ([`crate::surface::wall_jacobian`]), hence
//!   `∂e_i/∂ξ = −a_i ∇Sᵀ A_i`; `∂e_i/∂α_i = −a_i S` and `∂e_i/∂b_i = −1`. All frames share one
//!   feature vector `φ(x) = (∂S/∂s, ∂S/∂h, S, 1)`:
//!
//!   `∂e_i = −a_i φ(x)ᵀ B_i`,   `B_i = diag(A_i, 1, 1/a_i)`  (4 × 8).
//!
//! With each frame's own gradient instead of the fused one, its noise would add to the diagonal
//! blocks of the normal matrix but not to the others, and the weak modes of the trajectory would
//! turn stiff.
//!
//! Within a tile A_i is nearly constant, so the normal equations need only moments:
//!
//! - `g_i = Σ_x w_i r_i φ` (4), the gradient of frame i being `−B_iᵀ g_i`;
//! - `M = Σ_x p φ φᵀ` (4 × 4), p the sample's share of the information, and the mean weights
//!   `w̄_i`: eliminating S leaves `H_ij = (w̄_i δ_ij − w̄_i w̄_j / Σ_k w̄_k) B_iᵀ M B_j`.
//!
//! The slopes in φ are those of the denoised texture ([`crate::refine::tiles::denoising`]) once the frames are
//! aligned at full size.
//!
//! Frames that do not show the wall in a tile take no part in it ([`crate::refine::samples::outlier_mask`]). Where a
//! frame has no value (clipped pixels) its weight is zero, and its cost that of plain noise.
//!
//! What edges that are sharp against a pixel need beyond this is in [`crate::refine::joint::joint_block`].
//!
//! Rows of the bracket sum to zero, so what moves all frames of a tile alike costs nothing: the
//! gauge directions are exact null vectors of the data term.

use crate::refine::tiles::denoising::{Denoiser, TextureSpectrum};
use crate::refine::tiles::frame_samples::SampledFrame;
use crate::refine::tiles::grid::{LANES, Plane, SIDE, TILE, TilePoints, ZERO};
use crate::refine::tiles::residual_weighting::{Loss, NoiseHistogram, NoiseModel};
use nalgebra::{Matrix4, Vector4};

/// Samples of a tile without its ring.
pub const SAMPLES: usize = TILE * TILE;

/// A value at every sample of a tile's own rows, the ring's columns included, which count for
/// nothing: its place is [`SIDE`] before that in a [`Plane`].
type Rows = [f32; TILE * SIDE];
const NO_ROWS: Rows = [0.0; TILE * SIDE];

/// 1 at the tile's own samples, 0 at the ring's.
const OWN: Rows = {
    let mut own = NO_ROWS;
    let mut k = 0;
    while k < own.len() {
        let column = k % SIDE;
        own[k] = if column > 0 && column <= TILE {
            1.0
        } else {
            0.0
        };
        k += 1;
    }
    own
};

/// Steps of reweighting from the plain mean to the robust texture.
const REWEIGHTINGS: usize = 2;

/// Moments of one observer of a tile.
#[derive(Clone, Copy, Debug, Default)]
pub struct ObserverMoments {
    /// `Σ_x w r φ`.
    pub gradient: Vector4<f64>,
    /// Mean weight `w̄`.
    pub weight: f64,
    /// `Σ_x q τ ρ(e)`.
    pub cost: f64,
    /// `Σ_x q ω(e) e²`, grey levels².
    pub square: f64,
    /// `Σ_x q`: pixels that the samples with a value stand for.
    pub pixels: f64,
    /// `Σ_x q ω(e)`: what the robust loss leaves of them.
    pub inliers: f64,
}

/// Moments of a tile.
#[derive(Clone, Debug, Default)]
pub struct TileMoments {
    /// Of each observer, in the order given.
    pub observers: Vec<ObserverMoments>,
    /// `Σ_x p φ φᵀ`.
    pub features: Matrix4<f64>,
}

/// How a frame fits the others over a tile.
#[derive(Clone, Copy, Debug)]
pub struct Misfit {
    /// Mean loss, each sample by its variance: R of [`crate::refine::samples::outlier_mask`].
    pub loss: f32,
    /// Mean variance: how steep the texture is.
    pub steepness: f32,
}

/// How residuals are weighed and slopes are taken.
#[derive(Clone, Copy)]
pub struct ResidualWeighting<'a> {
    /// The residuals' variance.
    pub noise: &'a NoiseModel,
    /// Whether samples weigh by `τ = σ²/v`, else all alike.
    pub variance_weighting: bool,
    /// What takes the noise from S for its slopes.
    pub denoiser: Option<&'a Denoiser>,
}

/// A frame that sees a tile.
pub struct TileObservation<'a> {
    /// The frame.
    pub view: &'a SampledFrame<'a>,
    /// Pixels per wall sample, q.
    pub pixels: f32,
    /// The camera's shading V around the tile.
    pub shade: f32,
}

/// What one frame shows of a tile.
struct Samples {
    /// `z` at every wall sample.
    values: Plane,
    /// Pixels per wall sample, q.
    pixels: f32,
    /// Gain a, shading included.
    gain: f32,
    /// Robust weight ω at every wall sample.
    weights: Plane,
    /// 1 where there is a value, else 0.
    known: Plane,
}

/// Room for the work on one tile, reused from tile to tile.
#[derive(Default)]
pub struct TileWorkspace {
    samples: Vec<Samples>,
    /// True if some frame lacks some value.
    gaps: bool,
    /// What the work came to.
    pub found: TileMoments,
    /// How each observer fits the others, if that is asked for.
    pub misfits: Vec<Misfit>,
    /// Values in ascending order, sample by sample.
    sorted: Vec<Plane>,
}

// Everything here is inlined into its caller, which is compiled for the processor's widest vectors.
impl TileWorkspace {
    /// Samples all observers.
    #[inline(always)]
    fn sample<'a>(
        &mut self,
        points: &TilePoints,
        observers: impl Iterator<Item = TileObservation<'a>>,
    ) {
        self.samples.clear();
        self.gaps = false;
        for seen in observers {
            self.samples.push(Samples {
                values: ZERO,
                pixels: seen.pixels,
                gain: seen.view.gain() * seen.shade,
                weights: ZERO,
                known: [1.0; ZERO.len()],
            });
            let Some(frame) = self.samples.last_mut() else {
                continue;
            };
            seen.view.sample(points, seen.shade, &mut frame.values);
            // One NaN makes the sum NaN.
            if sum(&frame.values).is_nan() {
                self.gaps = true;
                for (value, known) in frame.values.iter_mut().zip(&mut frame.known) {
                    if value.is_nan() {
                        (*value, *known) = (0.0, 0.0);
                    }
                }
            }
        }
    }

    /// The weighted mean of all observers; 0 where none has a value.
    #[inline(always)]
    fn mean(&self) -> Plane {
        let mut sum = ZERO;
        let mut total = [1e-12f32; ZERO.len()];
        for frame in &self.samples {
            let q = frame.pixels * frame.gain * frame.gain;
            for k in 0..ZERO.len() {
                total[k] += q * frame.known[k];
                sum[k] += q * frame.values[k];
            }
        }
        for (sum, total) in sum.iter_mut().zip(&total) {
            *sum /= total;
        }
        sum
    }

    /// 1 at the samples around which the texture is known, so that it has a slope; else 0.
    #[inline(always)]
    fn covered(&self) -> Rows {
        if !self.gaps {
            return OWN;
        }
        let mut known = ZERO;
        for frame in &self.samples {
            for (known, own) in known.iter_mut().zip(&frame.known) {
                *known = known.max(*own);
            }
        }
        std::array::from_fn(|k| {
            let c = k + SIDE;
            OWN[k] * known[c] * known[c - 1] * known[c + 1] * known[c - SIDE] * known[c + SIDE]
        })
    }

    /// Squared gradient of the texture as the frames show it, in their own grey levels a sample: of
    /// the frame that shows least (with four frames or more, the second least).
    ///
    /// Where only one frame is steep it shows a glint or an edge of something before the wall,
    /// which must not pass for the noise of a steep texture. (In the wall's units a common factor
    /// of all gains would change the noise model, and with it the cost.)
    #[inline(always)]
    fn activity(&self) -> Plane {
        let (mut least, mut second) = ([f32::INFINITY; TILE * SIDE], [f32::INFINITY; TILE * SIDE]);
        for frame in &self.samples {
            let square_gain = frame.gain * frame.gain;
            let squares = gradient_squares(&frame.values);
            for k in 0..NO_ROWS.len() {
                let square = square_gain * squares[k];
                second[k] = second[k].min(square.max(least[k]));
                least[k] = least[k].min(square);
            }
        }
        with_ring(if self.samples.len() < 4 {
            &least
        } else {
            &second
        })
    }

    /// `1/v` at every wall sample.
    #[inline(always)]
    fn precision(&self, noise: &NoiseModel) -> Plane {
        self.activity().map(
            #[inline(always)]
            |g2| noise.precision(g2),
        )
    }

    /// Of each observer, for the noise of S ([`crate::refine::tiles::denoising`]): `√q`, the pixels from sample to
    /// sample, and `(q a)² / (Σ q a²)²`.
    fn noise_shares(&self) -> impl Iterator<Item = (f64, f64)> {
        let weight = |frame: &Samples| f64::from(frame.pixels * frame.gain * frame.gain);
        let sum: f64 = self.samples.iter().map(weight).sum();
        self.samples.iter().map(move |frame| {
            let own = f64::from(frame.pixels * frame.gain) / sum;
            (f64::from(frame.pixels).sqrt(), own * own)
        })
    }

    /// One step of iteratively reweighted least squares: sets every weight by the residual from
    /// `reference` and returns the mean with these weights.
    ///
    /// The weighted residuals from that mean sum to zero at every sample, exactly; otherwise the
    /// gradient would have a part along the gauge, where nothing but the weak prior resists.
    #[inline(always)]
    fn reweight(&mut self, reference: &Plane, precision: &Plane) -> Plane {
        let mut sum = ZERO;
        let mut total = [1e-12f32; ZERO.len()];
        for frame in &mut self.samples {
            let q = frame.pixels * frame.gain * frame.gain;
            let (mut difference, mut w) = (ZERO, ZERO);
            for k in 0..ZERO.len() {
                difference[k] = frame.values[k] - reference[k];
                let e = frame.gain * difference[k];
                w[k] = frame.known[k] * Loss::weight(e * e, precision[k]);
            }
            for k in 0..ZERO.len() {
                total[k] += q * w[k];
                sum[k] += q * w[k] * difference[k];
            }
            frame.weights = w;
        }
        let mut texture = *reference;
        for k in 0..ZERO.len() {
            texture[k] += sum[k] / total[k];
        }
        texture
    }

    /// Fills [`TileWorkspace::found`] for a tile's observers.
    ///
    /// `spacing_m`: distance between samples along s and h.
    #[inline(always)]
    pub fn moments<'a>(
        &mut self,
        points: &TilePoints,
        observers: impl Iterator<Item = TileObservation<'a>>,
        spacing_m: (f64, f64),
        weighting: &ResidualWeighting,
    ) {
        let ResidualWeighting {
            noise,
            variance_weighting,
            denoiser,
        } = *weighting;
        self.sample(points, observers);
        let precision = self.precision(noise);
        let mut texture = self.mean();
        for _ in 0..REWEIGHTINGS {
            texture = self.reweight(&texture, &precision);
        }
        let slopes = [spacing_m.0, spacing_m.1].map(|spacing_m| (0.5 / spacing_m) as f32);
        let covered = self.covered();
        let mut phi = features(&texture, slopes, &covered);
        if let Some(denoiser) = denoiser {
            let clean = features(&denoiser.apply(&texture), slopes, &covered);
            (phi[0], phi[1]) = (clean[0], clean[1]);
        }
        let mut variance = NO_ROWS;
        let mut trust = [1.0; NO_ROWS.len()];
        for k in 0..NO_ROWS.len() {
            variance[k] = 1.0 / precision[k + SIDE];
            if variance_weighting {
                trust[k] = noise.floor * precision[k + SIDE];
            }
        }
        let shares = self.shares(&trust);
        self.found.features = feature_moments(&phi, &shares);
        self.found.observers.clear();
        for frame in &self.samples {
            let moments = observer_moments(frame, &phi, &precision, [&variance, &trust]);
            self.found.observers.push(moments);
        }
    }

    /// How much each sample tells about poses, relative to one at which every frame has its mean
    /// weight: the trace of the bracket, `Σ w − Σ w²/Σ w`, there and with the mean weights.
    ///
    /// Where all frames but one are rejected (a glint in it), the texture is that frame's own and
    /// says nothing, however steep it is.
    #[inline(always)]
    fn shares(&self, trust: &Rows) -> Rows {
        let (mut total, mut square) = (NO_ROWS, NO_ROWS);
        let (mut mean_sum, mut mean_square) = (0.0f32, 0.0f32);
        for frame in &self.samples {
            let q = frame.pixels * frame.gain * frame.gain;
            let mut own = NO_ROWS;
            for k in 0..NO_ROWS.len() {
                let w = q * OWN[k] * trust[k] * frame.weights[k + SIDE];
                own[k] = w;
                total[k] += w;
                square[k] += w * w;
            }
            let own = sum(&own) / SAMPLES as f32;
            mean_sum += own;
            mean_square += own * own;
        }
        let usual = (mean_sum - mean_square / mean_sum.max(1e-12)).max(1e-12);
        let mut shares = NO_ROWS;
        for k in 0..NO_ROWS.len() {
            shares[k] = (total[k] - square[k] / total[k].max(1e-12)) / usual;
        }
        shares
    }

    /// The mean value of each observer, NaN where it lacks some.
    #[inline(always)]
    pub fn means<'a>(
        &mut self,
        points: &TilePoints,
        observers: impl Iterator<Item = TileObservation<'a>>,
    ) -> Vec<f64> {
        self.sample(points, observers);
        let means = self.samples.iter().map(|frame| {
            if sum(&frame.known) < frame.known.len() as f32 {
                return f64::NAN;
            }
            let mut own = NO_ROWS;
            for k in 0..NO_ROWS.len() {
                own[k] = OWN[k] * frame.values[k + SIDE];
            }
            f64::from(sum(&own)) / SAMPLES as f64
        });
        means.collect()
    }

    /// Fills [`TileWorkspace::misfits`] for a tile's observers.
    #[inline(always)]
    pub fn misfit<'a>(
        &mut self,
        points: &TilePoints,
        observers: impl Iterator<Item = TileObservation<'a>>,
        noise: &NoiseModel,
    ) {
        self.sample(points, observers);
        let precision = self.precision(noise);
        let mut texture = self.median();
        for _ in 0..REWEIGHTINGS {
            texture = self.reweight(&texture, &precision);
        }
        self.misfits.clear();
        for frame in &self.samples {
            let (mut loss, mut variance) = (NO_ROWS, NO_ROWS);
            for k in 0..NO_ROWS.len() {
                let c = k + SIDE;
                let e = frame.gain * (frame.values[c] - texture[c]);
                variance[k] = OWN[k] * frame.known[c] / precision[c];
                loss[k] = variance[k] * Loss::share(e * e, precision[c]);
            }
            let all = sum(&variance);
            self.misfits.push(Misfit {
                loss: sum(&loss) / all.max(1e-9),
                steepness: all / SAMPLES as f32,
            });
        }
    }

    /// The median of all observers, where they have values; else 0.
    #[inline(always)]
    fn median(&mut self) -> Plane {
        let mean = self.mean();
        let n = self.samples.len();
        self.sorted.clear();
        for frame in &self.samples {
            let mut values = frame.values;
            if self.gaps {
                for k in 0..ZERO.len() {
                    values[k] += (1.0 - frame.known[k]) * (mean[k] - values[k]);
                }
            }
            self.sorted.push(values);
        }
        // Odd–even transposition: all samples are sorted alike, in whole vectors.
        for round in 0..n {
            for pair in self.sorted[round % 2..].chunks_exact_mut(2) {
                let [low, high] = pair else { continue };
                for k in 0..ZERO.len() {
                    let (a, b) = (low[k], high[k]);
                    (low[k], high[k]) = (a.min(b), a.max(b));
                }
            }
        }
        let mut median = self.sorted[(n - 1) / 2];
        for (median, upper) in median.iter_mut().zip(&self.sorted[n / 2]) {
            *median = 0.5 * (*median + upper);
        }
        median
    }

    /// Counts the residuals around the plain mean, each scaled by `√(n/(n−1))` for the share of the
    /// mean that it has itself made; and the texture, if all of it is known.
    #[inline(always)]
    pub fn count_residuals<'a>(
        &mut self,
        points: &TilePoints,
        observers: impl Iterator<Item = TileObservation<'a>>,
        histogram: &mut NoiseHistogram,
        spectrum: &mut TextureSpectrum,
    ) {
        self.sample(points, observers);
        let n = self.samples.len() as f32;
        let scale = (n / (n - 1.0)).sqrt();
        let mean = self.mean();
        if !self.gaps {
            spectrum.add(&mean, self.noise_shares());
        }
        let gains: f32 = self.samples.iter().map(|frame| frame.gain.powi(2)).sum();
        let square_gain = gains / self.samples.len().max(1) as f32;
        // Of the mean: a single frame's gradient would go with its own noise.
        let squares = gradient_squares(&mean);
        for frame in &self.samples {
            for k in 0..NO_ROWS.len() {
                let c = k + SIDE;
                if OWN[k] * frame.known[c] > 0.0 {
                    let e = frame.gain * (frame.values[c] - mean[c]);
                    histogram.add(scale * e, square_gain * squares[k]);
                }
            }
        }
    }
}

/// Squared length of a texture's gradient in grey levels a sample.
#[inline(always)]
fn gradient_squares(texture: &Plane) -> Rows {
    let mut squares = NO_ROWS;
    for (k, value) in squares.iter_mut().enumerate() {
        let c = k + SIDE;
        let (left, right) = (texture[c - 1] - texture[c], texture[c + 1] - texture[c]);
        let (above, below) = (
            texture[c - SIDE] - texture[c],
            texture[c + SIDE] - texture[c],
        );
        *value = 0.5 * (left * left + right * right + above * above + below * below);
    }
    squares
}

/// Sums over a tile of the squared differences between neighbours along s and h, in the values that
/// one frame shows. NaN where it lacks one.
#[inline(always)]
pub fn slope_squares(points: &TilePoints, view: &SampledFrame, shade: f32) -> [f64; 2] {
    let mut values = ZERO;
    view.sample(points, shade, &mut values);
    let (mut along_s, mut along_h) = (NO_ROWS, NO_ROWS);
    for k in 0..NO_ROWS.len() {
        let c = k + SIDE;
        along_s[k] = OWN[k] * (values[c + 1] - values[c - 1]);
        along_h[k] = OWN[k] * (values[c + SIDE] - values[c - SIDE]);
    }
    [
        f64::from(dot(&along_s, &along_s)),
        f64::from(dot(&along_h, &along_h)),
    ]
}

/// The tile's own samples in a plane, whose ring takes its neighbours' value.
#[inline(always)]
fn with_ring(rows: &Rows) -> Plane {
    let mut plane = ZERO;
    plane[SIDE..SIDE + rows.len()].copy_from_slice(rows);
    for row in plane[SIDE..SIDE + rows.len()].chunks_exact_mut(SIDE) {
        (row[0], row[TILE + 1]) = (row[1], row[TILE]);
    }
    plane.copy_within(SIDE..2 * SIDE, 0);
    plane.copy_within(TILE * SIDE..(TILE + 1) * SIDE, (TILE + 1) * SIDE);
    plane
}

/// The first three features of a texture, `∂S/∂s, ∂S/∂h, S`, with no slope where it is not
/// `covered`.
#[inline(always)]
fn features(texture: &Plane, slopes: [f32; 2], covered: &Rows) -> [Rows; 3] {
    let mut phi = [NO_ROWS; 3];
    for k in 0..NO_ROWS.len() {
        let c = k + SIDE;
        phi[0][k] = (texture[c + 1] - texture[c - 1]) * slopes[0] * covered[k];
        phi[1][k] = (texture[c + SIDE] - texture[c - SIDE]) * slopes[1] * covered[k];
        phi[2][k] = texture[c];
    }
    phi
}

/// `Σ_x p φ φᵀ` with p zero on the ring.
#[inline(always)]
fn feature_moments(phi: &[Rows; 3], shares: &Rows) -> Matrix4<f64> {
    let mut moments = Matrix4::zeros();
    for a in 0..3 {
        let mut shared = *shares;
        for k in 0..NO_ROWS.len() {
            shared[k] *= phi[a][k];
        }
        for b in a..3 {
            moments[(a, b)] = f64::from(dot(&shared, &phi[b]));
        }
        moments[(a, 3)] = f64::from(sum(&shared));
    }
    moments[(3, 3)] = f64::from(sum(shares));
    moments.fill_lower_triangle_with_upper_triangle();
    moments
}

#[inline(always)]
fn observer_moments(
    frame: &Samples,
    phi: &[Rows; 3],
    precision: &Plane,
    [variance, trust]: [&Rows; 2],
) -> ObserverMoments {
    let (mut e, mut omega, mut w, mut we) = (NO_ROWS, NO_ROWS, NO_ROWS, NO_ROWS);
    let (mut loss, mut known) = (NO_ROWS, NO_ROWS);
    for k in 0..NO_ROWS.len() {
        let c = k + SIDE;
        e[k] = frame.gain * (frame.values[c] - phi[2][k]);
        omega[k] = OWN[k] * frame.weights[c];
        w[k] = trust[k] * omega[k];
        we[k] = w[k] * e[k];
        known[k] = OWN[k] * frame.known[c];
        // A sample without a value costs what plain noise would: losing one is no gain.
        let noise = 0.5 * variance[k];
        let cost = variance[k] * Loss::share(e[k] * e[k], precision[c]);
        loss[k] = trust[k] * (OWN[k] * noise + known[k] * (cost - noise));
    }
    let (q, a) = (f64::from(frame.pixels), f64::from(frame.gain));
    let mut square = NO_ROWS;
    for k in 0..NO_ROWS.len() {
        square[k] = omega[k] * e[k];
    }
    // w r = q a² ω τ r = q a (ω τ e).
    ObserverMoments {
        gradient: Vector4::new(
            f64::from(dot(&we, &phi[0])),
            f64::from(dot(&we, &phi[1])),
            f64::from(dot(&we, &phi[2])),
            f64::from(sum(&we)),
        ) * (q * a),
        weight: q * a * a * f64::from(sum(&w)) / SAMPLES as f64,
        cost: q * f64::from(sum(&loss)),
        square: q * f64::from(dot(&square, &e)),
        pixels: q * f64::from(sum(&known)),
        inliers: q * f64::from(sum(&omega)),
    }
}

/// Sum of products, lane by lane so that it vectorises and never depends on anything else.
#[inline(always)]
fn dot<const N: usize>(a: &[f32; N], b: &[f32; N]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for k in (0..N).step_by(LANES) {
        for lane in 0..LANES {
            sums[lane] += a[k + lane] * b[k + lane];
        }
    }
    across(sums)
}

/// Sum, likewise.
#[inline(always)]
fn sum<const N: usize>(a: &[f32; N]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for k in (0..N).step_by(LANES) {
        for lane in 0..LANES {
            sums[lane] += a[k + lane];
        }
    }
    across(sums)
}

#[inline(always)]
fn across(s: [f32; LANES]) -> f32 {
    ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::frames::GreyImage;
    use crate::refine::parameters::frame_estimate::FrameEstimate;
    use crate::refine::tiles::grid::{TileId, WallGrid};
    use crate::refine::tiles::interpolation::Interpolation;
    use crate::surface::Circle;
    use crate::trajectory::{Pose, so3};
    use nalgebra::Vector3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    /// Frames of pure noise: all slope there is, is noise.
    #[test]
    fn the_noise_of_slopes_is_known() {
        let circle = Circle::new(3.0).unwrap();
        let camera = Camera::from_vertical_fov(160, 120, 60f64.to_radians());
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let noise = Normal::new(100.0f32, 5.0).unwrap();
        let images: Vec<GreyImage> = (0..3)
            .map(|_| {
                let data = (0..160 * 120).map(|_| noise.sample(&mut rng)).collect();
                GreyImage::new(160, 120, data)
            })
            .collect();
        let views: Vec<SampledFrame> = images
            .iter()
            .enumerate()
            .map(|(k, image)| {
                let turn = Vector3::new(0.01, 0.02, 0.05) * k as f64;
                let pose = Pose::new(so3::exp(&turn), Vector3::zeros());
                SampledFrame::new(image, camera, &FrameEstimate::at(pose))
            })
            .collect();
        // A bilinear sample has 4/9 of a pixel's variance on average.
        let model = NoiseModel {
            floor: 25.0 * 4.0 / 9.0,
            steepness: 0.0,
        };
        for density in [1.0, 2.0] {
            let grid = WallGrid::new(&circle, 3.0 / camera.fy, density);
            let spacing = (grid.spacing_s_m, grid.spacing_h_m);
            let reach = (4.0 * density) as i64;
            let tiles: Vec<TilePoints> = (-reach..reach)
                .flat_map(|row| (-reach..reach).map(move |column| (row, column)))
                .map(|(row, column)| {
                    let column = column.rem_euclid(grid.columns);
                    TilePoints::new(&grid, &circle, TileId { column, row }, &mut Vec::new())
                })
                .collect();
            let seen = || {
                views.iter().map(|view| TileObservation {
                    view,
                    pixels: (1.0 / (density * density)) as f32,
                    shade: 1.0,
                })
            };
            let mut work = TileWorkspace::default();
            let (mut histogram, mut spectrum) =
                (NoiseHistogram::default(), TextureSpectrum::default());
            for points in &tiles {
                work.count_residuals(points, seen(), &mut histogram, &mut spectrum);
            }
            let denoiser = spectrum.denoiser(f64::from(model.floor), Interpolation::Bilinear);
            let mut slopes = |denoiser: Option<&Denoiser>| {
                let mut sum = 0.0;
                for points in &tiles {
                    let weighting = ResidualWeighting {
                        noise: &model,
                        variance_weighting: false,
                        denoiser,
                    };
                    work.moments(points, seen(), spacing, &weighting);
                    sum += work.found.features[(0, 0)] + work.found.features[(1, 1)];
                }
                sum
            };
            let left = slopes(Some(&denoiser)) / slopes(None);
            assert!(left < 0.1, "density {density}: {left}");
        }
    }
}
