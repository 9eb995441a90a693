//! Options of a simulated survey.

use crate::as_built::AsBuilt;
use crate::bad_frames::BadFrames;
use crate::camera_lamp::CameraLamp;
use crate::effects::effect_options::FrameEffects;
use crate::effects::sensor::BitDepth;
use crate::error::{SimulateError, check_option};
use crate::fittings::fitting_options::Fittings;
use crate::rig::RigOptions;
use serde::Serialize;
use std::path::PathBuf;
use tunnelstitch_core::survey::{PriorSection, TunnelSection};
use tunnelstitch_geometry::camera::{Camera, Cameras};
use tunnelstitch_geometry::trajectory::JitterModel;

/// Angle between optical axis and tunnel axis of a camera that looks at the wall beside it.
pub(super) const SIDE_VIEW_DEG: f64 = 90.0;

/// Appearance of the wall under even light.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Wall {
    /// Bricks of 215 × 65 mm, each with a tone of its own.
    Brick,
    /// Cast concrete: smooth stains, low contrast.
    Concrete,
    /// A tile of 8 × 6 bricks that repeats all over the tunnel: perceptual aliasing.
    TiledBrick,
    /// Dark and bright squares on mid grey, turned by 5°: a test target for sharpness
    /// ([`SlantedEdge`](super::SlantedEdge)).
    Target,
    /// An image that repeats all over the tunnel.
    Texture {
        /// The image file.
        path: PathBuf,
        /// Width of the image on the wall, metres; adjusted so that a whole number fits around.
        width_m: f64,
    },
}

/// Illumination of the wall.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Illumination {
    /// Directional, as in the paper: `0.35 + 0.65 (1 + cos θ)/2`, bright at θ = 0.
    Downward,
    /// Uniform.
    Even,
}

/// Options of a simulated survey.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SimulateOptions {
    /// Number of frames; of a rig, of its moments, at which each camera takes one.
    pub frames: usize,
    /// The tunnel; plan and jitter are defined along its axis as if it were straight.
    pub tunnel: TunnelSection,
    /// The camera; of a rig, the first.
    pub camera: Camera,
    /// The rig, if there are several cameras.
    #[serde(skip_serializing_if = "is_default")]
    pub rig: Option<RigOptions>,
    /// Advance along the axis from frame to frame, metres.
    pub advance_m: f64,
    /// Turn about the axis from frame to frame, degrees.
    pub turn_deg: f64,
    /// Angle between optical axis and tunnel axis, degrees: 90 for the wall beside the camera, 0
    /// for a view along the tunnel, which ends in fog 60 radii ahead.
    #[serde(skip_serializing_if = "is_side_view")]
    pub view_deg: f64,
    /// Time from frame to frame, seconds.
    #[serde(skip_serializing_if = "is_one_second")]
    pub interval_s: f64,
    /// Rolling-shutter readout time from a frame's first row to its last, milliseconds.
    ///
    /// It is negative if rows are read bottom-up, and 0 for a global shutter. Poses are those of
    /// the middle row; between them the camera moves smoothly.
    #[serde(skip_serializing_if = "is_default")]
    pub readout_ms: f64,
    /// Interlaced frames: odd rows, counted from 0, are taken half of the interval between frames
    /// after the even ones, whose poses are the true ones.
    #[serde(skip_serializing_if = "is_default")]
    pub interlaced: bool,
    /// True position minus planned position, metres; the initial poses do not contain it.
    pub offset_m: [f64; 3],
    /// Noise of the true poses about the plan, if any; the initial poses do not contain it.
    pub jitter: Option<PriorSection>,
    /// Deviation of the lining from the tunnel, which the survey does not know.
    #[serde(skip_serializing_if = "is_default")]
    pub as_built: AsBuilt,
    /// Cables and lamps before the wall, which the survey does not know.
    #[serde(skip_serializing_if = "is_default")]
    pub fittings: Fittings,
    /// Appearance of the wall.
    pub wall: Wall,
    /// Illumination of the wall.
    pub light: Illumination,
    /// Lamp that is fixed to the camera, if any.
    #[serde(flatten)]
    pub camera_lamp: Option<CameraLamp>,
    /// Light, lens, sensor and files that are not ideal.
    #[serde(flatten)]
    pub effects: FrameEffects,
    /// 1-σ of the sensor's noise, grey levels.
    pub noise_grey: f64,
    /// Half the range P of the frames' gains, percent: independent and uniform in `1 ± P/100`.
    #[serde(skip_serializing_if = "is_default")]
    pub gain_percent: f64,
    /// Half the range B of the frames' biases, grey levels: independent and uniform in ±B.
    #[serde(skip_serializing_if = "is_default")]
    pub bias_grey: f64,
    /// Vignetting, if any: the light in the darkest corner, as a share (0–1) of that at the
    /// brightest pixel, which lies a tenth of the frame right of and above its centre.
    #[serde(skip_serializing_if = "is_default")]
    pub lamp_corner: Option<f64>,
    /// Share of the wall under wet patches that reflect the camera's lamp specularly, percent.
    #[serde(skip_serializing_if = "is_default")]
    pub specular_percent: f64,
    /// Number of moving objects before the wall in each frame, at random positions.
    #[serde(skip_serializing_if = "is_default")]
    pub moving: u32,
    /// Width of the rig's shaft, percent of the frames' width; 0 for none.
    ///
    /// The shaft occludes the wall at the same pixels of every frame, and the survey has a mask.
    #[serde(skip_serializing_if = "is_default")]
    pub shaft_percent: f64,
    /// Bit depth of the frames.
    #[serde(skip_serializing_if = "is_default")]
    pub bits: BitDepth,
    /// Frames with injected faults.
    #[serde(skip_serializing_if = "is_default")]
    pub bad_frames: BadFrames,
    /// Sample points along each side of a pixel, whose value is their mean.
    ///
    /// The wall's raster has three to six texels over the width of a pixel (more where pixels are
    /// large); fewer points than that alias.
    pub supersample: u32,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// True for the default interval, which the record leaves out.
fn is_one_second(value: &f64) -> bool {
    *value == 1.0
}

/// True for the default view, which the record leaves out.
fn is_side_view(view_deg: &f64) -> bool {
    *view_deg == SIDE_VIEW_DEG
}

/// True for a default value, which the record leaves out.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl SimulateOptions {
    /// The paper's first experiment: 12 frames, 30° apart, from the axis of a tunnel of 3 m radius.
    pub fn centred() -> Self {
        Self {
            frames: 12,
            tunnel: TunnelSection::round(3.0),
            camera: Camera::from_vertical_fov(640, 480, 60f64.to_radians()),
            rig: None,
            advance_m: 0.0,
            turn_deg: 30.0,
            view_deg: SIDE_VIEW_DEG,
            interval_s: 1.0,
            readout_ms: 0.0,
            interlaced: false,
            offset_m: [0.0; 3],
            jitter: None,
            wall: Wall::Brick,
            light: Illumination::Downward,
            camera_lamp: None,
            effects: FrameEffects::default(),
            noise_grey: 2.0,
            as_built: AsBuilt::default(),
            fittings: Fittings::default(),
            gain_percent: 0.0,
            bias_grey: 0.0,
            lamp_corner: None,
            specular_percent: 0.0,
            moving: 0,
            shaft_percent: 0.0,
            bits: BitDepth::default(),
            bad_frames: BadFrames::default(),
            supersample: 8,
            seed: 1,
        }
    }

    /// The paper's second experiment: as [`Self::centred`], but with the camera at (0.5, 0, 0.5) m
    /// while the initial poses are on the axis.
    pub fn off_centre() -> Self {
        Self {
            offset_m: [0.5, 0.0, 0.5],
            ..Self::centred()
        }
    }

    /// The paper's third experiment: ten turns of twelve frames, 0.10 m and 30° per frame, with
    /// random errors of 2° and (2, 2, 3) cm (1-σ) in each step.
    pub fn free() -> Self {
        Self {
            frames: 120,
            advance_m: 0.10,
            jitter: Some(PriorSection::default()),
            ..Self::centred()
        }
    }

    /// Number of the frames of all cameras.
    pub fn pictures(&self) -> usize {
        self.frames * self.rig.map_or(1, |rig| rig.cameras as usize)
    }

    /// The cameras.
    pub(super) fn cameras(&self) -> Cameras {
        let rig = self.rig.map(|rig| rig.cameras(&self.camera));
        rig.and_then(Cameras::of_rig)
            .unwrap_or_else(|| self.camera.into())
    }

    /// The pose prior that is written into the survey.
    ///
    /// It is the jitter's model, or without jitter one wide enough for the camera's offset.
    pub(super) fn prior(&self) -> PriorSection {
        // A prior must have positive sigmas.
        const MIN_SIGMA_DEG: f64 = 0.01;
        const MIN_SIGMA_M: f64 = 1e-4;
        match self.jitter {
            Some(jitter) => PriorSection {
                rotation_sigma_deg: jitter.rotation_sigma_deg.max(MIN_SIGMA_DEG),
                translation_sigma_m: std::array::from_fn(|k| {
                    jitter.translation_sigma_m[k].max(MIN_SIGMA_M) + self.offset_m[k].abs()
                }),
                ..jitter
            },
            None => PriorSection {
                model: JitterModel::Independent,
                rotation_sigma_deg: 1.0,
                translation_sigma_m: self.offset_m.map(|offset| offset.abs() + 0.02),
            },
        }
    }

    /// Validates every value.
    ///
    /// # Errors
    /// [`SimulateError::Option`] with the name of the first impossible option.
    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        let positive = |v: f64| v.is_finite() && v > 0.0;
        let not_negative = |v: f64| v.is_finite() && v >= 0.0;
        check_option(
            (1..=1_000_000).contains(&self.frames),
            "the number of frames must lie between 1 and 1000000",
        )?;
        check_option(
            (0.01..=1000.0).contains(&self.tunnel.nominal_m()),
            "the radius (half the width) must lie between 0.01 and 1000 metres",
        )?;
        let side = |pixels| (16..=16_384).contains(&pixels);
        check_option(
            side(self.camera.width) && side(self.camera.height),
            "a frame must be 16 to 16384 pixels wide and high",
        )?;
        let camera = &self.camera;
        let numbers = [camera.fx, camera.fy, camera.cx, camera.cy];
        check_option(
            numbers.iter().all(|v| v.is_finite()) && positive(camera.fx) && positive(camera.fy),
            "the focal lengths must be positive, and the field of view below 180 degrees",
        )?;
        check_option(
            camera.visible_fraction() > 0.0,
            "the lens must show some part of the image",
        )?;
        check_option(
            self.advance_m.abs() <= 1000.0 && self.turn_deg.is_finite(),
            "the advance must be no more than 1000 metres a frame, and the turn finite",
        )?;
        check_option(
            (0.0..=180.0).contains(&self.view_deg),
            "the angle of the view must lie between 0 and 180 degrees",
        )?;
        check_option(
            self.offset_m.iter().all(|v| v.is_finite()),
            "the offset must be finite",
        )?;
        if let Some(jitter) = &self.jitter {
            check_option(
                not_negative(jitter.rotation_sigma_deg)
                    && jitter.translation_sigma_m.iter().all(|v| not_negative(*v)),
                "the sigmas of the jitter must not be negative",
            )?;
        }
        check_option(
            positive(self.interval_s),
            "the time from frame to frame must be a positive number of seconds",
        )?;
        check_option(
            (1e-3 * self.readout_ms).abs() < self.interval_s,
            "reading out a frame must take less time than the interval between frames",
        )?;
        if let Wall::Texture { width_m, .. } = self.wall {
            check_option(
                positive(width_m),
                "the width of the texture must be a positive number of metres",
            )?;
        }
        if let Some(rig) = &self.rig {
            rig.validate()?;
            let is_still = self.readout_ms == 0.0
                && !self.interlaced
                && self.effects.motion_blur_px == 0.0
                && self.bad_frames == BadFrames::default();
            check_option(
                is_still,
                "a rig has no rolling shutter, interlaced fields, motion blur or bad frames",
            )?;
        }
        self.validate_degradations()
    }

    /// Checks what makes the survey differ from an ideal one.
    fn validate_degradations(&self) -> Result<(), SimulateError> {
        let radius_m = self.tunnel.nominal_m();
        self.as_built.validate(radius_m)?;
        self.fittings.validate()?;
        self.effects.validate(self.bits)?;
        if let Some(lamp) = &self.camera_lamp {
            lamp.validate(radius_m)?;
        }
        check_option(
            self.noise_grey.is_finite() && self.noise_grey >= 0.0,
            "the noise must not be negative",
        )?;
        check_option(
            (1..=16).contains(&self.supersample),
            "1 to 16 points may be sampled along each side of a pixel",
        )?;
        check_option(
            (0.0..100.0).contains(&self.gain_percent),
            "the gain may vary by 0 to less than 100 percent",
        )?;
        check_option(
            (0.0..=255.0).contains(&self.bias_grey),
            "the bias may vary by 0 to 255 grey levels",
        )?;
        check_option(
            self.lamp_corner.is_none_or(|c| c > 0.0 && c <= 1.0),
            "the lamp's light in the corner must be a share above 0 and up to 1",
        )?;
        check_option(
            (0.0..=90.0).contains(&self.specular_percent),
            "wet patches may cover 0 to 90 percent of the wall",
        )?;
        check_option(
            self.moving <= 10_000,
            "there may be no more than 10000 moving objects in a frame",
        )?;
        check_option(
            (0.0..=50.0).contains(&self.shaft_percent),
            "the shaft may be 0 to 50 percent of a frame wide",
        )?;
        Ok(self.bad_frames.validate(self.frames)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn presets_are_valid_and_impossible_options_are_refused() {
        let presets = [
            SimulateOptions::centred(),
            SimulateOptions::off_centre(),
            SimulateOptions::free(),
        ];
        for preset in &presets {
            preset.validate().unwrap();
            let prior = preset.prior();
            assert!(prior.rotation_sigma_deg > 0.0);
            assert!(prior.translation_sigma_m.iter().all(|sigma| *sigma > 0.0));
        }
        let free = SimulateOptions::free;
        let wrong = [
            SimulateOptions {
                frames: 0,
                ..free()
            },
            SimulateOptions {
                tunnel: TunnelSection::round(f64::NAN),
                ..free()
            },
            SimulateOptions {
                camera: Camera::from_vertical_fov(8, 480, 1.0),
                ..free()
            },
            SimulateOptions {
                camera: Camera::from_vertical_fov(640, 480, TAU),
                ..free()
            },
            SimulateOptions {
                noise_grey: -1.0,
                ..free()
            },
            SimulateOptions {
                interval_s: 0.0,
                ..free()
            },
            SimulateOptions {
                interval_s: 0.02,
                readout_ms: -20.0,
                ..free()
            },
            SimulateOptions {
                readout_ms: f64::NAN,
                ..free()
            },
            SimulateOptions {
                view_deg: -1.0,
                ..free()
            },
            SimulateOptions {
                supersample: 0,
                ..free()
            },
            SimulateOptions {
                gain_percent: 100.0,
                ..free()
            },
            SimulateOptions {
                bias_grey: -1.0,
                ..free()
            },
            SimulateOptions {
                lamp_corner: Some(0.0),
                ..free()
            },
            SimulateOptions {
                lamp_corner: Some(f64::NAN),
                ..free()
            },
            SimulateOptions {
                specular_percent: 91.0,
                ..free()
            },
            SimulateOptions {
                moving: 10_001,
                ..free()
            },
            SimulateOptions {
                shaft_percent: 51.0,
                ..free()
            },
            SimulateOptions {
                bad_frames: "120:black".parse().unwrap(),
                ..free()
            },
        ];
        for options in wrong {
            assert!(options.validate().is_err(), "{options:?}");
        }
    }
}
