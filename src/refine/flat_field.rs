//! The camera's shading, from frames that see the same wall in different parts of the picture.
//!
//! The mean over all frames shows the lamp and the lens ([`Shading::of_mean`]) up to what is left
//! of the wall's texture in it: enough to place frames. On a faint wall a shading that is wrong by
//! a grey level is still steeper than the texture, and it is fixed to the camera: frames get
//! displaced for it. Where frames overlap, the wall itself tells. For a tile x and a frame i that
//! sees it at pixel `u_i(x)`, with z the mean value there by the present shading V, gain and bias,
//!
//! `ln z_i(x) = s(x) + α_i + β_i/(a_i V z_i) + Σ_k c_k B_k(u_i(x)) + noise`,
//!
//! s the logarithm of the wall, α and β what is still wrong with the frame's gain and bias, and
//! `exp(Σ c_k B_k)` what the shading lacks. Robust least squares (biweight, s eliminated) over all
//! overlaps of a run of frames gives all of them at once.
//!
//! Only the shading is taken over; the solves that follow find the rest for themselves.
//!
//! Source: D. J. Fixsen, S. H. Moseley and R. G. Arendt, "Calibrating array detectors",
//! Astrophysical Journal Supplement 128, 2000 (flat fields from pictures that show the same sky in
//! different places).

use super::neighbourhood::Neighbourhood;
use super::options::RefineOptions;
use super::problem::{Problem, ProblemError, Sampling, Scene};
use super::track::Tracked;
use crate::frames::{Agreement, MAD_TO_SIGMA, SHADING_TERMS, Shading, shading_terms};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Frames that are used, at the most: the shading is the camera's, the same in all.
pub const MOST_FRAMES: usize = 60;
/// Tiles that are used, spread over all of the run.
const TILES: usize = 1000;
/// Tiles added up at once.
const RUN: usize = 100;
/// Times that the shading is corrected with solves between, at the most.
const ROUNDS: usize = 2;
/// Steps of reweighting at the most: from equal weights it takes ten until glints weigh nothing,
/// and three leave the shading 0.7 % off.
const STEPS: usize = 30;
/// The reweighting has settled when the variance of the residuals changes by less than this share.
const SETTLED: f64 = 0.01;
/// A shading counts if it is this many times what noise makes of it, ...
const SURE: f64 = 3.0;
/// ... and a change of one that is there if it is this many times.
const WORTHWHILE: f64 = 1.5;
/// Variance of a logarithm at the least: pictures without noise.
const LEAST_VARIANCE: f64 = 1e-12;
/// Tiles darker than this tell little of a factor, grey levels.
const LEAST_GREY: f64 = 4.0;
/// Unknowns of a frame: α, β.
const OWN: usize = 2;

/// What one frame shows of a tile.
struct Glimpse {
    /// The frame, counted in the run.
    frame: usize,
    /// `B_k` there.
    terms: [f64; SHADING_TERMS],
    /// `1/(a V z)`, of the bias.
    bias: f64,
    /// `ln z`.
    log: f64,
}

/// Corrects the shading until frames agree where they overlap, solving for their poses in between.
///
/// # Errors
/// [`ProblemError`].
pub fn flatten(
    scene: &Scene,
    options: &RefineOptions,
    tracked: &mut Tracked,
) -> Result<(), ProblemError> {
    let side = scene.camera.shorter_side();
    let (coarsest, finest) = (options.coarsest_level(side), options.handover_level(side));
    for _ in 0..ROUNDS {
        if !correct(scene, options, tracked)? {
            break;
        }
        Neighbourhood::of_all(tracked).solve(scene, options, finest..=coarsest, tracked)?;
    }
    Ok(())
}

/// Corrects the shading by what the frames tell at their present poses; false if they find nothing
/// wrong.
///
/// # Errors
/// [`ProblemError`].
pub fn correct(
    scene: &Scene,
    options: &RefineOptions,
    tracked: &Tracked,
) -> Result<bool, ProblemError> {
    let level = options.handover_level(scene.camera.shorter_side());
    let count = tracked.estimates.len();
    let first = count.saturating_sub(MOST_FRAMES) / 2;
    let run = first..(first + MOST_FRAMES).min(count);
    let members = tracked.members_of(run.clone(), run.clone());
    let problem = Problem::new(scene, Sampling::of(level), members)?;
    let size = (scene.camera.width as usize, scene.camera.height as usize);
    let tiles = problem.at_tiles(TILES, |tiles: &mut Vec<Vec<Glimpse>>, look| {
        let means = look.work.means(look.points, look.seen());
        let bright = look.observers.iter().zip(means);
        let bright = bright.filter(|(_, mean)| *mean > LEAST_GREY);
        let glimpses = bright.filter_map(|(observer, mean)| {
            let frame = look.frames[observer.frame as usize];
            let pose = &tracked.estimates[run.start + frame].pose;
            let pixel = problem
                .camera_of(frame)
                .project(&pose.to_camera(&look.points.centre.x_w))?;
            let gain = f64::from(look.views[observer.frame as usize].gain() * observer.shade);
            Some(Glimpse {
                frame,
                terms: shading_terms(&pixel, size),
                bias: 1.0 / (gain * mean),
                log: mean.ln(),
            })
        });
        let glimpses: Vec<Glimpse> = glimpses.collect();
        if glimpses.len() > 1 {
            tiles.push(glimpses);
        }
    })?;
    let tiles: Vec<Vec<Glimpse>> = tiles.into_iter().flatten().collect();
    let sigma = [scene.prior.log_gain_sigma, scene.prior.bias_sigma];
    let (before, sure) = match scene.frames.shading() {
        Some(shading) => ((*shading).clone(), WORTHWHILE),
        None => (Shading::none(size), SURE),
    };
    let Some(delta) = fit(&tiles, run.len(), &sigma, sure) else {
        return Ok(false);
    };
    scene.frames.set_shading(before.changed(&delta));
    Ok(true)
}

/// Solves for `c_k`; None if they are not `sure` times what noise makes of them.
fn fit(
    tiles: &[Vec<Glimpse>],
    frames: usize,
    sigma: &[f64; OWN],
    sure: f64,
) -> Option<[f64; SHADING_TERMS]> {
    let unknowns = SHADING_TERMS + OWN * frames;
    let mut x = DVector::<f64>::zeros(unknowns);
    let mut variance = f64::INFINITY;
    let mut solved = None;
    for _ in 0..STEPS {
        let mut sums = Sums::zeros(unknowns);
        let runs = tiles.par_chunks(RUN).map(|tiles| {
            let mut sums = Sums::zeros(unknowns);
            tiles.iter().for_each(|tile| sums.add(tile, &x, variance));
            sums
        });
        for run in runs.collect::<Vec<Sums>>() {
            sums.n += run.n;
            sums.right += run.right;
            sums.sizes.extend(run.sizes);
        }
        let half = sums.sizes.len() / 2;
        sums.sizes.sort_unstable_by(f64::total_cmp);
        let before = variance;
        variance = (MAD_TO_SIGMA * sums.sizes.get(half)?)
            .powi(2)
            .max(LEAST_VARIANCE);
        sums.n.fill_lower_triangle_with_upper_triangle();
        for k in 0..unknowns {
            sums.n[(k, k)] += match k.checked_sub(SHADING_TERMS) {
                None => variance,
                Some(own) => variance / sigma[own % OWN].powi(2),
            };
        }
        let factor = sums.n.cholesky()?;
        x = factor.solve(&sums.right);
        solved = Some(factor);
        if (variance - before).abs() < SETTLED * variance {
            break;
        }
    }
    let mut unit = DMatrix::zeros(unknowns, SHADING_TERMS);
    unit.fill_diagonal(1.0);
    let noise = variance * solved?.solve(&unit).rows(0, SHADING_TERMS).trace();
    let change = x.rows(0, SHADING_TERMS).norm_squared();
    (change > sure * sure * noise).then(|| std::array::from_fn(|k| x[k]))
}

/// The normal equations of the logarithms, s eliminated.
struct Sums {
    /// Upper triangle.
    n: DMatrix<f64>,
    right: DVector<f64>,
    /// Sizes of the residuals.
    sizes: Vec<f64>,
}

impl Sums {
    fn zeros(unknowns: usize) -> Self {
        Self {
            n: DMatrix::zeros(unknowns, unknowns),
            right: DVector::zeros(unknowns),
            sizes: Vec::new(),
        }
    }

    /// Adds a tile; `x`: the solution so far, `variance`: that of the residuals.
    ///
    /// With `r_i` the rows, `y_i` the logarithms and w the weights:
    /// `N = Σ w r rᵀ − (Σ w r)(Σ w r)ᵀ/Σ w`, likewise the right side.
    fn add(&mut self, tile: &[Glimpse], x: &DVector<f64>, variance: f64) {
        let left: Vec<f64> = tile.iter().map(|glimpse| glimpse.left(x)).collect();
        let Agreement {
            sizes,
            weights,
            total,
        } = Agreement::of(&left, variance);
        self.sizes.extend(sizes);
        if total <= 0.0 {
            return;
        }
        // Σ w r, with the places of its entries, and Σ w y.
        let mut row: Vec<(usize, f64)> = (0..SHADING_TERMS).map(|k| (k, 0.0)).collect();
        let mut value = 0.0;
        for (glimpse, w) in tile.iter().zip(&weights) {
            let own = glimpse.own();
            for (a, term) in glimpse.terms.iter().enumerate() {
                let share = w * term;
                row[a].1 += share;
                self.right[a] += share * glimpse.log;
                for b in a..SHADING_TERMS {
                    self.n[(a, b)] += share * glimpse.terms[b];
                }
                for (place, regressor) in own {
                    self.n[(a, place)] += share * regressor;
                }
            }
            for (k, (place, regressor)) in own.into_iter().enumerate() {
                let share = w * regressor;
                self.right[place] += share * glimpse.log;
                for (other, regressor) in &own[k..] {
                    self.n[(place, *other)] += share * regressor;
                }
                row.push((place, share));
            }
            value += w * glimpse.log;
        }
        for (k, (a, x)) in row.iter().enumerate() {
            let share = x / total;
            self.right[*a] -= share * value;
            for (b, y) in &row[k..] {
                self.n[(*a, *b)] -= share * y;
            }
        }
    }
}

impl Glimpse {
    /// The frame's own unknowns: their places and regressors.
    fn own(&self) -> [(usize, f64); OWN] {
        let first = SHADING_TERMS + OWN * self.frame;
        [(first, 1.0), (first + 1, self.bias)]
    }

    /// `ln z` less all that is not the wall.
    fn left(&self, x: &DVector<f64>) -> f64 {
        let shading: f64 = self.terms.iter().zip(x.iter()).map(|(t, x)| t * x).sum();
        let own: f64 = self.own().iter().map(|(place, r)| r * x[*place]).sum();
        self.log - shading - own
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{FrameCache, GreyImage, Pyramid};
    use crate::refine::test_scene::{prior, scene, tracked};
    use crate::test_wall::{TestWall, waves};
    use crate::trajectory::spiral;
    use nalgebra::Vector2;
    use rand::{Rng, SeedableRng};

    /// Two and a half turns past a wall in a light that depends on the pixel, and exposures that
    /// depend on the frame.
    fn corrected(light: fn(f64, f64) -> f64) -> Option<impl Fn(f64, f64) -> f64> {
        let mut wall = TestWall::ring(waves);
        wall.poses = spiral(30, 0.05, 30f64.to_radians());
        let pictures = wall.frames().into_iter().enumerate().map(|(k, frame)| {
            let (w, h) = (frame.width(), frame.height());
            let gain = 1.0 + 0.2 * (1.7 * k as f64).sin();
            let lit = frame.data().iter().enumerate().map(|(n, value)| {
                let (u, v) = ((n % w) as f64 / w as f64, (n / w) as f64 / h as f64);
                (gain * light(u, v) * f64::from(*value)) as f32
            });
            Pyramid::new(GreyImage::new(w, h, lit.collect()), 1)
        });
        let frames = FrameCache::of_pyramids(pictures.collect());
        let prior = prior(&wall.poses);
        let scene = scene(&wall, &frames, &prior);
        let tracked = tracked(&wall.poses);
        let any = correct(&scene, &RefineOptions::default(), &tracked).unwrap();
        assert_eq!(any, frames.shading().is_some());
        let shading = frames.shading()?;
        let (w, h) = (f64::from(wall.camera.width), f64::from(wall.camera.height));
        Some(move |u, v| shading.at(&Vector2::new(u * w, v * h)))
    }

    #[test]
    fn a_lamp_is_found_where_frames_overlap() {
        let lamp = |u: f64, v: f64| (1.0 + 0.8 * ((u - 0.6).powi(2) + (v - 0.4).powi(2))).powi(-2);
        let found = corrected(lamp).unwrap();
        let middle = found(0.5, 0.5) / lamp(0.5, 0.5);
        // Closer to the corners there is no tile that a frame sees all of.
        for (u, v) in [(0.1, 0.1), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9), (0.5, 0.1)] {
            let ratio = found(u, v) / lamp(u, v) / middle;
            assert!((ratio - 1.0).abs() < 0.01, "{u} {v}: {ratio}");
        }
    }

    /// A third of what the middle of the frames shows is glints, which only ever brighten.
    #[test]
    fn glints_leave_no_trace() {
        let (frames, size) = (8, (64, 48));
        let truth: [f64; SHADING_TERMS] = std::array::from_fn(|k| 0.1 / (1.0 + k as f64));
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let tiles: Vec<Vec<Glimpse>> = (0..600)
            .map(|tile| {
                let glimpses = (0..5).map(|k| {
                    let [u, v]: [f64; 2] = std::array::from_fn(|_| rng.random_range(0.0..1.0));
                    let terms = shading_terms(&Vector2::new(63.0 * u, 47.0 * v), size);
                    let light: f64 = truth.iter().zip(&terms).map(|(c, term)| c * term).sum();
                    let noise = rng.random_range(-0.002..0.002);
                    let middle = (u - 0.5).hypot(v - 0.5) < 0.3;
                    let glint = if middle && rng.random_range(0..3) == 0 {
                        rng.random_range(0.0..0.5)
                    } else {
                        0.0
                    };
                    Glimpse {
                        frame: (tile + k) % frames,
                        terms,
                        bias: 0.01,
                        log: 4.6 + light + noise + glint,
                    }
                });
                glimpses.collect()
            })
            .collect();
        let found = fit(&tiles, frames, &[0.3, 3.0], SURE).unwrap();
        let none = Shading::none(size);
        let differs = none.changed(&found).differs(&none.changed(&truth));
        assert!(differs < 0.001, "{differs}");
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
        let (frames, size) = (8, (64, 48));
        let lamp = |u: f64, v: f64| (1.0 + 0.8 * ((u - 0.6).powi(2) + (v - 0.4).powi(2))).powi(-2);
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(11);
        let found: Vec<[f64; SHADING_TERMS]> = (0..DRAWS)
            .map(|_| {
                let tiles: Vec<Vec<Glimpse>> = (0..1000)
                    .map(|tile| {
                        let wall = rng.random_range(95.0..105.0);
                        let glimpses = (0..5).map(|k| {
                            let [u, v]: [f64; 2] =
                                std::array::from_fn(|_| rng.random_range(0.0..1.0));
                            let known = lamp(u, v);
                            let noise = rng.sample::<f64, _>(rand_distr::StandardNormal);
                            let value = wall + noise / known;
                            Glimpse {
                                frame: (tile + k) % frames,
                                terms: shading_terms(&Vector2::new(63.0 * u, 47.0 * v), size),
                                bias: 1.0 / (known * value),
                                log: value.ln(),
                            }
                        });
                        let mut glimpses: Vec<Glimpse> = glimpses.collect();
                        glimpses.sort_by_key(|glimpse| glimpse.frame);
                        glimpses
                    })
                    .collect();
                fit(&tiles, frames, &[0.3, 10.0], 0.0).unwrap()
            })
            .collect();
        let (mut square, mut expected) = (0.0, 0.0);
        for k in 0..SHADING_TERMS {
            let mean = found.iter().map(|c| c[k]).sum::<f64>() / DRAWS as f64;
            let spread = found.iter().map(|c| (c[k] - mean).powi(2)).sum::<f64>();
            square += mean * mean;
            expected += spread / ((DRAWS - 1) * DRAWS) as f64;
        }
        assert!(square < 3.0 * expected, "{square} {expected}");
    }

    #[test]
    fn even_light_is_left_alone() {
        assert!(corrected(|_, _| 1.0).is_none());
    }
}
