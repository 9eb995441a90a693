//! Search for a lamp that moves with the camera.
//!
//! The lamp lights the wall by its distance, and so by the frame's pose
//! ([`tunnelstitch_core::frames::Lamp`]): what frames off the axis show tells it from a shading
//! that all have in common, once their poses are good ([`tunnelstitch_photometry::LightModel`]).

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::tracking::light_model::{present_light, take_over};
use crate::tracking::tile_views::TileViews;
use tunnelstitch_core::frames::{Light, NoiseMeasurement, PictureNoise};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_photometry::light_frames;

/// Looks for a lamp that moves with the camera, at the frames' present poses, and takes it over if
/// frames agree better with one beside a shading than with a shading alone, by more than chance,
/// and to less than the noise of a pixel. Returns that noise; None if there is
/// no lamp.
///
/// # Errors
/// [`ProblemError`].
pub fn find_lamp(
    context: &EstimationContext,
    options: &RefineOptions,
    frames: &FrameStates,
) -> Result<Option<PictureNoise>, ProblemError> {
    let before = context.frames.light();
    let is_normalised = matches!(before, Light::Normalised);
    let dark = present_light(context);
    let views = if is_normalised {
        context.frames.set_light(Light::Even);
        let mut seen = frames.clone();
        seen.forget_exposures();
        TileViews::observe(context, options, &seen)?
    } else {
        TileViews::observe(context, options, frames)?
    };
    let noise = median_noise(context)?;
    let (surface, rate) = (context.surface.as_ref(), options.false_alarm_rate);
    let lamp = dark.with_lamp(&views.points, &views.poses, surface, rate);
    match lamp.filter(|(_, found)| found.variance.sqrt() < noise.fine) {
        Some((light, _)) => {
            take_over(light, context, &frames.estimates);
            Ok(Some(noise))
        }
        None => {
            // Otherwise it has not changed, and the frames are kept as they are.
            if is_normalised {
                context.frames.set_light(before);
            }
            Ok(None)
        }
    }
}

/// Median noise of the frames that the light is estimated from.
fn median_noise(context: &EstimationContext) -> Result<PictureNoise, ProblemError> {
    let frames: Vec<usize> = light_frames(context.frames.frames()).collect();
    let noises = frames.par_map(|k| Ok(NoiseMeasurement::of(&*context.frames.get(*k)?)));
    let noises: Vec<Option<NoiseMeasurement>> =
        noises.into_iter().collect::<Result<_, ProblemError>>()?;
    let noises: Vec<NoiseMeasurement> = noises.into_iter().flatten().collect();
    Ok(PictureNoise::median(&noises))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::{frame_states, independent_prior, test_context};
    use nalgebra::{Vector3, Vector6};
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};
    use tunnelstitch_core::frames::{FrameCache, GreyImage, Lamp, Pyramid};
    use tunnelstitch_core::test_wall::{TestWall, waves};
    use tunnelstitch_geometry::surface::Surface;
    use tunnelstitch_geometry::trajectory::{Pose, spiral};

    /// Five turns off the axis past a wall that a lamp lights, with noise; the lamp that is found,
    /// by frames that were compared in the light `before`, with the exposures that these have then.
    fn found_lamp(
        lamp: Option<Lamp>,
        before: Light,
        exposure: fn(f64) -> (f64, f64),
    ) -> Option<Vector3<f64>> {
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
        let frames = FrameCache::of_pyramids(pictures);
        let prior = independent_prior(&wall.poses);
        let context = test_context(&wall, &frames, &prior);
        let mut states = frame_states(&wall.poses);
        for (k, estimate) in states.estimates.iter_mut().enumerate() {
            (estimate.log_gain, estimate.bias) = exposure(k as f64);
        }
        frames.set_light(before);
        let noise = find_lamp(&context, &RefineOptions::default(), &states).unwrap()?;
        assert!((noise.fine - 1.0).abs() < 0.3, "{noise:?}");
        frames.lamp_m().map(Vector3::from)
    }

    const LAMP: Lamp = Lamp {
        position: Vector3::new(0.1, -0.05, 0.08),
        reach_m: 1.0,
    };

    #[test]
    fn a_lamp_is_told_from_a_shading_by_frames_off_the_axis() {
        let as_given = |_| (0.0, 0.0);
        let found = found_lamp(Some(LAMP), Light::Even, as_given).unwrap();
        let error_m = (found - LAMP.position * LAMP.reach_m).norm();
        assert!(error_m < 0.03, "{found:?}");
        assert_eq!(found_lamp(None, Light::Even, as_given), None);
    }

    /// Normalised frames have gains and biases that are not those of the pictures.
    #[test]
    fn a_lamp_is_found_by_frames_that_were_normalised() {
        let normalised = |k: f64| (0.5 * (1.1 * k).sin(), 40.0 * (0.7 * k).cos());
        let found = found_lamp(Some(LAMP), Light::Normalised, normalised).unwrap();
        let error_m = (found - LAMP.position * LAMP.reach_m).norm();
        assert!(error_m < 0.03, "{found:?}");
    }
}
