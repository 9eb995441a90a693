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
use tunnelstitch_core::frames::{Light, Shading};
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

/// Corrects the shading until frames agree where they overlap, solving for their poses in between;
/// returns the pixels at which wall was observed last.
///
/// # Errors
/// [`ProblemError`].
pub fn correct_until_settled(
    context: &EstimationContext,
    options: &RefineOptions,
    frames: &mut FrameStates,
) -> Result<Vec<Vector2<f64>>, ProblemError> {
    let side = context.camera.shorter_side();
    let (coarsest, finest) = (options.coarsest_level(side), options.handover_level(side));
    let mut pixels = Vec::new();
    for _ in 0..MAX_TRACKING_ITERATIONS {
        let points = observe_tiles(context, options, frames)?;
        pixels = points.iter().flatten().map(Observation::pixel).collect();
        if !correct(context, &points, frames.estimates.len()) {
            break;
        }
        Neighbourhood::of_all(frames).solve(context, options, finest..=coarsest, frames)?;
    }
    Ok(pixels)
}

/// Corrects the shading by what overlapping frames show at their present poses, if something
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
    correct(context, &points, frames.estimates.len());
    Ok(())
}

/// The frames that the shading is estimated from, of `count`: the middle ones.
fn calibrated_frames(count: usize) -> Range<usize> {
    let first = count.saturating_sub(MAX_SHADING_FRAMES) / 2;
    first..(first + MAX_SHADING_FRAMES).min(count)
}

/// Corrects the shading by what overlapping frames of `count` show of wall `points`; false if
/// nothing significant is wrong with it.
fn correct(context: &EstimationContext, points: &[Vec<Observation>], count: usize) -> bool {
    let size = (
        context.camera.width as usize,
        context.camera.height as usize,
    );
    let (before, sigmas) = match context.frames.light() {
        Light::Shaded(shading) => (*shading, MIN_CHANGE_SIGNIFICANCE_SIGMA),
        Light::Even => (Shading::none(size), MIN_SIGNIFICANCE_SIGMA),
        Light::Normalised => return false,
    };
    let frames = calibrated_frames(count).len();
    let found = PhotometricCalibration::solve(points, frames, &before, &Priors::default());
    let Some(found) = found.filter(|found| found.is_shading_significant(sigmas)) else {
        return false;
    };
    let shading = before.changed(&found.shading);
    context.frames.set_light(Light::Shaded(Box::new(shading)));
    true
}

/// Observes tiles spread over all of the wall by the frames that the shading is estimated from, at
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
    let tiles = problem.gather_from_tiles(
        MAX_SHADING_TILES,
        |tiles: &mut Vec<Vec<Observation>>, tile| {
            let means = tile.workspace.mean_values(tile.points, tile.observations());
            let seen = tile.observers.iter().zip(means);
            let observations = seen.filter_map(|(observer, mean)| {
                let frame = tile.participants[observer.frame as usize];
                let pose = &frames.estimates[range.start + frame].pose;
                let pixel = problem
                    .camera_of(frame)
                    .project(&pose.to_camera(&tile.points.centre.x_w))?;
                let factor = tile.sampled_frames[observer.frame as usize].gain() * observer.shade;
                let pixel = [pixel.x as f32, pixel.y as f32];
                Observation::new(frame, pixel, mean as f32, factor)
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
        let any = correct(&context, &points, states.estimates.len());
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

    #[test]
    fn even_light_is_left_alone() {
        assert!(corrected(|_, _| 1.0).is_none());
    }
}
