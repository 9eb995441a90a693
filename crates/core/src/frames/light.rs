//! Treatment of the frames' light.

use super::grey::GreyImage;
use super::lamp::{Falloff, Lamp};
use super::shading::Shading;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use tunnelstitch_geometry::camera::Camera;

/// Treatment of the frames' light.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub enum Light {
    /// As it is.
    #[default]
    Even,
    /// Divided by a light that moves with the camera.
    Shaded(Arc<CameraLight>),
    /// Taken off by local normalisation ([`super::normalise_locally`]).
    Normalised,
}

/// Light that moves with the camera: a shading that all frames have in common, and a lamp, whose
/// light on the wall depends on every frame's pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CameraLight {
    /// The shading V.
    pub shading: Shading,
    /// The lamp, with its falloff over every frame; None if there is none.
    pub lamp: Option<(Lamp, Vec<Falloff>)>,
}

impl CameraLight {
    /// A shading alone.
    pub fn common(shading: Shading) -> Self {
        Self {
            shading,
            lamp: None,
        }
    }

    /// `ln(V L)` at a pixel of a full-size frame.
    pub fn log_at(&self, frame: usize, pixel: &Vector2<f64>) -> f64 {
        self.shading.log_at(pixel) + self.falloff(frame).map_or(0.0, |f| f.log_at(pixel))
    }

    /// `V L` at a pixel of a pyramid level of a frame, whose `camera` is given.
    pub fn at_level(&self, frame: usize, pixel: &Vector2<f64>, camera: &Camera) -> f64 {
        self.log_at(frame, &self.shading.full_size(pixel, camera))
            .exp()
    }

    /// Divides a full-size picture by the light of its frame.
    pub fn divide(&self, frame: usize, image: &mut GreyImage) {
        self.shading.divide(image);
        let Some(falloff) = self.falloff(frame) else {
            return;
        };
        let width = image.width();
        for (k, value) in image.data_mut().iter_mut().enumerate() {
            let pixel = Vector2::new((k % width) as f64, (k / width) as f64);
            *value *= (-falloff.log_at(&pixel)).exp() as f32;
        }
    }

    /// The largest relative difference of two lights at some pixels of frames, once their exposures
    /// are made equal: half of the spread of the logarithm of their ratio; 0 without pixels.
    pub fn relative_difference(
        &self,
        other: &Self,
        pixels: impl IntoIterator<Item = (usize, Vector2<f64>)>,
    ) -> f64 {
        let nothing = [f64::INFINITY, f64::NEG_INFINITY];
        let pixels = pixels.into_iter();
        let logs = pixels.map(|(frame, at)| self.log_at(frame, &at) - other.log_at(frame, &at));
        let [least, greatest] = logs.fold(nothing, |[least, greatest], log| {
            [least.min(log), greatest.max(log)]
        });
        (0.5 * (greatest - least)).max(0.0)
    }

    fn falloff(&self, frame: usize) -> Option<&Falloff> {
        self.lamp.as_ref()?.1.get(frame)
    }
}

#[cfg(test)]
mod tests {
    use super::super::shading::TERMS;
    use super::*;
    use nalgebra::Vector3;
    use tunnelstitch_geometry::surface::Circle;
    use tunnelstitch_geometry::trajectory::Pose;

    #[test]
    fn lights_differ_by_a_share_and_not_by_their_sign() {
        let none = CameraLight::common(Shading::none((64, 48)));
        let mut delta = [0.0; TERMS];
        // P_1(x), from −1 to 1.
        delta[0] = 0.03;
        let sloped = CameraLight::common(none.shading.changed(&delta));
        let pixels = || [0.0, 31.0, 63.0].map(|x| (0, Vector2::new(x, 20.0)));
        let difference = |a: &CameraLight, b: &CameraLight| a.relative_difference(b, pixels());
        assert!((difference(&sloped, &none) - 0.03).abs() < 1e-12);
        assert_eq!(difference(&sloped, &none), difference(&none, &sloped));
        assert_eq!(difference(&sloped, &sloped), 0.0);
    }

    #[test]
    fn pictures_are_divided_by_shading_and_lamp_of_their_frame() {
        let camera = Camera::from_vertical_fov(64, 48, 1.0);
        let circle = Circle::new(3.0).unwrap();
        let lamp = Lamp {
            position: Vector3::new(0.1, 0.0, 0.2),
            reach_m: 3.0,
        };
        let falloffs = [0.0, 0.5].map(|z| {
            let pose = Pose {
                t_wc: Vector3::new(0.0, 0.0, z),
                ..Pose::identity()
            };
            Falloff::new(&lamp, &circle, &camera, &pose)
        });
        let light = CameraLight {
            shading: Shading::none((64, 48)).changed(&[0.01; TERMS]),
            lamp: Some((lamp, falloffs.into())),
        };
        let pixel = Vector2::new(50.0, 7.0);
        for frame in 0..2 {
            let mut picture = GreyImage::new(64, 48, vec![100.0; 64 * 48]);
            light.divide(frame, &mut picture);
            let expected = 100.0 * (-light.log_at(frame, &pixel)).exp();
            let found = f64::from(picture.at(50, 7));
            assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
        }
        assert!(light.log_at(1, &pixel) > light.log_at(0, &pixel) + 0.1);
    }
}
