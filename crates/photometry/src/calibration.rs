//! Robust solution of the photometric calibration.

use super::normal_equations::{LightMatrix, NormalEquations, Solution};
use super::observation::{LIGHT_TERMS, LinearisedPoint, Observation, Unknowns};
use super::priors::Priors;
use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;
use tunnelstitch_core::frames::{LAMP_TERMS, Lamp, SHADING_TERMS, Shading};
use tunnelstitch_geometry::numerics::median::MAD_TO_SIGMA;

/// Reweighting iterations at the most: it takes ten until glints weigh nothing, and three leave the
/// shading 0.7 % off.
const MAX_REWEIGHTING_ITERATIONS: usize = 30;
/// Relative change of the residuals' variance below which the reweighting has settled.
const SETTLED_VARIANCE_CHANGE: f64 = 0.01;
/// Smallest variance of the residuals, grey levels², for pictures without noise: keeps the priors
/// above the rounding errors of the normal matrix.
const MIN_VARIANCE_GREY2: f64 = 1e-6;
/// Parts of the wall points that are added up at once: a fixed number, so that sums do not depend
/// on the number of threads.
const PARTS: usize = 16;

/// Corrections of the known gains, biases, shading and lamp.
#[derive(Clone, Debug)]
pub struct PhotometricCalibration {
    /// `α_i`: logarithms of the frames' gains.
    pub log_gains: Vec<f64>,
    /// `β_i`: biases of the frames, grey levels.
    pub biases: Vec<f64>,
    /// `c_k`: coefficients of the logarithmic shading.
    pub shading: [f64; SHADING_TERMS],
    /// Changes of the lamp's unknowns; zero without a lamp.
    pub lamp: [f64; LAMP_TERMS],
    /// Variance of the residuals, grey levels².
    pub variance: f64,
    /// Covariance C of the light's unknowns: `c_k`, then the lamp's.
    covariance: LightMatrix,
}

impl PhotometricCalibration {
    /// Calibrates `frames` frames of the size of `known`, the shading that is known already beside
    /// the `lamp`, by their observations of wall `points`; `None` if no point is observed twice or
    /// the normal matrix is not positive definite.
    ///
    /// The prior holds for all of the shading, what is known included. Noise is independent from
    /// point to point, but what the model leaves out (things that are not of the wall, wall that is
    /// misregistered, other light) is as smooth as the shading: a frame has [`SHADING_TERMS`] of
    /// such errors at the most, and no more independent readings of the shading, however many
    /// points it observes. With n observations by m frames the prior therefore has
    /// `n/(m SHADING_TERMS)` times its weight. A direction of the shading that the overlaps hardly
    /// determine, such as that along the tunnel in a single turn, then stays at the prior: no
    /// shading.
    pub fn solve(
        points: &[Vec<Observation>],
        frames: usize,
        known: &Shading,
        lamp: Option<&Lamp>,
        priors: &Priors,
    ) -> Option<Self> {
        let size = known.size();
        let lamp = lamp.map_or([0.0; LAMP_TERMS], Lamp::unknowns);
        let known = std::array::from_fn(|k| match k.checked_sub(SHADING_TERMS) {
            Some(term) => lamp[term],
            None => known.coefficients()[k],
        });
        let mut x = Unknowns::zeros(frames);
        let mut variance = f64::INFINITY;
        let mut solution = None;
        for _ in 0..MAX_REWEIGHTING_ITERATIONS {
            let mut sums = Sums::of(points, size, &x, variance);
            let before = variance;
            variance = sums.variance()?;
            let independent = (frames * SHADING_TERMS) as f64;
            let weight = (sums.sizes.len() as f64 / independent).max(1.0);
            let priors = Priors {
                shading_sigma: priors.shading_sigma / weight.sqrt(),
                lamp_sigma: priors.lamp_sigma / weight.sqrt(),
                ..*priors
            };
            let solved = sums.normal.solve(&priors, variance, &known)?;
            x.clone_from(&solved.x);
            solution = Some(solved);
            if (variance - before).abs() < SETTLED_VARIANCE_CHANGE * variance {
                break;
            }
        }
        solution.map(|solution| Self::new(&solution, variance))
    }

    fn new(solution: &Solution, variance: f64) -> Self {
        let Unknowns { frames, light } = &solution.x;
        Self {
            log_gains: frames.iter().map(|[log_gain, _]| *log_gain).collect(),
            biases: frames.iter().map(|[_, bias]| *bias).collect(),
            shading: std::array::from_fn(|k| light[k]),
            lamp: std::array::from_fn(|k| light[SHADING_TERMS + k]),
            variance,
            covariance: variance * solution.light_cofactors(),
        }
    }

    /// True if the light is changed by more than `sigmas` times as much as noise alone changes it:
    /// `cᵀ C⁻¹ c > sigmas² K` with K unknowns, for noise alone `χ²` with a mean of K; the lamp's
    /// unknowns count where there `is_lamp`.
    ///
    /// Each direction counts by its own accuracy. A shading as a common bias behind a lamp makes it
    /// is hardly determined, and must not hide errors of one that is.
    pub fn is_light_significant(&self, sigmas: f64, is_lamp: bool) -> bool {
        if is_lamp {
            let [shading, lamp] = [&self.shading[..], &self.lamp[..]];
            let all = SVector::from_iterator(shading.iter().chain(lamp).copied());
            is_significant::<LIGHT_TERMS>(&all, &self.covariance, sigmas)
        } else {
            let shading = SVector::from(self.shading);
            let covariance = self
                .covariance
                .fixed_view::<SHADING_TERMS, SHADING_TERMS>(0, 0);
            is_significant(&shading, &covariance.into_owned(), sigmas)
        }
    }
}

/// True if `xᵀ C⁻¹ x > sigmas² K`.
fn is_significant<const K: usize>(
    x: &SVector<f64, K>,
    covariance: &SMatrix<f64, K, K>,
    sigmas: f64,
) -> bool {
    let square = covariance.cholesky().map(|factor| x.dot(&factor.solve(x)));
    square.is_some_and(|square| square > sigmas * sigmas * K as f64)
}

/// Normal equations and residuals of some wall points.
struct Sums {
    normal: NormalEquations,
    /// Sizes of the residuals.
    sizes: Vec<f64>,
}

impl Sums {
    /// The sums of all points; `x`: the solution so far, `variance`: that of the residuals.
    fn of(points: &[Vec<Observation>], size: (usize, usize), x: &Unknowns, variance: f64) -> Self {
        let zeros = || Self {
            normal: NormalEquations::zeros(x.frames.len()),
            sizes: Vec::new(),
        };
        let parts: Vec<Self> = points
            .par_chunks(points.len().div_ceil(PARTS).max(1))
            .map(|points| {
                let mut sums = zeros();
                for point in points.iter().filter(|point| point.len() > 1) {
                    sums.add(point, size, x, variance);
                }
                sums
            })
            .collect();
        let mut all = zeros();
        for part in parts {
            all.normal.merge(part.normal);
            all.sizes.extend(part.sizes);
        }
        all
    }

    fn add(&mut self, point: &[Observation], size: (usize, usize), x: &Unknowns, variance: f64) {
        let LinearisedPoint { rows, robust } = LinearisedPoint::new(point, size, x, variance);
        self.sizes.extend(&robust.sizes);
        if robust.total > 0.0 {
            self.normal.add(&rows, &robust.weights, robust.total);
        }
    }

    /// Variance of the residuals, by their median; `None` if there are none.
    fn variance(&mut self) -> Option<f64> {
        let half = self.sizes.len() / 2;
        if self.sizes.is_empty() {
            return None;
        }
        let (_, median, _) = self.sizes.select_nth_unstable_by(half, f64::total_cmp);
        Some((MAD_TO_SIGMA * *median).powi(2).max(MIN_VARIANCE_GREY2))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector2;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use tunnelstitch_core::frames::{CameraLight, Shading, shading_terms};

    const FRAMES: usize = 8;
    const SIZE: (usize, usize) = (64, 48);
    const PRIORS: Priors = Priors {
        log_gain_sigma: 0.3,
        bias_sigma_grey: 10.0,
        shading_sigma: 0.5,
        lamp_sigma: 0.5,
    };

    /// Frames of a wall with a known truth.
    struct Simulated {
        /// Range of the wall's grey values.
        wall: std::ops::Range<f64>,
        truth: Unknowns,
        /// The known factor by the place in the picture, 0 to 1.
        known: fn(f64, f64) -> f64,
        noise_grey: f64,
        /// A third of what the middle of the frames shows is glints, which only ever brighten.
        glints: bool,
    }

    impl Simulated {
        fn plain() -> Self {
            Self {
                wall: 60.0..140.0,
                truth: Unknowns::zeros(FRAMES),
                known: |_, _| 1.0,
                noise_grey: 1.0,
                glints: false,
            }
        }

        fn points(&self, count: usize, rng: &mut ChaCha8Rng) -> Vec<Vec<Observation>> {
            let point = |point: usize| {
                let wall = rng.random_range(self.wall.clone());
                let seen = (0..5).filter_map(|k| {
                    let [u, v]: [f64; 2] = std::array::from_fn(|_| rng.random_range(0.0..1.0));
                    let frame = (point + k) % FRAMES;
                    let pixel = [63.0 * u, 47.0 * v];
                    let terms = shading_terms(&Vector2::from(pixel), SIZE);
                    let shading = terms.iter().zip(&self.truth.light);
                    let light: f64 = shading.map(|(t, c)| t * c).sum();
                    let [log_gain, bias] = self.truth.frames[frame];
                    let factor = (self.known)(u, v);
                    let noise = self.noise_grey * rng.sample::<f64, _>(rand_distr::StandardNormal);
                    let middle = (u - 0.5).hypot(v - 0.5) < 0.3;
                    let glint = if self.glints && middle && rng.random_range(0..3) == 0 {
                        rng.random_range(1.0..1.6)
                    } else {
                        1.0
                    };
                    let grey = factor * wall * glint * (log_gain + light).exp() + bias + noise;
                    let value = (grey / factor) as f32;
                    Observation::new(frame, pixel.map(|x| x as f32), value, factor as f32)
                });
                seen.collect()
            };
            (0..count).map(point).collect()
        }

        fn solve(&self, count: usize, rng: &mut ChaCha8Rng) -> PhotometricCalibration {
            let points = self.points(count, rng);
            PhotometricCalibration::solve(&points, FRAMES, &Shading::none(SIZE), None, &PRIORS)
                .unwrap()
        }
    }

    fn differs(found: &[f64; SHADING_TERMS], truth: &[f64; SHADING_TERMS]) -> f64 {
        let none = Shading::none(SIZE);
        let place = |k: usize, steps: usize, of: usize| (k * (of - 1)) as f64 / steps as f64;
        let pixels = (0..25 * 33)
            .map(|k| Vector2::new(place(k % 33, 32, SIZE.0), place(k / 33, 24, SIZE.1)));
        let light = |coefficients| CameraLight::common(none.changed(coefficients));
        light(found).relative_difference(&light(truth), pixels.map(|pixel| (0, pixel)))
    }

    #[test]
    fn gains_biases_and_shading_are_recovered() {
        let mut simulated = Simulated {
            known: |u, _| 1.0 - 0.3 * u,
            noise_grey: 0.2,
            ..Simulated::plain()
        };
        for (k, own) in simulated.truth.frames.iter_mut().enumerate() {
            *own = [0.2 * (1.7 * k as f64).sin(), 3.0 * (2.3 * k as f64).cos()];
        }
        let shading = std::array::from_fn(|k| 0.05 / (1.0 + k as f64));
        simulated.truth.light[..SHADING_TERMS].copy_from_slice(&shading);
        let found = simulated.solve(4000, &mut ChaCha8Rng::seed_from_u64(2));
        // A common factor belongs to the wall.
        let truth = &simulated.truth.frames;
        let mean = |gains: &mut dyn Iterator<Item = f64>| gains.sum::<f64>() / FRAMES as f64;
        let common =
            mean(&mut found.log_gains.iter().copied()) - mean(&mut truth.iter().map(|t| t[0]));
        for (k, [log_gain, bias]) in truth.iter().enumerate() {
            let off = found.log_gains[k] - common - log_gain;
            assert!(off.abs() < 0.005, "gain of frame {k} off by {off}");
            let off = found.biases[k] - bias;
            assert!(off.abs() < 0.3, "bias of frame {k} off by {off}");
        }
        let off = differs(&found.shading, &shading);
        assert!(off < 0.005, "shading off by {off}");
        assert!(found.is_light_significant(3.0, false));
    }

    /// Frames of a wall without bias, taken in the light that is known already: neither shading nor
    /// bias is left to find. Over many draws of the noise, what is found must average to zero
    /// within its standard error: `‖mean‖²` is expected to be `Σ_k Var(c_k)/n`.
    ///
    /// A regressor that contains the measured value carries its noise to both sides of the
    /// equation, which looks like a bias, and behind a known shading like a change of the shading.
    #[test]
    fn noise_is_taken_for_neither_bias_nor_shading() {
        const DRAWS: usize = 12;
        let simulated = Simulated {
            wall: 95.0..105.0,
            known: |u, v| (1.0 + 0.8 * ((u - 0.6).powi(2) + (v - 0.4).powi(2))).powi(-2),
            ..Simulated::plain()
        };
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let found: Vec<PhotometricCalibration> = (0..DRAWS)
            .map(|_| simulated.solve(1000, &mut rng))
            .collect();
        let squares = |count: usize, of: &dyn Fn(&PhotometricCalibration, usize) -> f64| {
            let (mut square, mut expected) = (0.0, 0.0);
            for k in 0..count {
                let mean = found.iter().map(|found| of(found, k)).sum::<f64>() / DRAWS as f64;
                let spread: f64 = found
                    .iter()
                    .map(|found| (of(found, k) - mean).powi(2))
                    .sum();
                square += mean * mean;
                expected += spread / ((DRAWS - 1) * DRAWS) as f64;
            }
            [square, expected]
        };
        let [square, expected] = squares(SHADING_TERMS, &|found, k| found.shading[k]);
        let [square_bias, expected_bias] = squares(FRAMES, &|found, k| found.biases[k]);
        assert!(square < 3.0 * expected, "shading {square} {expected}");
        assert!(
            square_bias < 3.0 * expected_bias,
            "bias {square_bias} {expected_bias}"
        );
        // The stated variance is that of the draws.
        let stated = found[0]
            .covariance
            .fixed_view::<SHADING_TERMS, SHADING_TERMS>(0, 0)
            .trace()
            / DRAWS as f64;
        assert!(
            (0.5..2.0).contains(&(stated / expected)),
            "{stated} {expected}"
        );
        let significant = found
            .iter()
            .filter(|found| found.is_light_significant(1.5, false));
        assert_eq!(significant.count(), 0);
    }

    #[test]
    fn glints_leave_no_trace() {
        let mut simulated = Simulated {
            wall: 99.0..101.0,
            noise_grey: 0.1,
            glints: true,
            ..Simulated::plain()
        };
        let truth = std::array::from_fn(|k| 0.1 / (1.0 + k as f64));
        simulated.truth.light[..SHADING_TERMS].copy_from_slice(&truth);
        let found = simulated.solve(600, &mut ChaCha8Rng::seed_from_u64(5));
        let off = differs(&found.shading, &truth);
        assert!(off < 0.001, "{off}");
    }

    #[test]
    fn points_seen_once_calibrate_nothing() {
        let once = Observation::new(0, [3.0, 4.0], 100.0, 1.0).unwrap();
        let points = [vec![once], Vec::new()];
        assert!(
            PhotometricCalibration::solve(&points, 1, &Shading::none(SIZE), None, &PRIORS)
                .is_none()
        );
        assert!(
            PhotometricCalibration::solve(&[], 1, &Shading::none(SIZE), None, &PRIORS).is_none()
        );
    }
}
