//! The light of all stretches.

use crate::error::RefineError;
use tunnelstitch_core::frames::{Lamp, Light, SHADING_TERMS, Shading};
use tunnelstitch_photometry::LightModel;

/// The treatment of the light in all stretches, as far as it does not depend on poses.
pub enum JoinedLight {
    /// As it is.
    Even,
    /// Divided by the mean of the lights that stretches have found.
    Shaded(Box<LightModel>),
    /// Taken off by local normalisation.
    Normalised,
}

/// Joins the lights of stretches, the mean of each term: of those with a lamp if there are any,
/// for a lamp is looked for where it is seen.
///
/// # Errors
/// [`RefineError::LightOfShards`] if the light fits a model in some stretches and in others not.
pub fn join_light(lights: &[&Light]) -> Result<JoinedLight, RefineError> {
    let normalised = lights
        .iter()
        .filter(|light| matches!(light, Light::Normalised));
    let normalised = normalised.count();
    if normalised == lights.len() {
        return Ok(JoinedLight::Normalised);
    }
    if normalised > 0 {
        return Err(RefineError::LightOfShards {
            normalised,
            of: lights.len(),
        });
    }
    let of_cameras = lights.iter().filter_map(|light| match light {
        Light::Shaded(light) => Some(light),
        Light::Even | Light::Normalised => None,
    });
    let of_cameras: Vec<_> = of_cameras.collect();
    let Some(size) = of_cameras.first().map(|light| light.shading.size()) else {
        return Ok(JoinedLight::Even);
    };
    let lamps: Vec<Lamp> = (of_cameras.iter())
        .filter_map(|light| light.lamp.as_ref().map(|(lamp, _)| *lamp))
        .collect();
    let mean_of = |shadings: &[&Shading], count: usize| {
        let mut mean = [0.0; SHADING_TERMS];
        for shading in shadings {
            let terms = mean.iter_mut().zip(shading.coefficients());
            terms.for_each(|(mean, term)| *mean += term / count as f64);
        }
        Shading::none(size).changed(&mean)
    };
    let with_lamp = of_cameras.iter().filter(|light| light.lamp.is_some());
    Ok(JoinedLight::Shaded(Box::new(match lamps.first() {
        Some(lamp) => {
            let shadings: Vec<&Shading> = with_lamp.map(|light| &light.shading).collect();
            let count = lamps.len() as f64;
            let position = lamps.iter().map(|lamp| lamp.position / count).sum();
            LightModel {
                shading: mean_of(&shadings, lamps.len()),
                lamp: Some(Lamp { position, ..*lamp }),
            }
        }
        None => {
            // Even light is no shading.
            let shadings: Vec<&Shading> = of_cameras.iter().map(|light| &light.shading).collect();
            LightModel {
                shading: mean_of(&shadings, lights.len()),
                lamp: None,
            }
        }
    })))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use tunnelstitch_core::frames::CameraLight;

    fn shaded(term: f64) -> Light {
        let shading = Shading::none((64, 48)).changed(&[term; SHADING_TERMS]);
        Light::Shaded(Arc::new(CameraLight::common(shading)))
    }

    #[test]
    fn shadings_are_averaged_and_an_even_light_is_none() {
        let (a, b) = (shaded(0.03), shaded(0.01));
        let JoinedLight::Shaded(light) = join_light(&[&a, &b, &Light::Even, &Light::Even]).unwrap()
        else {
            panic!("not shaded");
        };
        assert!((light.shading.coefficients()[5] - 0.01).abs() < 1e-15);
        let even = join_light(&[&Light::Even, &Light::Even]);
        assert!(matches!(even, Ok(JoinedLight::Even)));
    }

    #[test]
    fn light_that_fits_a_model_in_some_stretches_only_is_an_error() {
        let all = join_light(&[&Light::Normalised, &Light::Normalised]);
        assert!(matches!(all, Ok(JoinedLight::Normalised)));
        let Err(error) = join_light(&[&Light::Normalised, &Light::Even]) else {
            panic!("joined");
        };
        assert!(error.to_string().contains("photometry"), "{error}");
    }
}
