//! First model of the light that moves with the camera: by the mean of all frames.
//!
//! The mean shows a shading that all frames have in common. Where they look along the tunnel, a
//! lamp at the camera lights near and far wall in the same picture, by a falloff that no smooth
//! shading follows. At the initial poses it is known but for the lamp's exact place, which is found
//! once poses are good ([`crate::tracking::lamp_search`]).

use crate::model::context::EstimationContext;
use crate::thresholds::correlation_search::SAMPLES_PER_INDEPENDENT_PIECE;
use nalgebra::Vector2;
use tunnelstitch_core::frames::{GreyImage, Lamp, MeanShading, Shading};
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::mean_radius_m;
use tunnelstitch_geometry::trajectory::Pose;
use tunnelstitch_photometry::LightModel;

/// Frames whose falloffs make that of the mean: their poses differ by the jitter only.
const MEAN_FRAMES: usize = 12;

/// The light that explains the `mean` of all frames at pyramid level `level`: a shading, or a lamp
/// at the camera with a shading, if that is more probable by odds of `1/alpha`. None if it is even.
pub fn first_light(
    context: &EstimationContext,
    mean: &GreyImage,
    level: usize,
    alpha: f64,
) -> Option<LightModel> {
    let [width, height] = context.cameras.size();
    let size = (width as usize, height as usize);
    let lamp = Lamp::at_camera(mean_radius_m(context.surface.as_ref()));
    let falloff = mean_falloff(context, &context.cameras.at_level(level), &lamp);
    let fit = |light: fn(f64) -> f64| {
        let seen = mean.data().iter().zip(&falloff);
        let divided = seen.map(|(value, falloff)| {
            falloff.map_or(f32::NAN, |falloff| value / light(falloff) as f32)
        });
        let picture = GreyImage::new(mean.width(), mean.height(), divided.collect());
        MeanShading::fit(&picture, size)
    };
    let (plain, lit) = (fit(|_| 1.0)?, fit(|falloff| falloff)?);
    let independent = plain.pixels as f64 / SAMPLES_PER_INDEPENDENT_PIECE;
    let log_odds = 0.5 * independent * (plain.left / lit.left).ln();
    if log_odds > -alpha.ln() {
        let shading = if lit.is_light() {
            lit.shading
        } else {
            Shading::none(size)
        };
        return Some(LightModel {
            shading,
            lamp: Some(lamp),
        });
    }
    plain.is_light().then_some(LightModel {
        shading: plain.shading,
        lamp: None,
    })
}

/// The mean light of a lamp over a few frames at their initial poses, at every pixel of their
/// `cameras`; None where none of them shows wall in range.
fn mean_falloff(context: &EstimationContext, cameras: &Cameras, lamp: &Lamp) -> Vec<Option<f64>> {
    let surface = context.surface.as_ref();
    let initial = &context.prior.initial;
    let poses: Vec<(usize, &Pose)> = (initial.iter().enumerate())
        .step_by(initial.len().div_ceil(MEAN_FRAMES).max(1))
        .collect();
    let [width, height] = cameras.size().map(|side| side as usize);
    (0..width * height).par_map(|k| {
        let pixel = Vector2::new((k % width) as f64, (k / width) as f64);
        let logs = poses.iter();
        let logs =
            logs.filter_map(|(k, pose)| lamp.log_seen_at(&pixel, surface, cameras.of(*k), pose));
        let seen: Vec<f64> = logs.map(f64::exp).collect();
        (!seen.is_empty()).then(|| seen.iter().sum::<f64>() / seen.len() as f64)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::with_context;
    use nalgebra::{UnitQuaternion, Vector3};
    use tunnelstitch_core::test_wall::{TestWall, waves};

    /// The light by which a mean is explained that depends on a lamp's `falloff`, with what is left
    /// of a wall's texture.
    fn found(poses: &[Pose], light: fn(f64) -> f64) -> Option<LightModel> {
        let wall = TestWall::ring(waves);
        with_context(&wall, wall.frames(), poses, |context, _| {
            let lamp = Lamp::at_camera(mean_radius_m(context.surface.as_ref()));
            let falloff = mean_falloff(context, &context.cameras, &lamp);
            let lit = falloff.iter().enumerate().map(|(k, falloff)| {
                let texture = 1.0 + 0.02 * (12.9898 * k as f64).sin();
                falloff.map_or(f32::NAN, |falloff| {
                    (100.0 * light(falloff) * texture) as f32
                })
            });
            let [w, h] = context.cameras.size();
            let mean = GreyImage::new(w as usize, h as usize, lit.collect());
            first_light(context, &mean, 0, 1e-3)
        })
    }

    /// Poses that look along the tunnel, a little off its axis.
    fn along() -> Vec<Pose> {
        let look = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), -0.5 * std::f64::consts::PI);
        let place = |k: i32| Vector3::new(0.01 * f64::from(k % 3), 0.05 * f64::from(k), 0.02);
        (0..11).map(|k| Pose::new(look, place(k))).collect()
    }

    #[test]
    fn a_lamp_is_seen_along_the_tunnel() {
        assert!(found(&along(), |falloff| falloff).unwrap().lamp.is_some());
    }

    #[test]
    fn even_light_and_vignetting_are_no_lamp() {
        assert!(found(&along(), |_| 1.0).is_none());
        let vignetting = found(&along(), |falloff| (-0.3 * (1.0 - falloff.min(1.0))).exp());
        assert!(vignetting.is_none_or(|light| light.lamp.is_none()));
    }

    /// At the wall a lamp's light is as smooth as a shading.
    #[test]
    fn light_on_the_wall_beside_is_a_shading() {
        let wall = TestWall::ring(waves);
        let light = found(&wall.poses, |falloff| falloff).unwrap();
        assert!(light.lamp.is_none());
    }
}
