//! Final poses: those of frames that their pixels place as solved, all others by the prior.

use crate::model::frame_states::{is_placed, reject_placed};
use crate::model::rejection::RejectionReason;
use crate::options::Photometry;
use crate::parameters::calibration::Datum;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::refined::Refined;
use crate::report::{
    FrameFlag, FrameReport, HiddenBand, LevelReport, PoseReport, RefineReport, StageTime,
};
use crate::stages::setup::Setup;
use crate::stages::state::GlobalSolve;
use crate::uncertainty::bend_report::BendReport;
use crate::uncertainty::calibration_report::CalibrationReport;
use crate::uncertainty::covariance::Covariances;
use crate::uncertainty::frame_sigma::{FrameSigma, compute_frame_sigma};
use crate::uncertainty::masked_report::MaskedReport;
use crate::uncertainty::model_error::ModelErrorReport;
use crate::uncertainty::rolling_shutter_test::ReadoutEstimate;
use crate::uncertainty::shape_report::{EstimatedShape, ShapeReport};
use crate::verdict::bridging::Bridging;
use crate::verdict::length_scale::LengthScale;
use crate::verdict::other_readings::OtherReadings;
use crate::verdict::prior_test::{GivenLengths, PriorTest};
use crate::verdict::rig_report::MountReport;
use crate::verdict::survey_verdict::SurveyVerdict;
use nalgebra::{Matrix6, Vector3};
use std::sync::Arc;
use tunnelstitch_core::frames::{Light, PictureNoise};
use tunnelstitch_core::survey::MaskedWall;
use tunnelstitch_geometry::surface::{Bend, GaugeMotion, Surface, WallPoint, bent};
use tunnelstitch_geometry::trajectory::{Pose, Rig, StampedPose, Trajectory, poses_of};

/// The final poses of all frames, and the verdict that they follow from.
pub struct Placement {
    /// Poses in the tunnel of the given radius, aligned with the initial ones.
    estimates: Vec<FrameEstimate>,
    /// Final poses, metres.
    poses: Vec<Pose>,
    covariances: Covariances,
    rejections: Vec<Option<RejectionReason>>,
    prior_test: PriorTest,
    /// Shape of the wall; None if it is as planned.
    shape: Option<EstimatedShape>,
    /// Bend of the tunnel; None if it is as planned.
    bend: Option<Bend>,
    /// The tunnel along it.
    nominal: Arc<dyn Surface>,
    /// Displacement on the unrolled wall by the alignment, and the scale of the datum after it.
    wall_motion: (WallPoint, f64),
}

/// Parts of the report that the poses do not determine.
pub struct ReportParts {
    /// Frames in order.
    pub frames: Vec<FrameReport>,
    /// The reason for which the last solve stopped, in words.
    pub stopped_because: String,
    /// Global solves.
    pub levels: Vec<GlobalSolve>,
    /// The rolling-shutter test.
    pub rolling_shutter: Option<ReadoutEstimate>,
    /// Errors beyond noise that the residuals show.
    pub model_error: Option<ModelErrorReport>,
    /// The wall's shape, if it was estimated.
    pub shape: Option<ShapeReport>,
    /// 1-σ of the tunnel's curvature, 1/m, where it was found to bend.
    pub bend_sigma_per_m: Option<[f64; 2]>,
    /// The wall where frames were left out, before the alignment; None if nothing was solved.
    pub masked: Option<MaskedWall>,
    /// Self-calibration.
    pub calibration: Option<CalibrationReport>,
    /// Time by stage.
    pub timings: Vec<StageTime>,
}

impl Placement {
    /// Aligns the estimates with the initial poses along the gauge, tests the prior, and gives all
    /// frames that are neither photometric nor uncertain their poses by it. If the prior
    /// contradicts the lengths, no frame is photometric.
    pub fn new(
        setup: &Setup,
        datum: &Datum,
        (estimates, shape): (&[FrameEstimate], Option<EstimatedShape>),
        covariances: &Covariances,
        mut rejections: Vec<Option<RejectionReason>>,
    ) -> Self {
        let prior = &setup.prior;
        let mut placed = placed(&rejections);
        let gauge = setup.initial_context(PictureNoise::default()).gauge();
        let motion = prior.align_gauge(&gauge, estimates, datum, &placed);
        let planned = &setup.input.surface;
        let before = bent(planned, datum.bend);
        let datum = &datum.moved(&motion);
        let nominal = bent(planned, datum.bend);
        let walls = [before.as_ref(), nominal.as_ref()];
        let by = displacement_by(&motion, walls, &estimates[0].pose);
        let shape = shape.map(|shape| shape.moved(by, datum.scale));
        let mut estimates = aligned(estimates, &motion);
        let mut covariances = covariances.clone().moved(&motion).scaled(datum.scale);
        let poses: Vec<Pose> = estimates.iter().map(|estimate| estimate.pose).collect();
        let alpha = setup.options.false_alarm_rate;
        let prior_test = PriorTest::new(
            prior,
            (datum, given_lengths(setup)),
            &poses,
            &covariances,
            &placed,
            alpha,
        );
        if let Some(scale) = prior_test.contradicting_scale() {
            let factor = scale.factor;
            reject_placed(
                &mut rejections,
                &RejectionReason::ContradictsScale { factor },
            );
            placed.fill(false);
        }
        for rejection in rejections.iter_mut().flatten() {
            if let RejectionReason::Ambiguous { other, .. } = rejection {
                *other = datum.to_metres(&motion.apply(other));
            }
        }
        let bridging = Bridging {
            prior,
            datum,
            placed: &placed,
        };
        if bridging
            .apply(&mut estimates, &mut covariances.frames)
            .is_err()
        {
            for k in (0..estimates.len()).filter(|k| !placed[*k]) {
                covariances.frames[k] = Matrix6::from_element(f64::NAN);
            }
        }
        for k in 1..estimates.len() {
            if !(placed[k - 1] && placed[k]) {
                covariances.next[k - 1] = Matrix6::from_element(f64::NAN);
            }
        }
        let is_kept = !placed.contains(&true);
        let poses = estimates
            .iter()
            .zip(&prior.initial)
            .map(|(estimate, initial)| {
                if is_kept {
                    *initial
                } else {
                    datum.to_metres(&estimate.pose)
                }
            });
        Self {
            poses: poses.collect(),
            estimates,
            covariances,
            rejections,
            prior_test,
            shape: shape.filter(|_| !is_kept),
            bend: datum.bend.filter(|_| !is_kept).or(setup.input.bend),
            nominal,
            wall_motion: (by, datum.scale),
        }
    }

    /// The report of frame `k`, without what the last solve says of it; `sigma`: by that solve.
    pub fn report_frame(&self, setup: &Setup, k: usize, sigma: FrameSigma) -> FrameReport {
        let rejection = self.rejections[k].as_ref();
        let (surface, camera) = (self.nominal.as_ref(), setup.input.cameras.of(k));
        FrameReport {
            index: k,
            file: setup.input.frames[k].name(),
            initial_interpolated: setup.prior.variance_ratios[k] > 1.0,
            flag: match rejection {
                None => FrameFlag::Photometric,
                Some(RejectionReason::Ambiguous { .. }) => FrameFlag::Ambiguous,
                Some(reason) if reason.is_uncertain() => FrameFlag::Uncertain,
                Some(_) => FrameFlag::Prior,
            },
            other_pose: match rejection {
                Some(RejectionReason::Ambiguous { other, .. }) => Some(PoseReport::from(other)),
                _ => None,
            },
            reason: rejection.map(ToString::to_string),
            points: 0,
            residual: 0.0,
            inlier_share: 0.0,
            gain: 1.0,
            bias: 0.0,
            sigma: if is_placed(&self.rejections[k]) {
                sigma
            } else {
                let covariance = &self.covariances.frames[k];
                compute_frame_sigma(surface, camera, &self.estimates[k], covariance)
            },
            overdispersion_px: 0.0,
        }
    }

    /// The result.
    pub fn refined(self, setup: &Setup, parts: ReportParts) -> Refined {
        let sigmas = |flag: FrameFlag| -> Vec<FrameSigma> {
            let frames = parts.frames.iter().filter(|frame| frame.flag == flag);
            frames.map(|frame| frame.sigma).collect()
        };
        let [photometric, uncertain] = [FrameFlag::Photometric, FrameFlag::Uncertain].map(sigmas);
        let placed_frames = photometric.len() + uncertain.len();
        let is_any_placed = placed_frames > 0;
        let lengths = given_lengths(setup);
        let scale = self.prior_test.contradicting_scale();
        let contradiction = scale.map(|scale| scale.explain(lengths));
        let verdict = SurveyVerdict::new(
            (&photometric, &uncertain),
            parts.frames.len(),
            setup.options.max_sigma_px,
            parts.model_error.as_ref(),
            contradiction.as_deref(),
        );
        let points = setup.wall.as_ref().map(|wall| wall.report.clone());
        let radius = (lengths.radius_m, setup.input.radius_sigma);
        let length_scale = LengthScale::new(radius, parts.calibration.as_ref(), points.as_ref());
        let (by, scale) = self.wall_motion;
        let masked = parts.masked.filter(|_| is_any_placed);
        let masked = masked.map(|masked| masked.moved(by, scale));
        let poses = setup.input.initial.iter().zip(self.poses);
        let poses = poses.map(|(initial, pose)| StampedPose {
            time_s: initial.time_s,
            pose,
        });
        let trajectory: Trajectory = poses.collect();
        let rig = setup.input.rig.as_ref();
        let mounts = rig.map_or_else(Vec::new, |rig| {
            MountReport::of_rig(rig, &poses_of(&trajectory), &placed(&self.rejections))
        });
        Refined {
            bodies: rig.map(|rig| bodies(rig, &trajectory)),
            trajectory,
            report: RefineReport {
                frames_on_prior: parts.frames.len() - placed_frames,
                frames: parts.frames,
                stopped_because: parts.stopped_because,
                levels: parts.levels.into_iter().map(LevelReport::from).collect(),
                rolling_shutter: parts.rolling_shutter,
                photometry: match setup.frames.light() {
                    Light::Normalised => Photometry::Normalised,
                    Light::Even | Light::Shaded(_) => Photometry::Model,
                },
                lamp_m: setup
                    .frames
                    .lamp_m()
                    .map(|lamp_m| lamp_m.map(|x| x * scale)),
                variance_factor: self.covariances.variance_factor,
                model_error: parts.model_error,
                prior_test: self.prior_test,
                mounts,
                verdict,
                scale: length_scale,
                shape: parts.shape,
                masked: (masked.as_ref())
                    .map(|masked| MaskedReport::new(masked, self.nominal.as_ref(), scale)),
                hidden_bands: (setup.hidden_bands.iter())
                    .filter(|_| is_any_placed)
                    .map(|band| HiddenBand::between(*band))
                    .collect(),
                bend: (self.bend.zip(parts.bend_sigma_per_m))
                    .map(|(bend, sigma_per_m)| BendReport::new(bend, sigma_per_m)),
                points,
                calibration: parts.calibration,
                readings: OtherReadings::Untried,
                timings: parts.timings,
            },
            covariances: self.covariances,
            shape: self.shape,
            bend: self.bend,
            masked,
        }
    }
}

/// True for every frame that its pixels place.
fn placed(rejections: &[Option<RejectionReason>]) -> Vec<bool> {
    rejections.iter().map(is_placed).collect()
}

/// The poses of a rig's body by those of its cameras, at the times of the moments.
fn bodies(rig: &Rig, trajectory: &[StampedPose]) -> Trajectory {
    let of_moment = |frames: &[StampedPose]| StampedPose {
        time_s: frames[0].time_s,
        pose: rig.body(&poses_of(frames)),
    };
    trajectory.chunks(rig.cameras()).map(of_moment).collect()
}

/// Displacement of the wall's points, on the unrolled wall, by a motion along the gauge: that of
/// the point that `pose` looks at. `walls`: without and with the motion.
pub fn displacement_by(motion: &GaugeMotion, walls: [&dyn Surface; 2], pose: &Pose) -> WallPoint {
    let [before, after] =
        [(walls[0], *pose), (walls[1], motion.apply(pose))].map(|(wall, pose)| {
            let hit = wall.hit(&pose.t_wc, &(pose.r_wc * Vector3::z()));
            hit.map(|hit| hit.wall).unwrap_or_default()
        });
    WallPoint {
        s_m: after.s_m - before.s_m,
        h_m: after.h_m - before.h_m,
    }
}

/// Moves estimates along the gauge.
fn aligned(estimates: &[FrameEstimate], motion: &GaugeMotion) -> Vec<FrameEstimate> {
    let aligned = estimates.iter().map(|estimate| FrameEstimate {
        pose: motion.apply(&estimate.pose),
        ..*estimate
    });
    aligned.collect()
}

/// The lengths of a survey.
fn given_lengths(setup: &Setup) -> GivenLengths {
    GivenLengths {
        radius_m: setup.input.nominal_radius_m,
        unscaled_unit_m: setup.input.unscaled_unit_m,
    }
}
