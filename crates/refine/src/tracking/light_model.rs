//! The light that frames are divided by, as a model that is estimated.

use crate::model::context::EstimationContext;
use crate::parameters::frame_estimate::FrameEstimate;
use std::sync::Arc;
use tunnelstitch_core::frames::Light;
use tunnelstitch_geometry::trajectory::Pose;
use tunnelstitch_photometry::LightModel;

/// The light that frames are divided by; an even one if they are not.
pub fn present_light(context: &EstimationContext) -> LightModel {
    let [width, height] = context.cameras.size();
    match context.frames.camera_light() {
        Some(light) => LightModel {
            shading: light.shading.clone(),
            lamp: light.lamp.as_ref().map(|(lamp, _)| *lamp),
        },
        None => LightModel::even((width as usize, height as usize)),
    }
}

/// Divides frames by a light: each by that at its present pose, or, if it has none yet, at its
/// initial one.
pub fn take_over(light: LightModel, context: &EstimationContext, estimates: &[FrameEstimate]) {
    let initial = context.prior.initial.iter().enumerate();
    let pose = |(k, initial): (usize, &Pose)| estimates.get(k).map_or(*initial, |known| known.pose);
    let poses: Vec<Pose> = initial.map(pose).collect();
    let light = light.over(context.surface.as_ref(), &context.cameras, &poses);
    context.frames.set_light(Light::Shaded(Arc::new(light)));
}
