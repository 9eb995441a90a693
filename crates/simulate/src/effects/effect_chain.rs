//! The effects of a survey, in the order in which they act.
//!
//! ```text
//! moving objects ─ vignetting ─ shaft of the rig ─ defocus ─ dust ─ flicker ─ darkness ─ exposure
//! fault injection ─ sensor noise ─ tone curve ─ overlay
//! ```
//!
//! The first line acts on the light, before noise; the second in the camera.

use crate::effects::darkness::Darkness;
use crate::effects::defocus::Defocus;
use crate::effects::exposure::Exposures;
use crate::effects::fault_injection::InjectedFaults;
use crate::effects::flicker::FlickeringLight;
use crate::effects::frame_effect::FrameEffect;
use crate::effects::lens_dust::LensDust;
use crate::effects::moving_objects::MovingObjects;
use crate::effects::overlay::Overlay;
use crate::effects::rig_shaft::RigShaft;
use crate::effects::sensor::SensorNoise;
use crate::effects::tone_curve::ToneCurve;
use crate::effects::vignetting::Vignetting;
use crate::options::SimulateOptions;
use tunnelstitch_core::frames::GreyImage;

/// Effects that are applied one after the other.
pub(crate) struct EffectChain(Vec<Box<dyn FrameEffect>>);

impl EffectChain {
    /// The effects on the light of a survey's frames, with `times` as many pixels along each axis
    /// as they have, whose light is dimmed by the factor `dimming`, if any.
    pub fn of_light(options: &SimulateOptions, times: u32, dimming: Option<f64>) -> Self {
        let effects = &options.effects;
        let (width, height) = (options.camera.width * times, options.camera.height * times);
        let (width, height) = (width as usize, height as usize);
        let mut chain = Self(Vec::new());
        chain.add((options.moving > 0).then_some(MovingObjects {
            seed: options.seed,
            count: options.moving,
        }));
        let vignetting = |corner| Vignetting::new(corner, width, height);
        chain.add(options.lamp_corner.map(vignetting));
        let shaft_percent = options.shaft_percent;
        chain.add((shaft_percent > 0.0).then(|| RigShaft::new(shaft_percent, width, height)));
        let sigma_px = effects.defocus_px * f64::from(times);
        chain.add((sigma_px > 0.0).then(|| Defocus::new(sigma_px)));
        let dust = effects.dust_percent;
        chain.add((dust > 0.0).then(|| LensDust::new(options.seed, dust, width, height)));
        let flicker = |flicker| FlickeringLight::new(flicker, options.seed);
        chain.add(effects.flicker.map(flicker));
        chain.add(dimming.map(Darkness::new));
        chain.add(Some(Exposures::new(options)));
        chain
    }

    /// The effects of the camera of a survey on an exposed frame, up to quantisation.
    pub fn of_camera(options: &SimulateOptions) -> Self {
        let effects = &options.effects;
        let size = [options.camera.width, options.camera.height].map(|size| size as usize);
        let mut chain = Self(Vec::new());
        chain.add(Some(InjectedFaults {
            bad_frames: options.bad_frames.clone(),
            seed: options.seed,
        }));
        chain.add(Some(SensorNoise {
            sigma_grey: options.noise_grey,
            seed: options.seed,
        }));
        chain.add(effects.gamma.map(ToneCurve::new));
        let overlay = |parts| Overlay::new(parts, size, options.interval_s);
        chain.add(effects.overlay.map(overlay));
        chain
    }

    /// Appends an effect, if there is one.
    fn add(&mut self, effect: Option<impl FrameEffect + 'static>) {
        if let Some(effect) = effect {
            self.0.push(Box::new(effect));
        }
    }

    /// Applies all effects to the image of a frame.
    pub fn apply(&self, frame: usize, image: GreyImage) -> GreyImage {
        self.0
            .iter()
            .fold(image, |image, effect| effect.apply(frame, image))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::effects::effect_options::{FrameEffects, OverlayParts};
    use tunnelstitch_geometry::camera::Camera;

    fn options(effects: FrameEffects) -> SimulateOptions {
        SimulateOptions {
            camera: Camera::from_vertical_fov(160, 120, 1.0),
            effects,
            ..SimulateOptions::free()
        }
    }

    fn edge() -> GreyImage {
        let data = (0..160 * 120).map(|k| if k % 160 < 80 { 60.0 } else { 160.0 });
        GreyImage::new(160, 120, data.collect())
    }

    #[test]
    fn without_options_light_passes_and_the_camera_adds_noise_only() {
        let options = options(FrameEffects::default());
        let light = EffectChain::of_light(&options, 1, None).apply(5, edge());
        assert_eq!(light, edge());
        let picture = EffectChain::of_camera(&options).apply(5, light);
        let noise = picture.data().iter().zip(edge().data().to_vec());
        let square = noise.map(|(a, b)| (a - b).powi(2)).sum::<f32>() / (160.0 * 120.0);
        assert!((square.sqrt() - 2.0).abs() < 0.1, "{square}");
    }

    /// The lens blurs the shaft; the overlay is neither noisy nor curved.
    #[test]
    fn effects_act_in_their_order() {
        let options = SimulateOptions {
            shaft_percent: 10.0,
            ..options(FrameEffects {
                defocus_px: 2.0,
                gamma: Some(2.2),
                overlay: Some(OverlayParts::Logo),
                ..FrameEffects::default()
            })
        };
        let light = EffectChain::of_light(&options, 1, None).apply(5, edge());
        let row: Vec<f32> = (0..72).map(|u| light.at(u, 80)).collect();
        let step = row.windows(2).map(|pair| (pair[1] - pair[0]).abs());
        let step = step.fold(0.0, f32::max);
        assert!((2.0..15.0).contains(&step), "{step}");
        let picture = EffectChain::of_camera(&options).apply(5, light);
        let logo = picture
            .data()
            .iter()
            .filter(|value| **value == 235.0)
            .count();
        assert!(logo > 50, "{logo}");
    }

    /// Finer frames have the effects of the coarse ones.
    #[test]
    fn effects_scale_with_the_pixels() {
        let options = options(FrameEffects {
            defocus_px: 1.5,
            dust_percent: 5.0,
            ..FrameEffects::default()
        });
        let fine_edge = GreyImage::new(
            480,
            360,
            (0..480 * 360)
                .map(|k| if k % 480 < 240 { 60.0 } else { 160.0 })
                .collect(),
        );
        let coarse = EffectChain::of_light(&options, 1, None).apply(5, edge());
        let fine = EffectChain::of_light(&options, 3, None).apply(5, fine_edge);
        for k in 0..160 * 120 {
            let (u, v) = (k % 160, k / 160);
            let difference = (coarse.at(u, v) - fine.at(3 * u + 1, 3 * v + 1)).abs();
            assert!(difference < 5.0, "{u} {v}: {difference}");
        }
    }
}
