//! `refine.json`: the report of a refinement.

use crate::options::Photometry;
use crate::point_fit::points_report::PointsReport;
use crate::solver::solve_record::SolveRecord;
use crate::uncertainty::bend_report::BendReport;
use crate::uncertainty::calibration_report::CalibrationReport;
use crate::uncertainty::frame_sigma::FrameSigma;
use crate::uncertainty::masked_report::MaskedReport;
use crate::uncertainty::model_error::ModelErrorReport;
use crate::uncertainty::rolling_shutter_test::ReadoutEstimate;
use crate::uncertainty::shape_report::ShapeReport;
use crate::verdict::length_scale::LengthScale;
use crate::verdict::other_readings::OtherReadings;
use crate::verdict::prior_test::PriorTest;
use crate::verdict::rig_report::MountReport;
use crate::verdict::survey_verdict::SurveyVerdict;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::trajectory::Pose;

/// The basis of a frame's refined pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum FrameFlag {
    /// The pixels of the frame.
    Photometric,
    /// The prior alone: the pixels do not determine it.
    Prior,
    /// The prior alone: the pixels allow two poses.
    Ambiguous,
    /// The prior alone: the pixels fit, and tell less than was asked for.
    Uncertain,
}

/// A pose in the report, as in a TUM file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PoseReport {
    /// Position, metres.
    pub translation_m: [f64; 3],
    /// Rotation, camera to world: x, y, z, w.
    pub quaternion_xyzw: [f64; 4],
}

impl From<&Pose> for PoseReport {
    fn from(pose: &Pose) -> Self {
        Self {
            translation_m: pose.t_wc.into(),
            quaternion_xyzw: pose.r_wc.coords.into(),
        }
    }
}

/// One frame of the report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct FrameReport {
    /// Index of the frame.
    pub index: usize,
    /// Name of its file.
    pub file: String,
    /// The basis of its pose.
    pub flag: FrameFlag,
    /// True if the initial pose was not given, but interpolated between those of its neighbours.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub initial_interpolated: bool,
    /// The rejection reason, if the pose rests on the prior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The other pose, if two are possible.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub other_pose: Option<PoseReport>,
    /// Wall samples at which it was compared with other frames.
    pub points: usize,
    /// Root mean square of its residuals against the fused wall, grey levels, as weighted by the
    /// robust loss.
    pub residual: f64,
    /// Share of its pixels' weight that the robust loss left, 0 to 1.
    pub inlier_share: f64,
    /// Gain `a` of `I = a S + b`.
    pub gain: f64,
    /// Bias `b`, grey levels.
    pub bias: f64,
    /// 1-σ relative to the first frame.
    pub sigma: FrameSigma,
    /// Overdispersion: displacement of the frame's patches against the others beyond noise, root
    /// mean square, pixels. Much of it indicates a wrong camera, radius or shape. (Called
    /// `strain_px` until version 0.1; both names are read.)
    #[serde(default, alias = "strain_px")]
    pub overdispersion_px: f64,
}

/// One global solve of the report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LevelReport {
    /// Wall samples per pixel along each axis.
    pub samples_per_pixel: f64,
    /// Pyramid level of these pixels: each halves the frames; 0 is full size.
    #[serde(default)]
    pub level: usize,
    /// True if the wall was solved for jointly with the poses.
    #[serde(default)]
    pub joint: bool,
    /// Its course.
    #[serde(flatten)]
    pub solve: SolveRecord,
}

impl LevelReport {
    /// Size of the pixels, in pixels of full size.
    pub fn pixel_px(&self) -> usize {
        1 << self.level
    }
}

/// Wall-clock time of one stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct StageTime {
    /// Name of the stage.
    pub stage: String,
    /// Seconds.
    pub seconds: f64,
}

/// A band along the tunnel that was left out.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct HiddenBand {
    /// From, degrees of θ.
    pub angle_from_deg: f64,
    /// To; beyond 360 across θ = 0.
    pub angle_to_deg: f64,
}

impl HiddenBand {
    /// The band between two angles, radians.
    pub(crate) fn between(angles: [f64; 2]) -> Self {
        let [angle_from_deg, angle_to_deg] = angles.map(f64::to_degrees);
        Self {
            angle_from_deg,
            angle_to_deg,
        }
    }

    /// The finding in a sentence without a full stop, with the line of survey.toml that leaves the
    /// band out.
    pub fn sentence(&self) -> String {
        let (from, to) = (self.angle_from_deg, self.angle_to_deg.rem_euclid(360.0));
        format!(
            "between θ = {from:.0}° and {to:.0}° most frames show something else than the wall, as \
             on water that mirrors it: this part is left out, as with `ignore = [{{ theta_deg = \
             [{from:.0}, {to:.0}] }}]` in [tunnel]"
        )
    }
}

/// The whole report.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct RefineReport {
    /// Global solves, coarse to fine.
    pub levels: Vec<LevelReport>,
    /// Frames in order.
    pub frames: Vec<FrameReport>,
    /// Frames whose pose rests on the prior: neither photometric nor uncertain.
    pub frames_on_prior: usize,
    /// Treatment of the light: by the model, or by local normalisation.
    pub photometry: Photometry,
    /// Position of the lamp in the camera's frame (x right, y down, z along the optical axis),
    /// metres, if the light is found to be that of one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lamp_m: Option<[f64; 3]>,
    /// The covariance over the inverse of the normal matrix, c of
    /// [`crate::uncertainty::covariance`]: above 1 where residuals err together, below
    /// where they cancel.
    pub variance_factor: f64,
    /// Errors beyond noise, if the residuals show any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub model_error: Option<ModelErrorReport>,
    /// The refined poses against the prior.
    pub prior_test: PriorTest,
    /// Relation of the cameras of a rig against the given one.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mounts: Vec<MountReport>,
    /// The verdict: whether the result may be used, and for what.
    pub verdict: SurveyVerdict,
    /// The scale: how sure all lengths are.
    pub scale: LengthScale,
    /// The rolling-shutter test: the readout time that fits the frames best, where they determine
    /// it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rolling_shutter: Option<ReadoutEstimate>,
    /// The wall's shape, if it was estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub shape: Option<ShapeReport>,
    /// The wall where frames show something else and were left out, if any frame is photometric.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub masked: Option<MaskedReport>,
    /// The bands along the tunnel where most frames show something else, as a mirror of water: they
    /// were left out as if `[tunnel] ignore` had them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub hidden_bands: Vec<HiddenBand>,
    /// The bend of a tunnel that was planned straight, if it was found to have one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bend: Option<BendReport>,
    /// Measured points of the wall, if there are any.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub points: Option<PointsReport>,
    /// Self-calibration, if it was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<CalibrationReport>,
    /// Other readings of poses, pictures and camera, if they were compared: where many frames fit
    /// nowhere.
    #[serde(skip_serializing_if = "OtherReadings::are_untried")]
    pub readings: OtherReadings,
    /// The reason for which the last solve stopped, in words.
    pub stopped_because: String,
    /// Time by stage.
    pub timings: Vec<StageTime>,
}

impl RefineReport {
    /// Number of frames with a flag.
    pub fn count_flagged(&self, flag: FrameFlag) -> usize {
        let frames = self.frames.iter();
        frames.filter(|frame| frame.flag == flag).count()
    }
}
