//! The input of a refinement: frames, cameras, tunnel, poses and their noise model.

use crate::points::wall_points::WallPoints;
use std::f64::consts::TAU;
use std::sync::Arc;
use tunnelstitch_core::frames::FrameSet;
use tunnelstitch_core::survey::{CalibrateSection, DEFAULT_SHAPE_SIGMA_RADII, PoseGap, Survey};
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::surface::{Bend, RadialField, Surface, WallRegions, with_range};
use tunnelstitch_geometry::trajectory::{Jitter, Rig, Shutter, StampedPose};

/// No part of the wall.
static NOTHING: WallRegions = WallRegions::NONE;

/// Frames with initial poses, the cameras that took them, and the tunnel that they show.
///
/// A [`Survey`] converts into it; [`RefineInput::new`] makes one of parts in memory.
#[derive(Clone, Debug)]
pub struct RefineInput<'a> {
    /// The cameras, at rest.
    pub cameras: Cameras,
    /// The relation of the cameras, if there are several.
    pub rig: Option<Rig>,
    /// The tunnel, in its nominal shape.
    pub surface: Arc<dyn Surface>,
    /// The bend that is known of it, and that `surface` has.
    pub bend: Option<Bend>,
    /// The frames, in the order of their poses.
    pub frames: &'a FrameSet,
    /// The initial poses, camera to world, one per frame.
    pub initial: &'a [StampedPose],
    /// Frames whose initial poses are interpolated between their neighbours.
    pub pose_gaps: &'a [PoseGap],
    /// Noise model of the initial poses.
    pub prior: Jitter,
    /// When the rows of each frame are read.
    pub shutter: Shutter,
    /// Parts of the wall at which frames are not compared.
    pub ignored: &'a WallRegions,
    /// Shared parameters to estimate besides the poses, and their priors.
    pub calibrate: CalibrateSection,
    /// Known displacement of the wall from `surface`, from which its estimation starts.
    pub displacement: Option<&'a RadialField>,
    /// 1-σ of the wall's deviation from its shape, metres; 0 if it is exact.
    pub shape_sigma_m: f64,
    /// Relative 1-σ of the radius, and with it of all lengths; 0 if it is exact.
    pub radius_sigma: f64,
    /// Radius of the tunnel, or half its width, as given; metres.
    pub nominal_radius_m: f64,
    /// Length of a unit of the initial poses as it is taken, metres, if they are of a program whose
    /// models have no scale of their own.
    pub unscaled_unit_m: Option<f64>,
    /// True if the initial poses are those in the tunnel as built: a bend that points show does not
    /// carry them along.
    pub as_built: bool,
    /// The survey that it is, if it is one: where many frames fit nowhere, neighbours are compared
    /// in its other readings.
    pub survey: Option<&'a Survey>,
    /// Measured points of the wall. A [`Survey`] names their file; [`WallPoints::of_survey`] reads
    /// it.
    pub points: Option<&'a WallPoints>,
}

impl<'a> RefineInput<'a> {
    /// Frames of a global shutter, all of the wall to be compared, nothing but poses and exposures
    /// to be estimated.
    ///
    /// `frames` and `initial` correspond one to one.
    pub fn new(
        cameras: impl Into<Cameras>,
        surface: Arc<dyn Surface>,
        frames: &'a FrameSet,
        initial: &'a [StampedPose],
        prior: Jitter,
    ) -> Self {
        Self {
            cameras: cameras
                .into()
                .map(|camera| with_range(camera, surface.as_ref())),
            rig: None,
            bend: None,
            displacement: None,
            shape_sigma_m: DEFAULT_SHAPE_SIGMA_RADII * surface.perimeter_m() / TAU,
            radius_sigma: DEFAULT_SHAPE_SIGMA_RADII,
            nominal_radius_m: surface.perimeter_m() / TAU,
            unscaled_unit_m: None,
            surface,
            frames,
            initial,
            pose_gaps: &[],
            prior,
            shutter: Shutter::default(),
            ignored: &NOTHING,
            calibrate: CalibrateSection::default(),
            as_built: false,
            survey: None,
            points: None,
        }
    }
}

impl<'a> From<&'a Survey> for RefineInput<'a> {
    fn from(survey: &'a Survey) -> Self {
        Self {
            cameras: survey.cameras.clone(),
            rig: survey.rig.clone(),
            surface: Arc::clone(&survey.nominal),
            bend: survey.bend,
            displacement: survey.displacement.as_ref(),
            shape_sigma_m: survey.shape_sigma_m,
            radius_sigma: survey.radius_sigma,
            unscaled_unit_m: survey.unscaled_unit_m,
            frames: &survey.frames,
            initial: &survey.initial,
            pose_gaps: &survey.pose_gaps,
            prior: survey.prior,
            shutter: survey.shutter(),
            ignored: &survey.ignored,
            calibrate: survey.file.calibrate.clone().unwrap_or_default(),
            nominal_radius_m: survey.file.tunnel.nominal_m(),
            as_built: survey.file.poses.as_built == Some(true),
            survey: Some(survey),
            points: None,
        }
    }
}

/// Largest motion of poses that are equal, metres and radians.
const MAX_EQUAL_MOTION: f64 = 1e-6;

/// True if all of two or more poses are equal, so that they say nothing about the frames: every
/// frame would be compared with every other one.
pub fn is_motionless(initial: &[StampedPose]) -> bool {
    let is_equal = |pair: &[StampedPose]| {
        let [a, b] = [&pair[0].pose, &pair[1].pose];
        let motion_m = (a.t_wc - b.t_wc).norm();
        motion_m.max(a.r_wc.angle_to(&b.r_wc)) <= MAX_EQUAL_MOTION
    };
    initial.len() > 1 && initial.windows(2).all(is_equal)
}
