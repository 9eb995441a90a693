//! Normal equations of one Lucas–Kanade step: affine displacement field, gain and bias.

use crate::thresholds::reference_mosaic::MIN_TEXTURE_SHARE;
use crate::tiles::residual_weighting::Loss;
use crate::validation::alignment::Alignment;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};

/// A sample of the template.
pub struct TemplateSample {
    /// The wall point, relative to the template's origin, metres.
    pub point: [f32; 3],
    /// Tangent `∂x/∂s` of the wall.
    pub e_s: [f32; 3],
    /// Tangent `∂x/∂h` of the wall.
    pub e_h: [f32; 3],
    /// The regressors 1, s, h, the latter two normalised to about −1 to 1.
    pub x: [f32; 3],
    /// Grey value.
    pub grey: f32,
    /// Slope along s and h, grey levels per pixel.
    pub slope: [f32; 2],
    /// Weight that bounds its influence.
    pub influence_weight: f32,
    /// The patch of neighbouring samples that it belongs to.
    pub patch: usize,
}

/// A sample of the template with another frame's grey value there.
pub struct SharedSample<'t> {
    /// The sample.
    pub sample: &'t TemplateSample,
    /// The other frame's grey value.
    pub value: f32,
    /// Share of the area of the template's pixel that the frame has there that resolves less of the
    /// wall: the weight by which a pixel counts once, however far away it looks.
    pub pixels: f32,
}

/// Unknowns of a step.
const UNKNOWNS: usize = 8;

/// The normal equations of one step, for displacement field, gain and bias.
pub struct AffineFit {
    /// The normal matrix N.
    n: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// The right side.
    right: SVector<f64, UNKNOWNS>,
    /// Scatter of the scores `Σ g gᵀ`, g the contribution of a patch to the right side.
    scatter: SMatrix<f64, UNKNOWNS, UNKNOWNS>,
    /// Mean `W = Σ q x xᵀ / Σ q` over the regressors, q the pixels of a sample.
    w: Matrix3<f64>,
    samples: f64,
    /// Number of patches with samples.
    patches: f64,
    /// Correlation at the present poses.
    correlation: f64,
    /// False if the slopes are mostly noise.
    has_texture: bool,
}

impl AffineFit {
    /// Linearises the samples shared with another frame, in a number of `patches`; `slope_noise`
    /// and `variance`: of the noise of a slope, and of the residuals.
    pub fn new(
        shared: &[SharedSample],
        patches: usize,
        slope_noise: f64,
        (gain, bias): (f64, f64),
        variance: f32,
        correlation: f64,
    ) -> Self {
        let mut has_samples = vec![false; patches];
        let mut scores = vec![SVector::<f64, UNKNOWNS>::zeros(); patches];
        let mut n = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
        let mut right = SVector::<f64, UNKNOWNS>::zeros();
        let mut w = Matrix3::<f64>::zeros();
        let mut weighted = Matrix3::<f64>::zeros();
        let mut pixels = 0.0;
        let (gain32, bias32) = (gain as f32, bias as f32);
        for one in shared {
            let sample = one.sample;
            let e = one.value - (gain32 * sample.grey + bias32);
            let robust = Loss::weight(e * e, 1.0 / variance);
            let omega = one.pixels * sample.influence_weight * robust;
            let x = sample.x;
            let regressors = Vector3::from(x.map(f64::from));
            let outer = regressors * regressors.transpose();
            w += f64::from(one.pixels) * outer;
            pixels += f64::from(one.pixels);
            let (gs, gh) = (gain32 * sample.slope[0], gain32 * sample.slope[1]);
            // I_b(x + d) ≈ a I_a(x) + b − a ∇I_a · δ with δ the remaining displacement, so the row
            // of δ is −a∇I_a.
            let row = SVector::<f64, UNKNOWNS>::from_column_slice(&[
                f64::from(-gs * x[0]),
                f64::from(-gs * x[1]),
                f64::from(-gs * x[2]),
                f64::from(-gh * x[0]),
                f64::from(-gh * x[1]),
                f64::from(-gh * x[2]),
                f64::from(sample.grey),
                1.0,
            ]);
            let omega = f64::from(omega);
            n += omega * row * row.transpose();
            has_samples[sample.patch] = true;
            scores[sample.patch] += omega * f64::from(e) * row;
            weighted += omega * outer;
        }
        let mut scatter = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::zeros();
        for score in &scores {
            right += score;
            scatter += score * score.transpose();
        }
        let noise = gain * gain * slope_noise * weighted[(0, 0)];
        let has_texture = [0, 3].iter().all(|k| {
            let all: f64 = n[(*k, *k)];
            all - noise > MIN_TEXTURE_SHARE * all
        });
        for k in 0..3 {
            for l in 0..3 {
                let noise = gain * gain * slope_noise * weighted[(k, l)];
                n[(k, l)] -= noise;
                n[(3 + k, 3 + l)] -= noise;
            }
        }
        Self {
            n,
            right,
            scatter,
            w: w / pixels,
            samples: shared.len() as f64,
            patches: has_samples.into_iter().filter(|has| *has).count() as f64,
            correlation,
            has_texture,
        }
    }

    /// The Gauss–Newton step; None if there is too little texture.
    pub fn step(&self) -> Option<SVector<f64, UNKNOWNS>> {
        if self.has_texture {
            Some(self.n.cholesky()?.solve(&self.right))
        } else {
            None
        }
    }

    /// The alignment where there is too little texture: unknown.
    pub fn without_texture(&self, scale: f64) -> Alignment {
        Alignment {
            error_px: 0.0,
            sigma_px: f64::INFINITY,
            ..self.alignment(&Vector6::zeros(), scale, 1.0)
        }
    }

    /// Root mean square displacement `√(pᵀWp)`, pixels of the level.
    pub fn rms(&self, p: &Vector6<f64>) -> f64 {
        let (s, h) = (p.fixed_rows::<3>(0), p.fixed_rows::<3>(3));
        (s.dot(&(self.w * s)) + h.dot(&(self.w * h)))
            .max(0.0)
            .sqrt()
    }

    /// The alignment at the field `p`; `scale`: pixels of full size per pixel of the level.
    pub fn alignment(&self, p: &Vector6<f64>, scale: f64, variance: f64) -> Alignment {
        let freedoms = self.patches - UNKNOWNS as f64;
        let square = |covariance: &SMatrix<f64, UNKNOWNS, UNKNOWNS>| {
            let of = |k| covariance.fixed_view::<3, 3>(k, k).component_mul(&self.w);
            of(0).sum() + of(3).sum()
        };
        let square = self.n.cholesky().map_or(f64::INFINITY, |n| {
            let inverse = n.inverse();
            // The fit has made the scores smaller than they are.
            let correction = self.patches / freedoms.max(0.0);
            let sandwich = inverse * self.scatter * inverse;
            square(&(variance * inverse)).max(correction * square(&sandwich))
        });
        Alignment {
            a: 0,
            b: 0,
            samples: self.samples,
            error_px: scale * self.rms(p),
            sigma_px: scale * square.sqrt(),
            freedoms,
            correlation: self.correlation,
        }
    }
}
