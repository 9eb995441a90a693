//! Correction of the camera's light by frames that see the same wall in different parts of the
//! picture.
//!
//! The mean over all frames shows the lamp and the lens ([`Shading::of_mean`]) up to what is left
//! of the wall's texture in it: enough to register frames. On a faint wall a shading that is wrong
//! by a grey level is still steeper than the texture, and it is fixed to the camera: frames get
//! displaced by it. Where frames overlap, the wall itself determines the shading
//! ([`tunnelstitch_photometry`]): an observation is the mean value z of a tile in a frame by the
//! present bias and the present factor `f = a_i V`.
//!
//! A lamp that moves with the camera lights the wall by its distance, and so by the frame's pose
//! ([`Lamp`]): what frames off the axis show tells it from a shading, once their poses are good.
//!
//! Only the light is taken over; the solves that follow estimate gains and biases themselves.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::model::significance::chi_squared_bounds;
use crate::options::RefineOptions;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use crate::solver::neighbourhood::Neighbourhood;
use crate::thresholds::tracking::MAX_TRACKING_ITERATIONS;
use nalgebra::{Vector2, Vector3};
use std::ops::Range;
use std::sync::Arc;
use tunnelstitch_core::frames::{
    CameraLight, Falloff, LAMP_TERMS, Lamp, Light, SHADING_TERMS, Shading, noise_sigma,
};
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::mean_radius_m;
use tunnelstitch_geometry::trajectory::Pose;
use tunnelstitch_photometry::{Observation, PhotometricCalibration, Priors};

/// Frames that the shading is estimated from, at the most: it is the same in all.
pub const MAX_SHADING_FRAMES: usize = 60;
/// Tiles that the shading is estimated from, spread over all of these frames.
const MAX_SHADING_TILES: usize = 1000;
/// Size of a new shading over its 1-σ from noise above which it is taken over: three σ.
const MIN_SIGNIFICANCE_SIGMA: f64 = 3.0;
/// Size of a change of an existing shading over its 1-σ from noise above which it is taken over. It
/// has 27 coefficients, so that the square has the distribution `χ²/27`, whose 99.9 % quantile is
/// 55.5/27.
const MIN_CHANGE_SIGNIFICANCE_SIGMA: f64 = 1.43;

/// Corrects the light until frames agree where they overlap, solving for their poses in between;
/// returns frames and pixels at which wall was observed last.
///
/// # Errors
/// [`ProblemError`].
pub fn correct_until_settled(
    context: &EstimationContext,
    options: &RefineOptions,
    frames: &mut FrameStates,
) -> Result<Vec<(usize, Vector2<f64>)>, ProblemError> {
    let side = context.camera.shorter_side();
    let (coarsest, finest) = (options.coarsest_level(side), options.handover_level(side));
    let mut observed = Vec::new();
    for _ in 0..MAX_TRACKING_ITERATIONS {
        let views = TileViews::observe(context, options, frames)?;
        observed = views.pixels();
        if !correct(context, &views, frames) {
            break;
        }
        Neighbourhood::of_all(frames).solve(context, options, finest..=coarsest, frames)?;
    }
    Ok(observed)
}

/// Corrects the light by what overlapping frames show at their present poses, if something
/// significant is wrong with it.
///
/// # Errors
/// [`ProblemError`].
pub fn correct_once(
    context: &EstimationContext,
    options: &RefineOptions,
    frames: &FrameStates,
) -> Result<(), ProblemError> {
    let views = TileViews::observe(context, options, frames)?;
    correct(context, &views, frames);
    Ok(())
}

/// Looks for a lamp that moves with the camera, at the frames' present poses, and takes it over if
/// frames agree better with one beside a shading than with a shading alone, by more than chance,
/// and to less than the noise of a pixel. Returns that noise, 1-σ in grey levels; None if there is
/// no lamp.
///
/// # Errors
/// [`ProblemError`].
pub fn find_lamp(
    context: &EstimationContext,
    options: &RefineOptions,
    frames: &FrameStates,
) -> Result<Option<f64>, ProblemError> {
    let before = context.frames.light();
    let shading = match &before {
        Light::Shaded(light) => light.shading.clone(),
        Light::Even | Light::Normalised => Shading::none(picture_size(context)),
    };
    if matches!(before, Light::Normalised) {
        context.frames.set_light(Light::Even);
    }
    let views = TileViews::observe(context, options, frames)?;
    let noise = median_noise(context)?;
    let lamp = lamp_beside(shading, &views, context, options);
    let lamp = lamp.filter(|(_, found)| found.variance.sqrt() < noise);
    match lamp {
        Some((light, _)) => {
            light.take_over(context, frames);
            Ok(Some(noise))
        }
        None => {
            context.frames.set_light(before);
            Ok(None)
        }
    }
}

/// The lamp by which frames agree best, with its calibration; None if they do as well without.
fn lamp_beside(
    shading: Shading,
    views: &TileViews,
    context: &EstimationContext,
    options: &RefineOptions,
) -> Option<(LightModel, PhotometricCalibration)> {
    let dark = LightModel {
        shading,
        lamp: None,
    };
    let (_, without) = dark.refined(views)?;
    let at_camera = LightModel {
        lamp: Some(Lamp::at_camera(mean_radius_m(context.surface.as_ref()))),
        ..dark
    };
    let mut lit = at_camera.refined(views)?;
    for _ in 1..MAX_TRACKING_ITERATIONS {
        lit = lit.0.refined(views)?;
    }
    let gain = views.independent() * (without.variance / lit.1.variance).ln();
    let (_, least) = chi_squared_bounds(2.0 * options.false_alarm_rate, LAMP_TERMS as f64)?;
    (gain > least).then_some(lit)
}

/// Median noise of the frames that the light is estimated from, 1-σ in grey levels.
fn median_noise(context: &EstimationContext) -> Result<f64, ProblemError> {
    let frames: Vec<usize> = calibrated_frames(context.frames.frames()).collect();
    let noises = frames.par_map(|k| Ok(noise_sigma(context.frames.get(*k)?.level(0))));
    let noises: Vec<Option<f64>> = noises.into_iter().collect::<Result<_, ProblemError>>()?;
    Ok(upper_median(noises.into_iter().flatten().collect()).unwrap_or_default())
}

/// The frames that the light is estimated from, of `count`: the middle ones.
fn calibrated_frames(count: usize) -> Range<usize> {
    let first = count.saturating_sub(MAX_SHADING_FRAMES) / 2;
    first..(first + MAX_SHADING_FRAMES).min(count)
}

/// Width and height of the frames, pixels.
fn picture_size(context: &EstimationContext) -> (usize, usize) {
    let camera = &context.camera;
    (camera.width as usize, camera.height as usize)
}

/// Corrects the light by what overlapping frames show; false if nothing significant is wrong with
/// it. A lamp's light over a frame is that of the frame's present pose.
fn correct(context: &EstimationContext, views: &TileViews, frames: &FrameStates) -> bool {
    let (before, sigmas) = match context.frames.light() {
        Light::Shaded(light) => (LightModel::of(&light), MIN_CHANGE_SIGNIFICANCE_SIGMA),
        Light::Even => {
            let shading = Shading::none(picture_size(context));
            let none = LightModel {
                shading,
                lamp: None,
            };
            (none, MIN_SIGNIFICANCE_SIGMA)
        }
        Light::Normalised => return false,
    };
    let Some((after, found)) = before.refined(views) else {
        return false;
    };
    let is_changed = found.is_light_significant(sigmas, before.lamp.is_some());
    if is_changed {
        after.take_over(context, frames);
    } else if before.lamp.is_some() {
        before.take_over(context, frames);
    }
    is_changed
}

/// A shading that all frames have in common, and a lamp, if there is one.
struct LightModel {
    shading: Shading,
    lamp: Option<Lamp>,
}

impl LightModel {
    fn of(light: &CameraLight) -> Self {
        Self {
            shading: light.shading.clone(),
            lamp: light.lamp.as_ref().map(|(lamp, _)| *lamp),
        }
    }

    /// The light by which frames agree best where they overlap, linearised at this one, with its
    /// calibration; None if they do not overlap.
    fn refined(&self, views: &TileViews) -> Option<(Self, PhotometricCalibration)> {
        let observe = |view: &TileView| view.observation(self, &views.poses[view.frame]);
        let points: Vec<Vec<Observation>> = (views.tiles.iter())
            .map(|tile| tile.iter().filter_map(observe).collect())
            .collect();
        let (frames, lamp) = (views.poses.len(), self.lamp.as_ref());
        let priors = Priors::default();
        let found = PhotometricCalibration::solve(&points, frames, &self.shading, lamp, &priors)?;
        let refined = Self {
            shading: self.shading.changed(&found.shading),
            lamp: self.lamp.map(|lamp| lamp.changed(&found.lamp)),
        };
        Some((refined, found))
    }

    /// Makes it the light that frames are divided by: each by that at its present pose, or, if it
    /// has none yet, at its initial one.
    fn take_over(self, context: &EstimationContext, frames: &FrameStates) {
        let falloffs = |lamp: Lamp| {
            let initial = context.prior.initial.iter().enumerate();
            let pose = |(k, initial): (usize, &Pose)| {
                (frames.estimates.get(k)).map_or(*initial, |known| known.pose)
            };
            let poses: Vec<Pose> = initial.map(pose).collect();
            let surface = context.surface.as_ref();
            let falloff = |pose: &Pose| Falloff::new(&lamp, surface, &context.camera, pose);
            (lamp, poses.par_map(falloff))
        };
        let light = CameraLight {
            shading: self.shading,
            lamp: self.lamp.map(falloffs),
        };
        context.frames.set_light(Light::Shaded(Arc::new(light)));
    }
}

/// A tile in a frame.
struct TileView {
    /// The frame, counted from the first that the light is estimated from.
    frame: usize,
    /// Its centre, pixels of the full-size frame.
    pixel: Vector2<f64>,
    /// Its centre, metres.
    x_w: Vector3<f64>,
    /// The wall's unit normal there.
    normal: Vector3<f64>,
    /// Mean grey value, without the frame's bias.
    grey: f64,
    /// The frame's gain.
    gain: f64,
}

impl TileView {
    /// Its observation of the light beside `light`, seen from `pose`.
    fn observation(&self, light: &LightModel, pose: &Pose) -> Option<Observation> {
        let Self { x_w, normal, .. } = self;
        let of_lamp = |lamp: &Lamp| {
            (
                lamp.log_at(pose, x_w, normal),
                lamp.terms(pose, x_w, normal),
            )
        };
        let (log, terms) = light.lamp.as_ref().map(of_lamp).unwrap_or_default();
        let factor = self.gain * (light.shading.log_at(&self.pixel) + log).exp();
        let pixel = [self.pixel.x as f32, self.pixel.y as f32];
        let value = (self.grey / factor) as f32;
        let seen = Observation::new(self.frame, pixel, value, factor as f32)?;
        Some(seen.with_lamp(terms))
    }
}

/// Tiles spread over all of the wall, as the frames show them that the light is estimated from.
struct TileViews {
    /// The views of each tile.
    tiles: Vec<Vec<TileView>>,
    /// The first of these frames.
    first: usize,
    /// Their poses.
    poses: Vec<Pose>,
}

impl TileViews {
    /// Observes tiles at the frames' present poses.
    fn observe(
        context: &EstimationContext,
        options: &RefineOptions,
        frames: &FrameStates,
    ) -> Result<Self, ProblemError> {
        let range = calibrated_frames(frames.estimates.len());
        let level = options.handover_level(context.camera.shorter_side());
        let window = frames.window_of(range.clone(), range.clone());
        let problem = PhotometricProblem::new(context, Sampling::of(level), window)?;
        let estimates = frames.estimates[range.clone()].iter();
        let poses: Vec<Pose> = estimates.map(|estimate| estimate.pose).collect();
        let tiles = problem.gather_from_tiles(
            MAX_SHADING_TILES,
            |tiles: &mut Vec<Vec<TileView>>, tile| {
                let means = tile.workspace.mean_values(tile.points, tile.observations());
                let (x_w, normal) = (tile.points.centre.x_w, tile.points.centre.normal());
                let seen = tile.observers.iter().zip(means);
                let views = seen.filter_map(|(observer, mean)| {
                    let frame = tile.participants[observer.frame as usize];
                    let camera = problem.camera_of(frame);
                    let gain = tile.sampled_frames[observer.frame as usize].gain();
                    Some(TileView {
                        frame,
                        pixel: camera.project(&poses[frame].to_camera(&x_w))?,
                        x_w,
                        normal,
                        grey: mean * f64::from(gain * observer.shade),
                        gain: f64::from(gain),
                    })
                });
                tiles.push(views.collect());
            },
        )?;
        Ok(Self {
            tiles: tiles.into_iter().flatten().collect(),
            first: range.start,
            poses,
        })
    }

    /// Frames and pixels at which wall is observed.
    fn pixels(&self) -> Vec<(usize, Vector2<f64>)> {
        let views = self.tiles.iter().flatten();
        views
            .map(|view| (self.first + view.frame, view.pixel))
            .collect()
    }

    /// Number of independent readings of the light: a frame has as many as there are terms of the
    /// shading, however many tiles it shows ([`PhotometricCalibration::solve`]).
    fn independent(&self) -> f64 {
        (self.poses.len() * SHADING_TERMS) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::{frame_states, independent_prior, test_context};
    use nalgebra::Vector6;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};
    use tunnelstitch_core::frames::{FrameCache, GreyImage, Pyramid};
    use tunnelstitch_core::test_wall::{TestWall, waves};
    use tunnelstitch_geometry::surface::Surface;
    use tunnelstitch_geometry::trajectory::spiral;

    /// Five turns past a wall in a light that depends on the pixel, and exposures that
    /// depend on the frame.
    fn corrected(light: fn(f64, f64) -> f64) -> Option<impl Fn(f64, f64) -> f64> {
        let mut wall = TestWall::ring(waves);
        wall.poses = spiral(60, 0.05, 30f64.to_radians());
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
        let prior = independent_prior(&wall.poses);
        let context = test_context(&wall, &frames, &prior);
        let states = frame_states(&wall.poses);
        let views = TileViews::observe(&context, &RefineOptions::default(), &states).unwrap();
        let any = correct(&context, &views, &states);
        assert_eq!(any, frames.camera_light().is_some());
        let light = frames.camera_light()?;
        let (w, h) = (f64::from(wall.camera.width), f64::from(wall.camera.height));
        Some(move |u, v| light.log_at(0, &Vector2::new(u * w, v * h)).exp())
    }

    #[test]
    fn a_shading_is_found_where_frames_overlap() {
        let lamp = |u: f64, v: f64| (1.0 + 0.8 * ((u - 0.6).powi(2) + (v - 0.4).powi(2))).powi(-2);
        let found = corrected(lamp).unwrap();
        let middle = found(0.5, 0.5) / lamp(0.5, 0.5);
        // Closer to the corners there is no tile that a frame sees all of.
        for (u, v) in [(0.1, 0.1), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9), (0.5, 0.1)] {
            let ratio = found(u, v) / lamp(u, v) / middle;
            assert!((ratio - 1.0).abs() < 0.01, "{u} {v}: {ratio}");
        }
    }

    #[test]
    fn even_light_is_left_alone() {
        assert!(corrected(|_, _| 1.0).is_none());
    }

    /// Five turns off the axis past a wall that a lamp lights, with noise; the lamp that is found.
    fn found_lamp(lamp: Option<Lamp>) -> Option<Vector3<f64>> {
        let mut wall = TestWall::ring(waves);
        let planned = spiral(60, 0.05, 30f64.to_radians()).into_iter().enumerate();
        let jitter = |k: usize, n: usize| 0.08 * ((1.3 + 0.7 * n as f64) * k as f64).sin();
        let off_axis =
            planned.map(|(k, plan)| plan.retract(&Vector6::from_fn(|n, _| jitter(k, n))));
        wall.poses = off_axis.collect();
        let light = |pose: &Pose, u: usize, v: usize| -> f64 {
            let ray = wall.camera.ray(u as f64, v as f64).unwrap();
            let hit = wall.circle.hit(&pose.t_wc, &(pose.r_wc * ray)).unwrap();
            let normal = wall.circle.frame(hit.wall).normal();
            let log = lamp
                .as_ref()
                .map(|lamp| lamp.log_at(pose, &hit.x_w, &normal));
            log.map_or(1.0, f64::exp)
        };
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let pictures = wall
            .frames()
            .into_iter()
            .zip(&wall.poses)
            .map(|(frame, pose)| {
                let (w, h) = (frame.width(), frame.height());
                let lit = frame.data().iter().enumerate().map(|(n, value)| {
                    let noise: f64 = StandardNormal.sample(&mut rng);
                    (0.5 * light(pose, n % w, n / w) * f64::from(*value) + noise) as f32
                });
                Pyramid::new(GreyImage::new(w, h, lit.collect()), 1)
            });
        let frames = FrameCache::of_pyramids(pictures.collect());
        let prior = independent_prior(&wall.poses);
        let context = test_context(&wall, &frames, &prior);
        let states = frame_states(&wall.poses);
        let noise = find_lamp(&context, &RefineOptions::default(), &states).unwrap()?;
        assert!((noise - 1.0).abs() < 0.3, "{noise}");
        frames.lamp_m().map(Vector3::from)
    }

    #[test]
    fn a_lamp_is_told_from_a_shading_by_frames_off_the_axis() {
        let lamp = Lamp {
            position: Vector3::new(0.1, -0.05, 0.08),
            ..Lamp::at_camera(1.0)
        };
        let found = found_lamp(Some(lamp)).unwrap();
        let error_m = (found - lamp.position * lamp.reach_m).norm();
        assert!(error_m < 0.03, "{found:?}");
        assert_eq!(found_lamp(None), None);
    }
}
