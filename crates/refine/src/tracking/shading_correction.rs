//! Correction of the camera's light by frames that see the same wall in different parts of the
//! picture.
//!
//! The mean over all frames shows the lamp and the lens
//! ([`crate::tracking::first_light`]) up to what is left of the wall's texture in
//! it: enough to register frames. On a faint wall a shading that is wrong by a grey level is still
//! steeper than the texture, and it is fixed to the camera: frames get displaced by it. Where
//! frames overlap, the wall itself determines the shading ([`tunnelstitch_photometry`]): an
//! observation is the mean value z of a tile in a frame by the present bias and the present factor
//! `f = a_i V`.
//!
//! Only the light is taken over; the solves that follow estimate gains and biases themselves.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::solver::solve_levels::solve_levels;
use crate::thresholds::tracking::MAX_TRACKING_ITERATIONS;
use crate::tracking::light_model::{present_light, take_over};
use crate::tracking::tile_views::TileViews;
use nalgebra::Vector2;
use tunnelstitch_core::frames::Light;

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
    let side = context.cameras.shorter_side();
    let (coarsest, finest) = (options.coarsest_level(side), options.handover_level(side));
    let mut observed = Vec::new();
    for _ in 0..MAX_TRACKING_ITERATIONS {
        let views = TileViews::observe(context, options, frames)?;
        observed = views.pixels();
        // At tracked poses, which are a little off in common, a lamp would be moved far away.
        if !correct(context, &views, frames, false) {
            break;
        }
        solve_levels(context, options, finest..=coarsest, frames)?;
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
    correct(context, &views, frames, true);
    Ok(())
}

/// Corrects the light by what overlapping frames show; false if nothing significant is wrong with
/// it. A lamp's light over a frame is that of the frame's present pose; it is moved if
/// `moves_lamp`.
fn correct(
    context: &EstimationContext,
    views: &TileViews,
    frames: &FrameStates,
    moves_lamp: bool,
) -> bool {
    let sigmas = match context.frames.light() {
        Light::Shaded(_) => MIN_CHANGE_SIGNIFICANCE_SIGMA,
        Light::Even => MIN_SIGNIFICANCE_SIGMA,
        Light::Normalised => return false,
    };
    let before = present_light(context);
    let Some((after, found)) = before.refined(&views.points, &views.poses, moves_lamp) else {
        return false;
    };
    let is_changed = found.is_light_significant(sigmas, moves_lamp && before.lamp.is_some());
    if is_changed {
        take_over(after, context, &frames.estimates);
    } else if before.lamp.is_some() {
        take_over(before, context, &frames.estimates);
    }
    is_changed
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
        let frames = FrameCache::of_pyramids(pictures);
        let prior = independent_prior(&wall.poses);
        let context = test_context(&wall, &frames, &prior);
        let states = frame_states(&wall.poses);
        let views = TileViews::observe(&context, &RefineOptions::default(), &states).unwrap();
        let any = correct(&context, &views, &states, true);
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
}
