//! Efficiency of the refinement: its errors over the Cramér–Rao bound, and the consistency of its
//! covariances.

use crate::converge::deformation_errors::{DeformationErrors, errors_of};
use crate::converge::error::ConvergeError;
use crate::converge::feasible_survey::draw_survey;
use crate::converge::options::ConvergeOptions;
use crate::converge::sweep_cell::SweepCell;
use crate::converge::wall_deformation::WallDeformation;
use crate::deformation::NodeError;
use crate::normalised_errors::{first_pose_gauge, gauge_fixed_errors, normalised_errors_squared};
use nalgebra::{Matrix6, Vector6};
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;
use std::path::Path;
use std::sync::Arc;
use tunnelstitch_core::persist::atomic::{self, ScratchFolder};
use tunnelstitch_core::progress::{Progress, Silent};
use tunnelstitch_core::survey::Survey;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{Surface, sighted_wall, wall_jacobian};
use tunnelstitch_geometry::trajectory::{Pose, poses_of};
use tunnelstitch_refine::{
    Covariances, FINER, PoseBounds, RefineOptions, UnknownTexture, pose_bounds, refine,
};
use tunnelstitch_simulate::{AsBuilt, Scene, SimulateOptions};

/// 95 % quantile of χ² with 6 degrees of freedom.
const CHI_SQUARE_95: f64 = 12.592;
/// Number of unknowns of a pose.
const POSE_UNKNOWNS: f64 = 6.0;
/// Variance of rounding to whole grey levels, grey levels².
const ROUNDING_VARIANCE: f64 = 1.0 / 12.0;

/// Root mean square errors over all frames except the first, which fixes the gauge.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct PoseRms {
    /// Rotation, degrees per axis.
    pub rotation_deg: f64,
    /// Translation, millimetres per axis.
    pub translation_mm: f64,
    /// Displacement on the wall of the frame's centre and corners, pixels of the frame.
    pub wall_px: f64,
}

/// Ratios of errors to a bound.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ErrorRatio {
    /// Ratio of the rotation errors.
    pub rotation: f64,
    /// Ratio of the translation errors.
    pub translation: f64,
    /// Ratio of the displacements on the wall.
    pub wall: f64,
    /// Ratio over all six unknowns of a pose, `√(mean ξᵀ Σ⁻¹ ξ / 6)`, with Σ the bound.
    ///
    /// It weighs every combination of unknowns by its own bound. The other ratios are dominated by
    /// the least observable combinations, so this one varies least from survey to survey.
    pub pose: f64,
}

impl ErrorRatio {
    /// The ratios of `error` to `bound`, from the normalised errors squared under that bound.
    fn new(error: &PoseRms, bound: &PoseRms, normalised: &[f64]) -> Self {
        let mean = normalised.iter().sum::<f64>() / normalised.len().max(1) as f64;
        Self {
            rotation: error.rotation_deg / bound.rotation_deg,
            translation: error.translation_mm / bound.translation_mm,
            wall: error.wall_px / bound.wall_px,
            pose: (mean / POSE_UNKNOWNS).sqrt(),
        }
    }
}

impl fmt::Display for ErrorRatio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:>10.3} {:>14.3} {:>10.3} {:>10.3}",
            self.rotation, self.translation, self.wall, self.pose
        )
    }
}

/// Result of the efficiency test for one cell.
#[derive(Clone, Debug, Serialize)]
pub struct Efficiency {
    /// Noise model of the poses, and wall.
    pub cell: SweepCell,
    /// 1-σ of the sensor's noise, grey levels.
    pub noise_grey: f64,
    /// Number of surveys, each with its own wall and trajectory.
    pub surveys: usize,
    /// Errors of the refinement.
    pub error: PoseRms,
    /// Cramér–Rao bound without the prior, with known gradients of the texture. This and the others
    /// are with the wall unknown if it is deformed.
    pub bound: PoseRms,
    /// Cramér–Rao bound without the prior, with only the spectrum of the texture known.
    pub unknown_texture_bound: PoseRms,
    /// Bayesian Cramér–Rao bound, with the prior.
    pub bayesian_bound: PoseRms,
    /// Ratio of the errors to the bound.
    pub ratio: ErrorRatio,
    /// Ratio of the errors to the bound with unknown texture.
    pub unknown_texture_ratio: ErrorRatio,
    /// Ratio of the errors to the Bayesian bound.
    pub bayesian_ratio: ErrorRatio,
    /// Mean normalised error squared of a frame; 6 if the stated covariances are consistent.
    pub normalised_error: f64,
    /// Share of frames whose 95 % confidence ellipsoid contains the truth.
    pub inside_95: f64,
    /// Mean ratio of the covariances to those of independent noise
    /// ([`tunnelstitch_refine::RefineReport::variance_factor`]).
    pub variance_factor: f64,
    /// Errors of the deformation; null if walls are not deformed, or none is seen.
    pub deformation: Option<DeformationErrors>,
}

/// Accumulated mean squares of the frames.
#[derive(Clone, Copy, Default)]
struct MeanSquares {
    rotation: f64,
    translation: f64,
    wall: f64,
    count: f64,
}

impl MeanSquares {
    /// Adds a frame's `ξξᵀ`, or its expectation.
    fn add(&mut self, surface: &dyn Surface, camera: &Camera, pose: &Pose, square: &Matrix6<f64>) {
        let trace =
            |first: usize| (0..3).map(|k| square[(first + k, first + k)]).sum::<f64>() / 3.0;
        self.rotation += trace(0);
        self.translation += trace(3);
        let (mut wall, mut points) = (0.0, 0.0);
        for ray_c in camera.corner_and_centre_rays() {
            if let Ok(hit) = sighted_wall(surface, camera, pose, &ray_c) {
                let a = wall_jacobian(pose, &surface.frame(hit.wall));
                wall += (a * square * a.transpose()).trace()
                    * (camera.vertical_focal_px() / hit.range).powi(2);
                points += 1.0;
            }
        }
        self.wall += wall / points;
        self.count += 1.0;
    }

    fn rms(&self) -> PoseRms {
        let root = |sum: f64| (sum / self.count).sqrt();
        PoseRms {
            rotation_deg: root(self.rotation).to_degrees(),
            translation_mm: 1e3 * root(self.translation),
            wall_px: root(self.wall),
        }
    }
}

/// Measures the efficiency over `options.seeds` surveys of each cell.
///
/// `joint`: the refinement solves for the wall jointly with the poses. efficiency.json and
/// efficiency.txt are written into `out`. The bounds assume the sensor's noise plus the variance
/// 1/12 of rounding to whole grey levels.
///
/// # Errors
/// [`ConvergeError`].
pub fn measure_efficiency(
    options: &ConvergeOptions,
    joint: bool,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Vec<Efficiency>, ConvergeError> {
    options.validate()?;
    atomic::create_folder(out)?;
    let cells = options.cells();
    progress.start("experiments", cells.len() * options.seeds as usize);
    let mut table = Vec::new();
    for cell in &cells {
        let (mut error, mut bound) = (MeanSquares::default(), MeanSquares::default());
        let (mut unknown, mut bayesian) = (MeanSquares::default(), MeanSquares::default());
        let (mut normalised, mut factors, mut nodes) = (Vec::new(), 0.0, Vec::new());
        let (mut by_bound, mut by_unknown, mut by_bayesian) = (Vec::new(), Vec::new(), Vec::new());
        let mut surveys = 0;
        for seed in 1..=options.seeds {
            progress.detail(&format!("{cell}, seed {seed}"));
            let Some(survey) = draw_survey(options, cell, seed)?.survey else {
                progress.advance(1);
                continue;
            };
            let run = refine_survey(&survey, &options.deformation, joint, out)?;
            surveys += 1;
            nodes.extend_from_slice(&run.nodes);
            factors += run.stated.variance_factor;
            normalised.extend(run.normalised(&run.stated));
            by_bound.extend(run.normalised(&run.bounds.known));
            by_unknown.extend(run.normalised(&run.bounds.unknown));
            by_bayesian.extend(run.normalised(&run.bounds.bayesian));
            for k in 1..run.truth.len() {
                let add = |squares: &mut MeanSquares, square: &Matrix6<f64>| {
                    squares.add(
                        run.survey.surface.as_ref(),
                        run.survey.cameras.of(k),
                        &run.truth[k],
                        square,
                    );
                };
                add(&mut error, &(run.errors[k] * run.errors[k].transpose()));
                add(&mut bound, &run.bounds.known.frames[k]);
                add(&mut unknown, &run.bounds.unknown.frames[k]);
                add(&mut bayesian, &run.bounds.bayesian.frames[k]);
            }
            progress.advance(1);
        }
        let inside = normalised.iter().filter(|e| **e < CHI_SQUARE_95).count();
        let frames = normalised.len().max(1) as f64;
        table.push(Efficiency {
            cell: cell.clone(),
            noise_grey: options.noise_grey,
            surveys,
            error: error.rms(),
            bound: bound.rms(),
            unknown_texture_bound: unknown.rms(),
            bayesian_bound: bayesian.rms(),
            ratio: ErrorRatio::new(&error.rms(), &bound.rms(), &by_bound),
            unknown_texture_ratio: ErrorRatio::new(&error.rms(), &unknown.rms(), &by_unknown),
            bayesian_ratio: ErrorRatio::new(&error.rms(), &bayesian.rms(), &by_bayesian),
            normalised_error: normalised.iter().sum::<f64>() / frames,
            inside_95: inside as f64 / frames,
            variance_factor: factors / surveys.max(1) as f64,
            deformation: DeformationErrors::of(&nodes),
        });
        // After each cell, so that an interrupted test keeps the finished cells.
        write_files(&table, out)?;
    }
    progress.finish();
    Ok(table)
}

/// Counts the surveys that [`measure_efficiency`] would refine; writes nothing.
///
/// # Errors
/// [`ConvergeError`], as far as it is known before the first survey.
pub fn plan_efficiency(options: &ConvergeOptions, out: &Path) -> Result<usize, ConvergeError> {
    options.validate()?;
    atomic::check_folder(out)?;
    Ok(options.cells().len() * options.seeds as usize)
}

/// Writes efficiency.json and efficiency.txt.
fn write_files(table: &[Efficiency], out: &Path) -> Result<(), ConvergeError> {
    let path = out.join("efficiency.json");
    let json = serde_json::to_string_pretty(table)
        .map_err(|error| atomic::WriteError::new(&path, std::io::Error::other(error)))?
        + "\n";
    atomic::write_text(&path, &json)?;
    let text: String = table.iter().map(|row| format!("{row}\n\n")).collect();
    Ok(atomic::write_text(&out.join("efficiency.txt"), &text)?)
}

/// Refined survey with its errors and bounds.
struct RefinedSurvey {
    survey: Survey,
    truth: Vec<Pose>,
    errors: Vec<Vector6<f64>>,
    bounds: PoseBounds,
    stated: Covariances,
    /// Errors of the deformation at the nodes that are determined.
    nodes: Vec<NodeError>,
}

impl RefinedSurvey {
    /// Normalised errors squared of all frames with a covariance.
    fn normalised(&self, covariances: &Covariances) -> Vec<f64> {
        let errors = normalised_errors_squared(&self.errors, &covariances.frames);
        errors.into_iter().flatten().collect()
    }
}

/// Simulates and refines one survey, and computes its errors and bounds.
///
/// The bounds are those of a wall as drawn whose deformation is unknown: a few millimetres change
/// no slope.
fn refine_survey(
    options: &SimulateOptions,
    deformation: &WallDeformation,
    joint: bool,
    out: &Path,
) -> Result<RefinedSurvey, ConvergeError> {
    let scratch = ScratchFolder::inside(out)?;
    let folder = scratch.path().join("survey");
    tunnelstitch_simulate::write_survey(options, &folder, false, &Silent)?;
    let survey = Survey::open(&folder)?;
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let refining = RefineOptions {
        joint,
        ..RefineOptions::default()
    };
    let refined = refine(&survey, &refining, &silent)?;
    let as_drawn = Scene::new(&SimulateOptions {
        as_built: AsBuilt::default(),
        ..options.clone()
    })?;
    let fine = as_drawn.render_finer(FINER);
    let noise = (options.noise_grey.powi(2) + ROUNDING_VARIANCE).sqrt();
    let texture = estimate_texture(&as_drawn, noise);
    let truth = poses_of(survey.truth.as_deref().unwrap_or_default());
    let poses = poses_of(&refined.trajectory);
    let errors = gauge_fixed_errors(survey.surface.as_ref(), &poses, &truth)?;
    let nodes = match &refined.shape {
        Some(shape) if deformation.is_any() => {
            let gauge = first_pose_gauge(survey.surface.as_ref(), &poses, &truth)?;
            errors_of(shape, &survey, &Scene::new(options)?, &gauge)
        }
        _ => Vec::new(),
    };
    let wall = deformation.prior();
    Ok(RefinedSurvey {
        bounds: pose_bounds(&survey, &fine, noise, &texture, &wall)?,
        stated: refined.covariances,
        nodes,
        truth,
        errors,
        survey,
    })
}

/// Estimates the spectrum of a wall's texture, as sampled by a frame in the middle of the tunnel.
fn estimate_texture(scene: &Scene, noise_grey: f64) -> UnknownTexture {
    let columns = (TAU * scene.camera().vertical_focal_px() * f64::from(FINER)).round() as usize;
    let finer = FINER as usize;
    let side = UnknownTexture::min_side(finer);
    let wall = scene.wall(columns.max(side), 2 * side, 0.0);
    UnknownTexture::of_wall(&wall, finer, noise_grey)
}

impl fmt::Display for Efficiency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} with noise of {} grey levels, {} surveys",
            self.cell, self.noise_grey, self.surveys
        )?;
        writeln!(
            f,
            "{:22} {:>10} {:>14} {:>10} {:>10}",
            "", "rotation °", "translation mm", "wall px", "pose"
        )?;
        let rows = [
            ("error", &self.error),
            ("Cramér–Rao bound", &self.bound),
            ("…, texture unknown", &self.unknown_texture_bound),
            ("Bayesian bound", &self.bayesian_bound),
        ];
        for (name, rms) in rows {
            writeln!(
                f,
                "{name:22} {:>10.5} {:>14.4} {:>10.5}",
                rms.rotation_deg, rms.translation_mm, rms.wall_px
            )?;
        }
        writeln!(f, "{:22} {}", "error / bound", self.ratio)?;
        let unknown = self.unknown_texture_ratio;
        writeln!(f, "{:22} {unknown}", "…, texture unknown")?;
        writeln!(f, "{:22} {}", "error / Bayesian bound", self.bayesian_ratio)?;
        write!(
            f,
            "normalised error squared {:.2} (6 if the covariances are true), \
             {:.1} % inside the 95 % ellipsoid, variance factor {:.2}",
            self.normalised_error,
            100.0 * self.inside_95,
            self.variance_factor
        )?;
        match &self.deformation {
            Some(deformation) => write!(f, "\n{deformation}"),
            None => Ok(()),
        }
    }
}
