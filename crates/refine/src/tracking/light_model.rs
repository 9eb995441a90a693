//! Model of the light that moves with the camera.

use crate::model::context::EstimationContext;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::tracking::tile_views::{TileView, TileViews};
use std::sync::Arc;
use tunnelstitch_core::frames::{CameraLight, Falloff, LAMP_TERMS, Lamp, Light, Shading};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::trajectory::Pose;
use tunnelstitch_photometry::{Observation, PhotometricCalibration, Priors};

/// A shading that all frames have in common, and a lamp, if there is one.
pub struct LightModel {
    /// The shading.
    pub shading: Shading,
    /// The lamp.
    pub lamp: Option<Lamp>,
}

impl LightModel {
    /// The light that frames are divided by; an even one if they are not.
    pub fn present(context: &EstimationContext) -> Self {
        let [width, height] = context.cameras.size();
        let size = (width as usize, height as usize);
        match context.frames.camera_light() {
            Some(light) => Self {
                shading: light.shading.clone(),
                lamp: light.lamp.as_ref().map(|(lamp, _)| *lamp),
            },
            None => Self {
                shading: Shading::none(size),
                lamp: None,
            },
        }
    }

    /// The light by which frames agree best where they overlap, linearised at this one, with its
    /// calibration; None if they do not overlap. A lamp is moved if `moves_lamp`.
    pub fn refined(
        &self,
        views: &TileViews,
        moves_lamp: bool,
    ) -> Option<(Self, PhotometricCalibration)> {
        let observe = |view: &TileView| {
            let (seen, by_lamp) = self.observation(view, &views.poses[view.frame])?;
            Some(if moves_lamp {
                seen.with_lamp(by_lamp)
            } else {
                seen
            })
        };
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

    /// The observation that a view from `pose` makes of the light beside this one, and its
    /// derivatives by the lamp's unknowns.
    fn observation(
        &self,
        view: &TileView,
        pose: &Pose,
    ) -> Option<(Observation, [f64; LAMP_TERMS])> {
        let of_lamp = |lamp: &Lamp| lamp.log_falloff(pose, &view.x_w, &view.normal);
        let (log, terms) = self.lamp.as_ref().map(of_lamp).unwrap_or_default();
        let factor = view.gain * (self.shading.log_at(&view.pixel) + log).exp();
        let pixel = [view.pixel.x as f32, view.pixel.y as f32];
        let value = (view.grey / factor) as f32;
        let seen = Observation::new(view.frame, pixel, value, factor as f32)?;
        Some((seen, terms))
    }

    /// Makes it the light that frames are divided by: each by that at its present pose, or, if it
    /// has none yet, at its initial one.
    pub fn take_over(self, context: &EstimationContext, estimates: &[FrameEstimate]) {
        let falloffs = |lamp: Lamp| {
            let initial = context.prior.initial.iter().enumerate();
            let pose = |(k, initial): (usize, &Pose)| {
                (estimates.get(k)).map_or(*initial, |known| known.pose)
            };
            let poses: Vec<Pose> = initial.map(pose).collect();
            let surface = context.surface.as_ref();
            let frames: Vec<usize> = (0..poses.len()).collect();
            let falloff =
                |k: &usize| Falloff::new(&lamp, surface, context.cameras.of(*k), &poses[*k]);
            (lamp, frames.par_map(falloff))
        };
        let light = CameraLight {
            shading: self.shading,
            lamp: self.lamp.map(falloffs),
        };
        context.frames.set_light(Light::Shaded(Arc::new(light)));
    }
}
