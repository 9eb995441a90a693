//! The objective of the estimator, and the moments by which a tile enters it.
//!
//! # Objective
//!
//! The parameters are the poses `T_i`, log-gains `α_i` and biases `b_i` of the frames, the texture
//! S of the wall, and the shared parameters κ if they are estimated. The estimator minimises
//!
//! `E = 1/(σ_u² c) Σ_x Σ_i q_i τ(x) ρ(e_i(x); v(x))`   (pixels)
//! `  + ½ Σ_k ε_kᵀ Σ_k⁻¹ ε_k`   (poses)
//! `  + ½ Σ_i (α_i²/σ_α² + b_i²/σ_b²)`   (exposures)
//! `  + ½ Σ_j κ_j²/σ_j² − (3N − 1) ln r`   (shared parameters)
//!
//! over the wall samples x of the selected tiles and the frames i that observe them:
//!
//! - **Residual** `e_i = I_i(π(T_i⁻¹ X(x))) − b_i − a_i S(x) = a_i r_i`, grey levels of the frame,
//!   with the gain `a_i = exp(α_i) V` (V: the camera's shading there), `z_i = (I_i − b_i)/a_i` and
//!   `r_i = z_i − S`. In the frame's own grey levels all frames have equal noise; in those of the
//!   wall a large gain would hide any residual.
//! - **Loss** ρ: Tukey's biweight with `c² = 36 v`; `ρ ≈ e²/2` for small e, and constant, `c²/6`,
//!   beyond c. Its weight is `ω(e) = ρ'(e)/e` ([`crate::tiles::residual_weighting`]).
//! - **Variance** `v(x) = σ_s² + κ_v g²`, common to all frames, with g the smallest gradient of the
//!   frames there, or the second smallest of many
//!   ([`crate::tiles::residual_weighting::NoiseModel`]). `σ_s²` is the variance of an
//!   interpolated sample; a pixel has the variance `σ² = σ_s²/β(0)²`, β(0) the kernel's
//!   autocorrelation along one axis
//!   ([`crate::tiles::interpolation::Interpolation::autocorrelation`]).
//! - **Variance weighting** `τ(x) = σ_s²/v(x)` in the last solves, else 1. Aliasing makes the
//!   residuals at edges large; without τ the sharpest edges would dominate.
//! - **Unit variance** `σ_u²`: σ² with variance weighting, else the variance of unit weight
//!   ([`crate::tiles::residual_weighting::NoiseHistogram::unit_variance`]); and the **dispersion**
//!   c of the residuals, 1 unless they show errors of the model
//!   ([`crate::model::context::EstimationContext::dispersion`]).
//! - **Pixels per sample** `q_i`: the area of a sample in frame i, so that every pixel counts once
//!   ([`crate::samples::observer::Observer`]).
//! - **Gaps**: a sample without a value (clipped pixels) has `ω = 0` and costs `ρ = v/2`, as much
//!   as plain noise; losing a sample is no gain. Tiles in which a frame does not show the wall are
//!   excluded for that frame ([`crate::samples::outlier_mask`]).
//! - **Prior** of the poses: `ε_k` are the errors of poses or steps, `Σ_k` their variance
//!   ([`crate::model::prior::Prior`]).
//! - **Shared parameters**: their prior, and, if the radius r is estimated, the logarithm of the
//!   volume that pixels leave to the positions of the N compared frames
//!   ([`crate::problem::photometric_problem::PhotometricProblem::log_volume_slope`]).
//!
//! The noise model, q, V and the set of observations stay constant during a solve, so that the cost
//! before and after a step is of the same samples. v and τ are computed anew from the frames'
//! values at every estimate; the derivatives treat them as constant.
//!
//! # Elimination of the texture
//!
//! For given frames the minimising texture is the robust weighted mean
//!
//! `S(x) = Σ_i w_i z_i / Σ_i w_i`,   `w_i = q_i a_i² ω(e_i) τ`,
//!
//! so S is eliminated (variable projection). It is computed by a fixed number of reweighting steps
//! from the plain mean; `Σ_i w_i r_i = 0` holds exactly at every sample.
//!
//! # Linearisation
//!
//! If frame i moves by ξ, the pixel that observes x shows the wall at `x − A_i ξ`, with
//! `A_i = ∂(s, h)/∂ξ` ([`tunnelstitch_geometry::surface::wall_jacobian`]). Hence
//! `∂e_i/∂ξ = −a_i ∇Sᵀ A_i`, `∂e_i/∂α_i = −a_i S` and `∂e_i/∂b_i = −1`. With the features
//! `φ(x) = (∂S/∂s, ∂S/∂h, S, 1)`, common to all frames,
//!
//! `∂e_i = −a_i φ(x)ᵀ B_i`,   `B_i = diag(A_i, 1, 1/a_i)`  (4 × 8).
//!
//! The slopes are those of the fused texture, not of each frame. The noise of a frame's own
//! gradient would add to the diagonal blocks of the normal matrix but not to the others, and the
//! weak modes of the trajectory would become stiff. At full size the slopes are those of the
//! denoised texture ([`crate::tiles::denoising`]).
//!
//! `A_i` is nearly constant within a tile, so that the normal equations need only its moments:
//!
//! - `g_i = Σ_x w_i r_i φ` (4): the gradient of E for frame i is `−B_iᵀ g_i / σ²`, summed over
//!   tiles;
//! - `w̄_i`: mean of `w_i` over the tile's samples;
//! - `M = Σ_x p φ φᵀ` (4 × 4), with `p(x)` the trace of the bracket, `Σ_i w_i − Σ_i w_i²/Σ_i w_i`,
//!   at x over that of the mean weights.
//!
//! Elimination of S leaves the Gauss–Newton matrix
//!
//! `H_ij = (w̄_i δ_ij − w̄_i w̄_j / Σ_k w̄_k) B_iᵀ M B_j / σ²`.
//!
//! Rows of the bracket sum to zero, so a motion of all frames of a tile alike costs nothing: the
//! gauge directions are exact null vectors of the pixels' part.
//!
//! Walls with edges that are sharp against a pixel need more than the mean of the frames: there the
//! wall replaces S, and `Σ_x q_i τ ρ` becomes a sum over pixels,
//! [`crate::joint::joint_block`].

use crate::tiles::denoising::Denoiser;
use crate::tiles::grid::{LANES, Plane, SIDE, TilePoints};
use crate::tiles::lanes::load;
use crate::tiles::residual_weighting::{Loss, NoiseModel};
use crate::tiles::tile_arrays::{INTERIOR, Rows, SAMPLES, ZERO_ROWS, add_lanes, sum};
use crate::tiles::tile_moments::{ObserverMoments, feature_moments, features};
use crate::tiles::workspace::{FrameValues, TileObservation, TileWorkspace};
use nalgebra::Vector4;

/// Weighting of the residuals and denoising of the slopes.
#[derive(Clone, Copy)]
pub struct ResidualWeighting<'a> {
    /// Variance v of the residuals.
    pub noise: &'a NoiseModel,
    /// True for `τ = σ_s²/v`, false for `τ = 1`.
    pub variance_weighting: bool,
    /// Filter of S for its slopes.
    pub denoiser: Option<&'a Denoiser>,
}

// Everything here is inlined into its caller, which is compiled for the processor's widest vectors.
impl TileWorkspace {
    /// Fills [`TileWorkspace::moments`] from a tile's observations.
    ///
    /// `spacing_m`: distance between samples along s and h, metres.
    #[inline(always)]
    pub fn compute_moments<'a>(
        &mut self,
        points: &TilePoints,
        observations: impl Iterator<Item = TileObservation<'a>>,
        spacing_m: (f64, f64),
        weighting: &ResidualWeighting,
    ) {
        self.sample(points, observations);
        self.compute_sampled_moments(spacing_m, weighting);
    }

    /// Fills [`TileWorkspace::moments`] from the observers that are sampled.
    #[inline(always)]
    pub fn compute_sampled_moments(
        &mut self,
        spacing_m: (f64, f64),
        weighting: &ResidualWeighting,
    ) {
        let ResidualWeighting {
            noise,
            variance_weighting,
            denoiser,
        } = *weighting;
        let precision = self.precision(noise);
        let mean = self.mean();
        let texture = self.robust_mean(mean, &precision);
        let slopes = [spacing_m.0, spacing_m.1].map(|spacing_m| (0.5 / spacing_m) as f32);
        let covered = self.covered();
        let mut phi = features(&texture, slopes, &covered);
        if let Some(denoiser) = denoiser {
            let clean = denoiser.apply(&texture, self.noise_gain());
            let denoised = features(&clean, slopes, &covered);
            (phi[0], phi[1]) = (denoised[0], denoised[1]);
        }
        let mut variance = ZERO_ROWS;
        let mut tau = [1.0; ZERO_ROWS.len()];
        for k in 0..ZERO_ROWS.len() {
            variance[k] = 1.0 / precision[k + SIDE];
            if variance_weighting {
                tau[k] = noise.floor * precision[k + SIDE];
            }
        }
        let information = self.information(&tau);
        self.moments.features = feature_moments(&phi, &information);
        self.moments.observers.clear();
        for frame in &self.frames {
            let moments = observer_moments(frame, &phi, &precision, [&variance, &tau]);
            self.moments.observers.push(moments);
        }
    }

    /// Share p of each sample in the information: the trace of the bracket, `Σ w − Σ w²/Σ w`, at
    /// the sample over that of the mean weights.
    ///
    /// Where the loss rejects all frames but one (a glint, say), the texture is that frame's own
    /// and carries no information, however steep it is.
    #[inline(always)]
    fn information(&self, tau: &Rows) -> Rows {
        let (mut total, mut square) = (ZERO_ROWS, ZERO_ROWS);
        let (mut mean_sum, mut mean_square) = (0.0f32, 0.0f32);
        for frame in &self.frames {
            let q = frame.pixels * frame.gain * frame.gain;
            let mut own = ZERO_ROWS;
            for k in 0..ZERO_ROWS.len() {
                let w = q * INTERIOR[k] * tau[k] * frame.weights[k + SIDE];
                own[k] = w;
                total[k] += w;
                square[k] += w * w;
            }
            let own = sum(&own) / SAMPLES as f32;
            mean_sum += own;
            mean_square += own * own;
        }
        let at_mean = (mean_sum - mean_square / mean_sum.max(1e-12)).max(1e-12);
        let mut information = ZERO_ROWS;
        for k in 0..ZERO_ROWS.len() {
            information[k] = (total[k] - square[k] / total[k].max(1e-12)) / at_mean;
        }
        information
    }
}

/// Moments of one observer.
#[inline(always)]
fn observer_moments(
    frame: &FrameValues,
    phi: &[Rows; 3],
    precision: &Plane,
    [variance, tau]: [&Rows; 2],
) -> ObserverMoments {
    let (mut g, mut w_sum, mut cost) = ([[0.0; LANES]; 4], [0.0; LANES], [0.0; LANES]);
    let (mut square, mut pixels, mut inliers) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for k in (0..ZERO_ROWS.len()).step_by(LANES) {
        let c = k + SIDE;
        let (z, omega, valid) = (
            load(&frame.values, c),
            load(&frame.weights, c),
            load(&frame.valid, c),
        );
        let (p, v, t, interior) = (
            load(precision, c),
            load(variance, k),
            load(tau, k),
            load(&INTERIOR, k),
        );
        let (s, h, texture) = (load(&phi[0], k), load(&phi[1], k), load(&phi[2], k));
        for l in 0..LANES {
            let e = frame.gain * (z[l] - texture[l]);
            let omega = interior[l] * omega[l];
            let w = t[l] * omega;
            let we = w * e;
            g[0][l] += we * s[l];
            g[1][l] += we * h[l];
            g[2][l] += we * texture[l];
            g[3][l] += we;
            w_sum[l] += w;
            square[l] += omega * e * e;
            inliers[l] += omega;
            let valid = interior[l] * valid[l];
            pixels[l] += valid;
            let noise = 0.5 * v[l];
            let loss = v[l] * Loss::relative_loss(e * e, p[l]);
            cost[l] += t[l] * (interior[l] * noise + valid * (loss - noise));
        }
    }
    let (q, a) = (f64::from(frame.pixels), f64::from(frame.gain));
    // w r = q a² ω τ r = q a (ω τ e).
    ObserverMoments {
        gradient: Vector4::from_fn(|k, _| f64::from(add_lanes(g[k]))) * (q * a),
        weight: q * a * a * f64::from(add_lanes(w_sum)) / SAMPLES as f64,
        cost: q * f64::from(add_lanes(cost)),
        square: q * f64::from(add_lanes(square)),
        pixels: q * f64::from(add_lanes(pixels)),
        inliers: q * f64::from(add_lanes(inliers)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::frame_estimate::FrameEstimate;
    use crate::tiles::denoising::TextureSpectrum;
    use crate::tiles::frame_samples::SampledFrame;
    use crate::tiles::grid::{TileId, WallGrid};
    use crate::tiles::residual_weighting::NoiseHistogram;
    use nalgebra::Vector3;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};
    use tunnelstitch_core::frames::GreyImage;
    use tunnelstitch_geometry::camera::Camera;
    use tunnelstitch_geometry::surface::Circle;
    use tunnelstitch_geometry::trajectory::{Pose, so3};

    /// σ of a pixel of [`noisy_images`].
    const SIGMA_GREY: f32 = 5.0;
    /// Share of a pixel's variance that a bilinear sample has, on average.
    const SAMPLE_SHARE: f32 = 4.0 / 9.0;

    fn camera() -> Camera {
        Camera::from_vertical_fov(160, 120, 60f64.to_radians())
    }

    /// Three frames of pure noise.
    fn noisy_images() -> Vec<GreyImage> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let noise = Normal::new(100.0, SIGMA_GREY).unwrap();
        let mut image = || {
            let data = (0..160 * 120).map(|_| noise.sample(&mut rng)).collect();
            GreyImage::new(160, 120, data)
        };
        (0..3).map(|_| image()).collect()
    }

    /// The images, taken one after another by a camera that turns a little.
    fn turned(images: &[GreyImage]) -> Vec<SampledFrame<'_>> {
        let sampled = |(k, image)| {
            let turn = Vector3::new(0.01, 0.02, 0.05) * k as f64;
            let pose = Pose::new(so3::exp(&turn), Vector3::zeros());
            SampledFrame::new(image, camera(), &FrameEstimate::at(pose))
        };
        images.iter().enumerate().map(sampled).collect()
    }

    /// Tiles of a lattice around the middle of the view.
    fn tiles(grid: &WallGrid, circle: &Circle) -> Vec<TilePoints> {
        let reach = (4.0 * grid.density) as i64;
        (-reach..reach)
            .flat_map(|row| (-reach..reach).map(move |column| (row, column)))
            .map(|(row, column)| {
                let column = column.rem_euclid(grid.columns);
                TilePoints::new(grid, circle, TileId { column, row }, &mut Vec::new())
            })
            .collect()
    }

    /// σ of a pixel by the residuals of the images.
    fn residual_sigma(images: &[GreyImage]) -> f32 {
        let circle = Circle::new(3.0).unwrap();
        let grid = WallGrid::new(&circle, 3.0 / camera().fy, 1.0);
        let frames = turned(images);
        let mut histogram = NoiseHistogram::default();
        let mut workspace = TileWorkspace::default();
        for points in tiles(&grid, &circle) {
            let observations = frames.iter().map(|frame| TileObservation {
                frame,
                pixels: 1.0,
                shade: 1.0,
            });
            workspace.count_residuals(&points, observations, &mut histogram, None);
        }
        (histogram.fit().floor / SAMPLE_SHARE).sqrt()
    }

    /// Wall that one frame alone has a value of has no residual.
    #[test]
    fn noise_is_that_of_values_of_several_frames() {
        let whole = noisy_images();
        let mut with_gaps = whole.clone();
        for image in &mut with_gaps[1..] {
            for (n, value) in image.data_mut().iter_mut().enumerate() {
                if n % 160 > 75 {
                    *value = f32::NAN;
                }
            }
        }
        let [whole, with_gaps] = [whole, with_gaps].map(|images| residual_sigma(&images));
        assert!((whole / SIGMA_GREY - 1.0).abs() < 0.25, "{whole}");
        assert!((with_gaps / whole - 1.0).abs() < 0.1, "{with_gaps} {whole}");
    }

    /// Frames of pure noise, whose slopes are noise alone.
    #[test]
    fn denoised_slopes_of_pure_noise_vanish() {
        let circle = Circle::new(3.0).unwrap();
        let images = noisy_images();
        let frames = turned(&images);
        let model = NoiseModel {
            floor: SIGMA_GREY * SIGMA_GREY * SAMPLE_SHARE,
            steepness: 0.0,
        };
        for density in [1.0, 2.0] {
            let grid = WallGrid::new(&circle, 3.0 / camera().fy, density);
            let spacing = (grid.spacing_s_m, grid.spacing_h_m);
            let tiles = tiles(&grid, &circle);
            let observations = || {
                frames.iter().map(|frame| TileObservation {
                    frame,
                    pixels: (1.0 / (density * density)) as f32,
                    shade: 1.0,
                })
            };
            let mut workspace = TileWorkspace::default();
            let (mut histogram, mut spectrum) =
                (NoiseHistogram::default(), TextureSpectrum::default());
            for points in &tiles {
                let spectrum = Some(&mut spectrum);
                workspace.count_residuals(points, observations(), &mut histogram, spectrum);
            }
            let denoiser = spectrum.denoiser();
            let mut slopes = |denoiser: Option<&Denoiser>| {
                let mut sum = 0.0;
                for points in &tiles {
                    let weighting = ResidualWeighting {
                        noise: &model,
                        variance_weighting: false,
                        denoiser,
                    };
                    workspace.compute_moments(points, observations(), spacing, &weighting);
                    sum += workspace.moments.features[(0, 0)] + workspace.moments.features[(1, 1)];
                }
                sum
            };
            let left = slopes(Some(&denoiser)) / slopes(None);
            assert!(left < 0.1, "density {density}: {left}");
        }
    }
}
