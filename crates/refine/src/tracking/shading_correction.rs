//! Correction of the camera's shading by frames that see the same wall in different parts of the
//! picture.
//!
//! The mean over all frames shows the lamp and the lens ([`Shading::of_mean`]) up to what is left
//! of the wall's texture in it: enough to register frames. On a faint wall a shading that is wrong
//! by a grey level is still steeper than the texture, and it is fixed to the camera: frames get
//! displaced by it. Where frames overlap, the wall itself determines the shading
//! ([`tunnelstitch_photometry`]): an observation is the mean value z of a tile in a frame by the
//! present bias and the present factor `f = a_i V`.
//!
//! Only the shading is taken over; the solves that follow estimate gains and biases themselves.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::sampling::Sampling;
use crate::solver::neighbourhood::Neighbourhood;
use crate::thresholds::tracking::MAX_TRACKING_ITERATIONS;
use nalgebra::Vector2;
use std::ops::Range;
use std::sync::Arc;
use tunnelstitch_core::frames::{CameraLight, Falloff, Lamp, Light, Shading};
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
        let first = calibrated_frames(frames.estimates.len()).start;
        let points = observe_tiles(context, options, frames)?;
        let pixels = points.iter().flatten();
        observed = pixels.map(|one| (first + one.frame, one.pixel())).collect();
        if !correct(context, &points, frames) {
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
    let points = observe_tiles(context, options, frames)?;
    correct(context, &points, frames);
    Ok(())
}

/// The frames that the light is estimated from, of `count`: the middle ones.
fn calibrated_frames(count: usize) -> Range<usize> {
    let first = count.saturating_sub(MAX_SHADING_FRAMES) / 2;
    first..(first + MAX_SHADING_FRAMES).min(count)
}

/// The lamp of a light; one without strength if it has none.
fn lamp_of(context: &EstimationContext, light: &Light) -> Lamp {
    let known = match light {
        Light::Shaded(light) => light.lamp.as_ref().map(|(lamp, _)| *lamp),
        Light::Even | Light::Normalised => None,
    };
    known.unwrap_or(Lamp::none(mean_radius_m(context.surface.as_ref())))
}

/// Corrects the light by what overlapping frames show of wall `points`; false if nothing
/// significant is wrong with it.
///
/// There is a lamp if frames agree significantly better with one. Its light over a frame is that of
/// the frame's present pose.
fn correct(context: &EstimationContext, points: &[Vec<Observation>], frames: &FrameStates) -> bool {
    let size = (
        context.camera.width as usize,
        context.camera.height as usize,
    );
    let light = context.frames.light();
    let lamp = lamp_of(context, &light);
    let (before, sigmas) = match light {
        Light::Shaded(before) => (before, MIN_CHANGE_SIGNIFICANCE_SIGMA),
        Light::Even => {
            let none = CameraLight::common(Shading::none(size));
            (Arc::new(none), MIN_SIGNIFICANCE_SIGMA)
        }
        Light::Normalised => return false,
    };
    let count = calibrated_frames(frames.estimates.len()).len();
    let solve = |points: &[Vec<Observation>], lamp: Option<&Lamp>| {
        PhotometricCalibration::solve(points, count, &before.shading, lamp, &Priors::default())
    };
    let with_lamp = solve(points, Some(&lamp)).filter(|found| {
        before.lamp.is_some() || found.is_lamp_significant(&lamp, MIN_SIGNIFICANCE_SIGMA)
    });
    let is_lamp = with_lamp.is_some();
    let found = with_lamp.or_else(|| {
        let dark = |point: &Vec<Observation>| point.iter().map(Observation::without_lamp).collect();
        let dark: Vec<Vec<Observation>> = points.iter().map(dark).collect();
        solve(&dark, None)
    });
    let Some(found) = found else {
        return false;
    };
    let is_changed = found.is_light_significant(sigmas, is_lamp);
    eprintln!("correct: lamp {is_lamp} changed {is_changed} lamp before {:?} delta {:?} n {}", lamp.unknowns(), found.lamp, points.len());
    let (shading, lamp) = match is_changed {
        true => (
            before.shading.changed(&found.shading),
            lamp.changed(&found.lamp),
        ),
        false => (before.shading.clone(), lamp),
    };
    if is_changed || is_lamp {
        let light = CameraLight {
            shading,
            lamp: is_lamp.then(|| (lamp, falloffs(context, &lamp, frames))),
        };
        context.frames.set_light(Light::Shaded(Arc::new(light)));
    }
    is_changed
}

/// The falloff of a lamp over every frame: at its present pose, or, if it has none yet, at its
/// initial one.
fn falloffs(context: &EstimationContext, lamp: &Lamp, frames: &FrameStates) -> Vec<Falloff> {
    let initial = context.prior.initial.iter().enumerate();
    let poses: Vec<Pose> = initial
        .map(|(k, initial)| frames.estimates.get(k).map_or(*initial, |known| known.pose))
        .collect();
    let surface = context.surface.as_ref();
    poses.par_map(|pose| Falloff::new(lamp, surface, &context.camera, pose))
}

/// Observes tiles spread over all of the wall by the frames that the light is estimated from, at
/// their present poses, tile by tile; frames are counted from the first of these.
fn observe_tiles(
    context: &EstimationContext,
    options: &RefineOptions,
    frames: &FrameStates,
) -> Result<Vec<Vec<Observation>>, ProblemError> {
    let range = calibrated_frames(frames.estimates.len());
    let level = options.handover_level(context.camera.shorter_side());
    let window = frames.window_of(range.clone(), range.clone());
    let problem = PhotometricProblem::new(context, Sampling::of(level), window)?;
    let lamp = lamp_of(context, &context.frames.light());
    let tiles = problem.gather_from_tiles(
        MAX_SHADING_TILES,
        |tiles: &mut Vec<Vec<Observation>>, tile| {
            let means = tile.workspace.mean_values(tile.points, tile.observations());
            let (x_w, normal) = (&tile.points.centre.x_w, tile.points.centre.normal());
            let seen = tile.observers.iter().zip(means);
            let observations = seen.filter_map(|(observer, mean)| {
                let frame = tile.participants[observer.frame as usize];
                let pose = &frames.estimates[range.start + frame].pose;
                let pixel = problem.camera_of(frame).project(&pose.to_camera(x_w))?;
                let factor = tile.sampled_frames[observer.frame as usize].gain() * observer.shade;
                let pixel = [pixel.x as f32, pixel.y as f32];
                let seen = Observation::new(frame, pixel, mean as f32, factor)?;
                Some(seen.with_lamp(lamp.terms(pose, x_w, &normal)))
            });
            let observations: Vec<Observation> = observations.collect();
            if observations.len() > 1 {
                tiles.push(observations);
            }
        },
    )?;
    Ok(tiles.into_iter().flatten().collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::{frame_states, independent_prior, test_context};
    use tunnelstitch_core::frames::{FrameCache, GreyImage, Pyramid};
    use tunnelstitch_core::test_wall::{TestWall, waves};
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
        let points = observe_tiles(&context, &RefineOptions::default(), &states).unwrap();
        let any = correct(&context, &points, &states);
        assert_eq!(any, frames.camera_light().is_some());
        let light = frames.camera_light()?;
        let (w, h) = (f64::from(wall.camera.width), f64::from(wall.camera.height));
        Some(move |u, v| light.log_at(0, &Vector2::new(u * w, v * h)).exp())
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

    #[test]
    fn even_light_is_left_alone() {
        assert!(corrected(|_, _| 1.0).is_none());
    }
}
