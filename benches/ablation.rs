//! Ablation study of the estimator, which leaves out one mechanism at a time:
//! `cargo bench --bench ablation [-- SURVEY…]`.
//!
//! Without surveys it simulates brick, concrete and tiled brick (48 frames of 320 × 240 px), each
//! once as in `tunnelstitch demo` and once with blurred, occluded and repeated frames. Surveys that
//! are given need true poses. A row of the table sums up all of them: the wall error of the
//! photometric frames (root mean square), their number, the false successes among them, and the
//! time. A false success is a photometric frame that is off by more than half a pixel and 3.5 times
//! its stated σ.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;
use tunnelstitch::camera::Camera;
use tunnelstitch::evaluate::wall_error;
use tunnelstitch::progress::{Progress, Silent};
use tunnelstitch::refine::{
    FrameFlag, Interpolation, RefineOptions, SolvePlan, Stage, refine_in_stages,
};
use tunnelstitch::simulate::{self, SimulateOptions, Wall};
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::poses_of;

/// Faults of the second simulated survey of each wall.
const BAD_FRAMES: &str = "5:blurred,9:blurred,17:occluded,25:occluded,33:blurred,40:repeated";
/// Error of a false success, pixels at least.
const MIN_FALSE_PX: f64 = 0.5;
/// Error of a false success, stated σ at least.
const MIN_FALSE_SIGMA: f64 = 3.5;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let given = std::env::args().skip(1);
    let mut paths: Vec<PathBuf> = given
        .filter(|argument| !argument.starts_with("--"))
        .map(PathBuf::from)
        .collect();
    let folder = tempfile::tempdir()?;
    if paths.is_empty() {
        paths = simulate_surveys(folder.path())?;
    }
    let surveys = paths.iter().map(|path| Survey::open(path));
    let surveys: Vec<Survey> = surveys.collect::<Result<_, _>>()?;
    println!("| without | wall error RMS px | photometric | false successes | s |");
    println!("| --- | --- | --- | --- | --- |");
    for variant in variants() {
        print_row(&variant, &surveys)?;
    }
    Ok(())
}

/// Simulates the default surveys into a folder.
fn simulate_surveys(folder: &Path) -> Result<Vec<PathBuf>, Box<dyn std::error::Error>> {
    let walls = [Wall::Brick, Wall::Concrete, Wall::TiledBrick];
    let mut paths = Vec::new();
    for (k, wall) in walls.into_iter().enumerate() {
        for (seed, bad_frames) in [(1, ""), (2, BAD_FRAMES)] {
            let path = folder.join(format!("{k}-{seed}"));
            let options = SimulateOptions {
                seed,
                frames: 48,
                camera: Camera::from_vertical_fov(320, 240, 60f64.to_radians()),
                wall: wall.clone(),
                bad_frames: match bad_frames {
                    "" => Default::default(),
                    list => list.parse()?,
                },
                ..SimulateOptions::free()
            };
            simulate::write_survey(&options, &path, false, &Silent)?;
            paths.push(path);
        }
    }
    Ok(paths)
}

/// An estimator that lacks a mechanism.
struct Variant {
    without: &'static str,
    options: RefineOptions,
    change: fn(&mut VecDeque<Stage>),
}

/// The default estimator, and that without one mechanism each.
fn variants() -> Vec<Variant> {
    let as_planned: fn(&mut VecDeque<Stage>) = |_| ();
    let of_options = |without, change: fn(&mut RefineOptions)| {
        let mut options = RefineOptions::default();
        change(&mut options);
        Variant {
            without,
            options,
            change: as_planned,
        }
    };
    let of_stages = |without, change| Variant {
        without,
        options: RefineOptions::default(),
        change,
    };
    vec![
        of_options("nothing", |_| ()),
        of_options("correlation search", |options| options.search = false),
        of_options("sliding windows", |options| options.windows = false),
        of_options("dense samples in the last solve", |options| {
            options.final_density = 1.0;
        }),
        of_options("tile selection", |options| {
            options.intermediate_information = 1.0;
        }),
        of_options("many steps and dense samples (`--fast`)", |options| {
            *options = RefineOptions::fast();
        }),
        of_stages("shading correction", |stages| {
            stages.retain(|stage| *stage != Stage::CorrectShading);
        }),
        of_stages("solves between handover and last", |stages| {
            let first = stages.iter().position(is_solve);
            let last = stages.iter().rposition(is_solve);
            let mut k = 0;
            stages.retain(|stage| {
                k += 1;
                !is_solve(stage) || first == Some(k - 1) || last == Some(k - 1)
            });
        }),
        of_stages("repair", |stages| {
            stages.retain(|stage| *stage != Stage::Repair);
        }),
        of_stages("variance weights in the last solve", |stages| {
            change_last_solve(stages, |plan| plan.sampling.variance_weighting = false);
        }),
        of_stages("cubic interpolation in the last solve", |stages| {
            change_last_solve(stages, |plan| {
                plan.sampling.interpolation = Interpolation::Bilinear;
            });
        }),
    ]
}

fn is_solve(stage: &Stage) -> bool {
    matches!(stage, Stage::Solve(_))
}

fn change_last_solve(stages: &mut VecDeque<Stage>, change: fn(&mut SolvePlan)) {
    let mut backwards = stages.iter_mut().rev();
    let last = backwards.find_map(|stage| match stage {
        Stage::Solve(plan) => Some(plan),
        _ => None,
    });
    if let Some(plan) = last {
        change(plan);
    }
}

/// Refines all surveys and prints a row of the table.
fn print_row(variant: &Variant, surveys: &[Survey]) -> Result<(), Box<dyn std::error::Error>> {
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let (mut seconds, mut squares, mut photometric, mut wrong) = (0.0, 0.0, 0, 0);
    for survey in surveys {
        let since = Instant::now();
        let refined = refine_in_stages(survey, &variant.options, variant.change, &silent)?;
        seconds += since.elapsed().as_secs_f64();
        let frames = &refined.report.frames;
        let right = |k: &usize| frames[*k].flag == FrameFlag::Photometric;
        let chosen: Vec<usize> = (0..frames.len()).filter(right).collect();
        if chosen.is_empty() {
            continue;
        }
        let truth = poses_of(survey.truth.as_deref().unwrap_or_default());
        let poses = poses_of(&refined.trajectory);
        let [poses, truth] = [poses, truth]
            .map(|all| -> Vec<_> { chosen.iter().filter_map(|k| all.get(*k).copied()).collect() });
        let error = wall_error(survey.surface.as_ref(), &survey.camera, &poses, &truth)?;
        photometric += chosen.len();
        for (k, error_px) in chosen.iter().zip(&error.frame_rms_px) {
            let sigma_px = frames[*k].sigma.wall_px;
            squares += error_px * error_px;
            wrong += usize::from(*error_px > MIN_FALSE_PX.max(MIN_FALSE_SIGMA * sigma_px));
        }
    }
    let rms = (squares / f64::from(u32::try_from(photometric.max(1))?)).sqrt();
    let frames: usize = surveys.iter().map(|survey| survey.frames.len()).sum();
    let without = variant.without;
    println!("| {without} | {rms:.4} | {photometric} of {frames} | {wrong} | {seconds:.0} |");
    Ok(())
}
