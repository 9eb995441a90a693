//! Test of the prior: refined steps against initial ones.
//!
//! The prior says how far the initial poses are off. Where frames are placed by their pixels, their
//! refined poses show how far they are: errors e of the steps of a random walk, or of the poses
//! themselves, each with the variance σ² that the prior states, less what the refined pose is
//! uncertain by.
//!
//! - **Scale.** Pictures show lengths in units of the radius only, so a radius that is wrong makes
//!   all refined steps d wrong by one factor. With the initial steps `d̂` its estimate is
//!   `f = Σ d̂ᵀΣ⁻¹d / Σ d̂ᵀΣ⁻¹d̂`, with the variance `1/Σ d̂ᵀΣ⁻¹d̂ + s²`, s what odometers and
//!   plans are usually wrong by ([`SCALE_SIGMA`]).
//! - **σ.** `q = Σ e²/σ²` is χ² with as many degrees of freedom as there are errors; `σ √(q/n)`
//!   would fit. Rotations count together, as the prior has one σ for them, translations axis by
//!   axis.
//! - **Runs.** Errors that alternate or persist follow the other model: steps between independent
//!   errors have the serial correlation `r = Σ e_k e_k+1/Σ e²` of −½, and independent errors that
//!   are a random walk one near 1. Of n independent errors, r has the variance 1/n.
//!
//! Each test has its share of the survey's false-alarm rate.
//!
//! Source: M. S. Bartlett, "On the theoretical specification and sampling properties of
//! autocorrelated time-series", Supplement to the Journal of the Royal Statistical Society 8(1),
//! 1946 (serial correlation).

use crate::model::prior::Prior;
use crate::model::prior_terms::{absolute_error, relative_error};
use crate::parameters::calibration::Datum;
use crate::thresholds::prior_test::{MAX_SIGMA_RATIO, SCALE_SIGMA};
use crate::uncertainty::covariance::Covariances;
use nalgebra::{Matrix3, Vector3, Vector6};
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::significance::{chi_squared_bounds, normal_quantile};
use tunnelstitch_geometry::trajectory::{JitterModel, Pose};

/// Tests of the prior: scale, four σ, runs.
const TESTS: usize = 6;

/// Names of the σ of the prior, as survey.toml has them.
const NAMES: [&str; 4] = [
    "rotation_sigma_deg",
    "translation_sigma_m[0]",
    "translation_sigma_m[1]",
    "translation_sigma_m[2]",
];

/// The outcome of the tests of the prior.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PriorTest {
    /// Refined over initial steps.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub scale: Option<ScaleTest>,
    /// σ of the prior that the errors contradict.
    pub sigmas: Vec<SigmaTest>,
    /// True if signs of errors alternate or persist, as by the other model of the prior.
    pub other_model: bool,
    /// Contradictions between the prior and the refined poses, in sentences.
    pub findings: Vec<String>,
}

/// Lengths of a survey, as given.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct GivenLengths {
    /// Radius of the tunnel, metres.
    pub radius_m: f64,
    /// Length of a unit of the initial poses, metres, if they have no scale of their own.
    pub unscaled_unit_m: Option<f64>,
}

/// Refined steps over initial ones.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ScaleTest {
    /// The factor f.
    pub factor: f64,
    /// Its 1-σ by the prior's noise.
    pub sigma: f64,
    /// True if it is not 1, by more than odometers are wrong by.
    pub contradicts: bool,
}

/// A σ of the prior that the errors contradict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SigmaTest {
    /// Its name in `[prior]`.
    pub name: String,
    /// As given, in the unit of its name.
    pub given: f64,
    /// The value that fits.
    pub fits: f64,
}

/// An error of a step or a pose.
struct PriorError {
    /// The error, σ of the prior each.
    e: Vector6<f64>,
    /// Share of its variance that shows, 0 to 1: that of the prior less that of the refined pose.
    shown: Vector6<f64>,
    /// Initial step, or position relative to the mean, σ of the prior along each axis.
    d: Vector3<f64>,
}

impl PriorTest {
    /// Tests the prior on the frames that are placed. `estimates` and `covariances` are aligned
    /// with the initial poses along the gauge; `alpha`: rate of false alarms.
    pub fn new(
        prior: &Prior,
        (datum, lengths): (&Datum, GivenLengths),
        poses: &[Pose],
        covariances: &Covariances,
        placed: &[bool],
        alpha: f64,
    ) -> Self {
        let errors = errors(prior, datum, poses, covariances, placed);
        let sigmas = (0..NAMES.len()).filter_map(|k| test_sigma(prior, &errors, k, alpha));
        let expects_walk = prior.jitter.model == JitterModel::RandomWalk;
        let mut test = Self {
            scale: test_scale(&errors, alpha),
            sigmas: sigmas.collect(),
            other_model: runs_contradict(&errors, expects_walk, alpha),
            findings: Vec::new(),
        };
        test.findings = test.explain(lengths, prior.jitter.model);
        test
    }

    /// The scale, if it contradicts the prior: lengths of the result cannot be believed.
    pub fn contradicting_scale(&self) -> Option<ScaleTest> {
        self.scale.filter(|scale| scale.contradicts)
    }

    /// The contradictions in sentences.
    fn explain(&self, lengths: GivenLengths, model: JitterModel) -> Vec<String> {
        let mut findings = Vec::new();
        if let Some(scale) = self.contradicting_scale() {
            findings.push(scale.explain(lengths));
        }
        for sigma in &self.sigmas {
            findings.push(format!(
                "[prior] {} = {:.3} is too {}: the refined poses fit {:.3}",
                sigma.name,
                sigma.given,
                if sigma.fits > sigma.given {
                    "small"
                } else {
                    "large"
                },
                sigma.fits
            ));
        }
        if self.other_model {
            findings.push(match model {
                JitterModel::RandomWalk => {
                    "errors of consecutive steps alternate: [prior] model = \"independent\" fits \
                     better than \"random-walk\""
                        .to_owned()
                }
                JitterModel::Independent => {
                    "errors of neighbouring poses go together: [prior] model = \"random-walk\" \
                     fits better than \"independent\""
                        .to_owned()
                }
            });
        }
        findings
    }
}

/// Factor over its σ below which it is none: refined steps then go anywhere.
const MIN_FACTOR_SIGMAS: f64 = 3.0;

impl ScaleTest {
    /// The contradiction, and the slip that has its factor.
    pub fn explain(&self, lengths: GivenLengths) -> String {
        let Self { factor, sigma, .. } = self;
        let GivenLengths {
            radius_m,
            unscaled_unit_m,
        } = lengths;
        if *factor < MIN_FACTOR_SIGMAS * sigma {
            return format!(
                "refined steps do not follow the initial ones: they are {factor:.2} ± {sigma:.2} \
                 times as long in the same direction"
            );
        }
        if let Some(unit_m) = unscaled_unit_m {
            let unit_m = unit_m * factor;
            return format!(
                "refined steps are {factor:.2} ± {sigma:.2} times the initial ones, which have no \
                 scale of their own: if radius_m is right, a unit of the poses is about \
                 {unit_m:.4} m (tunnelstitch init --force --radius-m {radius_m} --unit-m \
                 {unit_m:.4} writes it, with the axis)"
            );
        }
        let is_near = |value: f64| (factor / value).ln().abs() < 3.0 * sigma / factor + 0.05;
        let slip = if is_near(2.0) {
            ", as with a diameter for the radius"
        } else if is_near(0.5) {
            ", as with half the radius, or with steps counted twice"
        } else if is_near(3.2808) || is_near(0.3048) {
            ", as with feet for metres"
        } else if is_near(std::f64::consts::TAU) {
            ", as with a circumference for the radius"
        } else {
            ""
        };
        format!(
            "refined steps are {factor:.2} ± {sigma:.2} times the initial ones{slip}: if the poses \
             are right, radius_m is about {:.2}",
            radius_m / factor
        )
    }
}

/// The errors that placed frames show.
fn errors(
    prior: &Prior,
    datum: &Datum,
    poses: &[Pose],
    covariances: &Covariances,
    placed: &[bool],
) -> Vec<PriorError> {
    let r = prior.jitter.rotation_sigma_rad;
    let [x, y, z] = prior.jitter.translation_sigma_m;
    let sigma = Vector6::new(r, r, r, x, y, z);
    let initial: Vec<Pose> = prior
        .initial
        .iter()
        .map(|pose| datum.to_tunnel(pose))
        .collect();
    // Of a rig, the noise is that of its first camera.
    let is_tested = |k: &usize| placed[*k] && !prior.is_related(*k);
    let chosen: Vec<usize> = (0..poses.len()).filter(is_tested).collect();
    match prior.jitter.model {
        JitterModel::RandomWalk => {
            let pairs = chosen.iter().filter(|k| **k > 0 && placed[**k - 1]);
            let of_pair = |&k: &usize| {
                let (before, own) = (&poses[k - 1], &poses[k]);
                let (first, start) = prior.first_of_moment(k - 1, before, datum.scale);
                let initial = [&initial[first], &initial[k]];
                let (e, ..) = relative_error(initial[0], initial[1], &start, own, datum.scale);
                let sigma = sigma * prior.steps_between(k - 1, k).sqrt();
                // The earlier rotation's error in the later camera's axes.
                let turn = own.r_wc.inverse() * before.r_wc;
                let carry = |covariance: &nalgebra::Matrix6<f64>| {
                    let mut t = nalgebra::Matrix6::identity();
                    let turn: Matrix3<f64> = turn.to_rotation_matrix().into_inner();
                    t.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
                    t * covariance
                };
                let crossed = carry(&covariances.next[k - 1]);
                let earlier = carry(&carry(&covariances.frames[k - 1]).transpose());
                let variance =
                    (covariances.frames[k] + earlier - crossed - crossed.transpose()).diagonal();
                let step = initial[1].t_wc - initial[0].t_wc;
                PriorError::new(&e, &variance, &step, &sigma)
            };
            pairs.map(of_pair).collect()
        }
        JitterModel::Independent => {
            let mean = |of: &dyn Fn(usize) -> Vector3<f64>| {
                let sum: Vector3<f64> = chosen.iter().map(|k| of(*k)).sum();
                sum / chosen.len().max(1) as f64
            };
            let middle = mean(&|k| initial[k].t_wc);
            let of_frame = |&k: &usize| {
                let (e, _) = absolute_error(&initial[k], &poses[k], datum.scale);
                let variance = covariances.frames[k].diagonal();
                let sigma = sigma * prior.variance_ratios[k].sqrt();
                PriorError::new(&e, &variance, &(initial[k].t_wc - middle), &sigma)
            };
            chosen.iter().map(of_frame).collect()
        }
    }
}

impl PriorError {
    fn new(
        e: &Vector6<f64>,
        variance: &Vector6<f64>,
        d: &Vector3<f64>,
        sigma: &Vector6<f64>,
    ) -> Self {
        let shown = |share: f64| {
            if share.is_finite() {
                (1.0 - share).max(0.0)
            } else {
                0.0
            }
        };
        Self {
            e: e.component_div(sigma),
            shown: variance
                .component_div(&sigma.component_mul(sigma))
                .map(shown),
            d: d.component_div(&sigma.fixed_rows::<3>(3)),
        }
    }

    /// The components that a σ of the prior is for: three rotations, or one translation.
    fn of_sigma(k: usize) -> std::ops::Range<usize> {
        if k == 0 { 0..3 } else { 2 + k..3 + k }
    }
}

/// Estimates the factor of scale; None without motion.
fn test_scale(errors: &[PriorError], alpha: f64) -> Option<ScaleTest> {
    let (mut product, mut square) = (0.0, 0.0);
    for error in errors {
        product += error.d.dot(&error.e.fixed_rows::<3>(3));
        square += error.d.norm_squared();
    }
    let sigma = f64::sqrt(1.0 / square);
    let z = (product / square).abs() / sigma.hypot(SCALE_SIGMA);
    (square > 0.0).then_some(ScaleTest {
        factor: 1.0 + product / square,
        sigma,
        contradicts: z > normal_quantile(0.5 * alpha, TESTS),
    })
}

/// Tests one σ of the prior; None if the errors do not contradict it by more than
/// [`MAX_SIGMA_RATIO`].
fn test_sigma(prior: &Prior, errors: &[PriorError], k: usize, alpha: f64) -> Option<SigmaTest> {
    let (mut q, mut freedoms) = (0.0, 0.0);
    for error in errors {
        for component in PriorError::of_sigma(k) {
            q += error.e[component].powi(2);
            freedoms += error.shown[component];
        }
    }
    let (low, high) = chi_squared_bounds(alpha / TESTS as f64, freedoms)?;
    let allowed = MAX_SIGMA_RATIO * MAX_SIGMA_RATIO;
    let contradicts = q / allowed > high || q * allowed < low;
    let given = match k {
        0 => prior.jitter.rotation_sigma_rad.to_degrees(),
        k => prior.jitter.translation_sigma_m[k - 1],
    };
    contradicts.then(|| SigmaTest {
        name: NAMES[k].to_owned(),
        given,
        fits: given * (q / freedoms).sqrt(),
    })
}

/// True if errors alternate (under a random walk) or persist (under independent errors).
fn runs_contradict(errors: &[PriorError], expects_walk: bool, alpha: f64) -> bool {
    let products = errors.windows(2).map(|pair| pair[0].e.dot(&pair[1].e));
    let square: f64 = errors.iter().map(|error| error.e.norm_squared()).sum();
    let correlation = products.sum::<f64>() / square;
    let shown: f64 = errors.iter().map(|error| error.shown.sum()).sum();
    let z = correlation * shown.sqrt();
    let towards_other = if expects_walk { -z } else { z };
    towards_other > normal_quantile(alpha, TESTS)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::calibration::{Calibration, Kappa};
    use nalgebra::Matrix6;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use tunnelstitch_geometry::camera::Camera;
    use tunnelstitch_geometry::trajectory::{Jitter, spiral};

    const COUNT: usize = 30;

    fn prior(model: JitterModel, rotation_sigma_rad: f64) -> Prior {
        Prior {
            jitter: Jitter {
                model,
                rotation_sigma_rad,
                translation_sigma_m: [0.02, 0.03, 0.02],
            },
            initial: spiral(COUNT, 0.1, 30f64.to_radians()),
            times_s: (0..COUNT).map(|k| k as f64).collect(),
            median_step_s: 1.0,
            variance_ratios: vec![1.0; COUNT],
            rig: None,
            log_gain_sigma: 0.3,
            bias_sigma: 10.0,
        }
    }

    /// Refined poses whose errors are as a prior with 0.03 rad and (0.02, 0.03, 0.02) m says, all
    /// lengths along the tunnel multiplied by `scale`.
    fn poses(is_walk: bool, scale: f64, seed: u64) -> Vec<Pose> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |sigma: f64| -> f64 {
            let normal: f64 = StandardNormal.sample(&mut rng);
            sigma * normal
        };
        let initial = spiral(COUNT, 0.1, 30f64.to_radians());
        let mut poses: Vec<Pose> = Vec::new();
        for k in 0..COUNT {
            let mut xi = Vector6::zeros();
            for (n, sigma) in [0.03, 0.03, 0.03, 0.02, 0.03, 0.02].into_iter().enumerate() {
                xi[n] = draw(sigma);
            }
            let mut expected = match poses.last() {
                Some(last) if is_walk => {
                    crate::model::prior::predict(last, &initial[k - 1], &initial[k])
                }
                _ => initial[k],
            };
            if is_walk && k > 0 {
                expected.t_wc.y += (scale - 1.0) * 0.1;
            }
            poses.push(expected.retract(&xi));
        }
        poses
    }

    fn test(prior: &Prior, poses: &[Pose]) -> PriorTest {
        let covariances = Covariances {
            frames: vec![Matrix6::identity() * 1e-8; COUNT],
            next: vec![Matrix6::zeros(); COUNT - 1],
            variance_factor: 1.0,
        };
        let calibration = Calibration::none(Camera::from_vertical_fov(160, 120, 1.0));
        let datum = calibration.datum(&Kappa::zeros());
        PriorTest::new(
            prior,
            (
                &datum,
                GivenLengths {
                    radius_m: 6.0,
                    unscaled_unit_m: None,
                },
            ),
            poses,
            &covariances,
            &[true; COUNT],
            1e-3,
        )
    }

    #[test]
    fn a_right_prior_passes() {
        for seed in 0..40 {
            for model in [JitterModel::RandomWalk, JitterModel::Independent] {
                let poses = poses(model == JitterModel::RandomWalk, 1.0, seed);
                let found = test(&prior(model, 0.03), &poses);
                assert!(found.findings.is_empty(), "{seed}: {found:?}");
            }
        }
    }

    #[test]
    fn a_diameter_for_the_radius_is_named() {
        let model = JitterModel::RandomWalk;
        let found = test(&prior(model, 0.03), &poses(true, 2.0, 5));
        assert!(found.scale.unwrap().contradicts, "{found:?}");
        let text = found.findings.join("\n");
        assert!(
            text.contains("radius_m is about") && text.contains("diameter"),
            "{text}"
        );
        // Poses without a scale of their own say nothing of the radius.
        let text = found.scale.unwrap().explain(GivenLengths {
            radius_m: 6.0,
            unscaled_unit_m: Some(0.5),
        });
        assert!(
            text.contains("--radius-m 6 --unit-m") && !text.contains("diameter"),
            "{text}"
        );
    }

    #[test]
    fn a_sigma_three_times_too_small_or_large_is_named_with_the_value_that_fits() {
        for factor in [3.0, 1.0 / 3.0] {
            let model = JitterModel::RandomWalk;
            let found = test(&prior(model, 0.03 * factor), &poses(true, 1.0, 7));
            let [sigma] = &found.sigmas[..] else {
                panic!("{found:?}");
            };
            assert_eq!(sigma.name, "rotation_sigma_deg");
            assert!(
                (sigma.fits / 0.03f64.to_degrees() - 1.0).abs() < 0.2,
                "{sigma:?}"
            );
        }
    }

    #[test]
    fn the_other_model_is_named() {
        let walk = test(&prior(JitterModel::RandomWalk, 0.03), &poses(false, 1.0, 9));
        assert!(walk.other_model);
        let independent = test(&prior(JitterModel::Independent, 0.03), &poses(true, 1.0, 9));
        assert!(independent.other_model);
    }
}
