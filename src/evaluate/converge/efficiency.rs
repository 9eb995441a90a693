//! How close the refinement comes to the Cramér–Rao bound, and whether the uncertainty it states is
//! true.

use super::draw::draw;
use super::{Cell, ConvergeError, ConvergeOptions};
use crate::camera::Camera;
use crate::evaluate::{normalised_errors, tied_errors};
use crate::persist::atomic::{self, ScratchFolder};
use crate::progress::{Progress, Silent};
use crate::refine::{
    Covariances, FINER, PoseBounds, RefineOptions, UnknownTexture, pose_bounds, refine,
};
use crate::simulate::{self, Scene, SimulateOptions};
use crate::surface::{Surface, wall_jacobian};
use crate::survey::Survey;
use crate::trajectory::{Pose, poses_of};
use nalgebra::{Matrix6, Vector6};
use serde::Serialize;
use std::f64::consts::TAU;
use std::fmt;
use std::path::Path;
use std::sync::Arc;

/// 95 % of χ² with 6 degrees of freedom lie below.
const CHI_SQUARE_95: f64 = 12.592;
/// Unknowns of a pose.
const UNKNOWNS: f64 = 6.0;
/// Variance that rounding to whole grey levels adds, grey levels².
const ROUNDING: f64 = 1.0 / 12.0;

/// Root mean squares over all frames but the first, where the gauge is fixed.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct PoseRms {
    /// Rotation, degrees per axis.
    pub rotation_deg: f64,
    /// Translation, millimetres per axis.
    pub translation_mm: f64,
    /// Position on the wall of the frame's middle and corners, pixels of the frame.
    pub wall_px: f64,
}

/// Errors over a bound.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Ratio {
    /// Of rotations.
    pub rotation: f64,
    /// Of translations.
    pub translation: f64,
    /// Of positions on the wall.
    pub wall: f64,
    /// Of all six unknowns of a pose, each combination by its own bound: `√(mean ξᵀ Σ⁻¹ ξ / 6)`, Σ
    /// the bound. Unlike the others it is not ruled by the few combinations that are known least,
    /// so it scatters least from survey to survey.
    pub pose: f64,
}

impl Ratio {
    /// Of errors over a bound, with the mean of the errors squared over those of the bound.
    fn new(error: &PoseRms, bound: &PoseRms, normalised: &[f64]) -> Self {
        let mean = normalised.iter().sum::<f64>() / normalised.len().max(1) as f64;
        Self {
            rotation: error.rotation_deg / bound.rotation_deg,
            translation: error.translation_mm / bound.translation_mm,
            wall: error.wall_px / bound.wall_px,
            pose: (mean / UNKNOWNS).sqrt(),
        }
    }
}

impl fmt::Display for Ratio {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:>10.3} {:>14.3} {:>10.3} {:>10.3}",
            self.rotation, self.translation, self.wall, self.pose
        )
    }
}

/// One cell of the test.
#[derive(Clone, Debug, Serialize)]
pub struct Efficiency {
    /// The noise of the poses, and the wall.
    pub cell: Cell,
    /// 1-σ of the sensor's noise, grey levels.
    pub noise_grey: f64,
    /// Surveys, each with a wall and a trajectory of its own.
    pub surveys: usize,
    /// Errors made.
    pub error: PoseRms,
    /// Cramér–Rao bound without the prior, with the slopes of the texture known.
    pub bound: PoseRms,
    /// The same with the texture unknown but for its spectrum.
    pub unknown_texture_bound: PoseRms,
    /// Bayesian bound, with it.
    pub bayesian_bound: PoseRms,
    /// Error over bound.
    pub ratio: Ratio,
    /// Error over bound with the texture unknown.
    pub unknown_texture_ratio: Ratio,
    /// Error over Bayesian bound.
    pub bayesian_ratio: Ratio,
    /// Mean normalised error squared of a frame; 6 if the stated covariances are true.
    pub normalised_error: f64,
    /// Share of frames whose 95 % ellipsoid holds the truth.
    pub inside_95: f64,
    /// Mean of the covariances over those of independent noise
    /// ([`crate::refine::RefineReport::variance_factor`]).
    pub variance_factor: f64,
}

/// Mean squares being summed up.
#[derive(Clone, Copy, Default)]
struct Squares {
    rotation: f64,
    translation: f64,
    wall: f64,
    count: f64,
}

impl Squares {
    /// Adds a frame's `E[ξξᵀ]`, expected or made.
    fn add(&mut self, surface: &dyn Surface, camera: &Camera, pose: &Pose, square: &Matrix6<f64>) {
        let trace =
            |first: usize| (0..3).map(|k| square[(first + k, first + k)]).sum::<f64>() / 3.0;
        self.rotation += trace(0);
        self.translation += trace(3);
        let (mut wall, mut points) = (0.0, 0.0);
        for ray_c in camera.probes() {
            let ray = pose.r_wc * ray_c;
            if let Ok(hit) = surface.hit(&pose.t_wc, &ray) {
                let a = wall_jacobian(pose, &surface.frame(hit.wall));
                wall += (a * square * a.transpose()).trace() * (camera.fy / hit.range).powi(2);
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

/// Runs `options.seeds` surveys of each cell, refined with the wall solved for jointly or not, and
/// writes efficiency.json and efficiency.txt into `out`.
///
/// A sensor rounds to whole grey levels; the bounds are for its noise and the rounding's variance,
/// 1/12, together.
///
/// # Errors
/// [`ConvergeError`].
pub fn efficiency(
    options: &ConvergeOptions,
    joint: bool,
    out: &Path,
    progress: &dyn Progress,
) -> Result<Vec<Efficiency>, ConvergeError> {
    options.check()?;
    atomic::create_folder(out)?;
    let cells = options.cells();
    progress.start("experiments", cells.len() * options.seeds as usize);
    let mut table = Vec::new();
    for cell in &cells {
        let (mut error, mut bound) = (Squares::default(), Squares::default());
        let (mut unknown, mut bayesian) = (Squares::default(), Squares::default());
        let (mut normalised, mut factors) = (Vec::new(), 0.0);
        let (mut by_bound, mut by_unknown, mut by_bayesian) = (Vec::new(), Vec::new(), Vec::new());
        let mut surveys = 0;
        for seed in 1..=options.seeds {
            progress.detail(&format!("{cell}, seed {seed}"));
            let Some(survey) = draw(options, cell, seed)?.survey else {
                progress.advance(1);
                continue;
            };
            let run = one(&survey, joint, out)?;
            surveys += 1;
            factors += run.stated.variance_factor;
            normalised.extend(run.by(&run.stated));
            by_bound.extend(run.by(&run.bounds.known));
            by_unknown.extend(run.by(&run.bounds.unknown));
            by_bayesian.extend(run.by(&run.bounds.bayesian));
            for k in 1..run.truth.len() {
                let add = |squares: &mut Squares, square: &Matrix6<f64>| {
                    squares.add(
                        run.survey.surface.as_ref(),
                        &run.survey.camera,
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
            ratio: Ratio::new(&error.rms(), &bound.rms(), &by_bound),
            unknown_texture_ratio: Ratio::new(&error.rms(), &unknown.rms(), &by_unknown),
            bayesian_ratio: Ratio::new(&error.rms(), &bayesian.rms(), &by_bayesian),
            normalised_error: normalised.iter().sum::<f64>() / frames,
            inside_95: inside as f64 / frames,
            variance_factor: factors / surveys.max(1) as f64,
        });
        // Cell by cell: a test that is broken off leaves those that are done.
        write(&table, out)?;
    }
    progress.finish();
    Ok(table)
}

/// Writes efficiency.json and efficiency.txt.
fn write(table: &[Efficiency], out: &Path) -> Result<(), ConvergeError> {
    let path = out.join("efficiency.json");
    let json = serde_json::to_string_pretty(table)
        .map_err(|error| atomic::WriteError::new(&path, std::io::Error::other(error)))?
        + "\n";
    atomic::write_text(&path, &json)?;
    let text: String = table.iter().map(|row| format!("{row}\n\n")).collect();
    Ok(atomic::write_text(&out.join("efficiency.txt"), &text)?)
}

/// One survey refined.
struct Run {
    survey: Survey,
    truth: Vec<Pose>,
    errors: Vec<Vector6<f64>>,
    bounds: PoseBounds,
    stated: Covariances,
}

impl Run {
    /// The normalised errors squared of all frames whose covariance is known.
    fn by(&self, covariances: &Covariances) -> Vec<f64> {
        let errors = normalised_errors(&self.errors, &covariances.frames);
        errors.into_iter().flatten().collect()
    }
}

/// Refines one survey and computes its bounds.
fn one(options: &SimulateOptions, joint: bool, out: &Path) -> Result<Run, ConvergeError> {
    let scratch = ScratchFolder::inside(out)?;
    let folder = scratch.path().join("survey");
    simulate::run(options, &folder, false, &Silent)?;
    let survey = Survey::open(&folder)?;
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let refining = RefineOptions {
        joint,
        ..RefineOptions::default()
    };
    let refined = refine(&survey, &refining, &silent)?;
    let scene = Scene::new(options)?;
    let fine = scene.render_finer(FINER);
    let noise = (options.noise_grey.powi(2) + ROUNDING).sqrt();
    let texture = texture_of(&scene, noise);
    let truth = poses_of(survey.truth.as_deref().unwrap_or_default());
    let errors = tied_errors(
        survey.surface.as_ref(),
        &poses_of(&refined.trajectory),
        &truth,
    )?;
    Ok(Run {
        bounds: pose_bounds(&survey, &fine, noise, &texture)?,
        stated: refined.covariances,
        truth,
        errors,
        survey,
    })
}

/// What can be known of the texture of a survey's wall, seen from the middle of the tunnel.
fn texture_of(scene: &Scene, noise_grey: f64) -> UnknownTexture {
    let columns = (TAU * scene.camera().fy * f64::from(FINER)).round() as usize;
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
            "normalised error squared {:.2} (6 if the covariances are true), {:.1} % inside the 95 % ellipsoid, variance factor {:.2}",
            self.normalised_error,
            100.0 * self.inside_95,
            self.variance_factor
        )
    }
}
