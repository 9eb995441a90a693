//! Ablation study of the estimator, which leaves out one technique at a time:
//! `cargo bench --bench ablation [-- FRAMES]`.
//!
//! The surveys are those of `tunnelstitch demo` (120 frames of 640 × 480 px, or FRAMES of them)
//! with seeds 1 to 3. The table gives time and accuracy, the wall error of the refined poses: the
//! root mean square over the surveys, and the worst frame of all. Frames that are left at their
//! prior count as well.

use std::sync::Arc;
use std::time::Instant;
use tunnelstitch::evaluate::wall_error;
use tunnelstitch::progress::{Progress, Silent};
use tunnelstitch::refine::{FrameFlag, RefineOptions, refine};
use tunnelstitch::simulate::{self, SimulateOptions};
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::poses_of;

const SEEDS: u64 = 3;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let frames = std::env::args()
        .skip(1)
        .find_map(|argument| argument.parse().ok());
    let folder = tempfile::tempdir()?;
    let mut surveys = Vec::new();
    for seed in 1..=SEEDS {
        let path = folder.path().join(seed.to_string());
        let free = SimulateOptions::free();
        let options = SimulateOptions {
            seed,
            frames: frames.unwrap_or(free.frames),
            ..free
        };
        simulate::write_survey(&options, &path, false, &Silent)?;
        surveys.push(Survey::open(&path)?);
    }
    println!("| | s | wall error RMS px | worst frame px | frames left out |");
    println!("| --- | --- | --- | --- | --- |");
    for (name, options) in variants() {
        print_row(name, &options, &surveys)?;
    }
    Ok(())
}

/// The two modes, and the default mode without one technique each.
fn variants() -> Vec<(&'static str, RefineOptions)> {
    let all = RefineOptions::default();
    vec![
        ("default", all.clone()),
        (
            "no sliding windows",
            RefineOptions {
                windows: false,
                ..all.clone()
            },
        ),
        (
            "no search",
            RefineOptions {
                search: false,
                ..all.clone()
            },
        ),
        (
            "last solve with one sample per pixel",
            RefineOptions {
                final_density: 1.0,
                ..all.clone()
            },
        ),
        (
            "solves before the last on all of the wall",
            RefineOptions {
                intermediate_information: 1.0,
                ..all.clone()
            },
        ),
        (
            "`--fast`: last solve most often of a single step",
            RefineOptions::fast(),
        ),
    ]
}

/// Refines all surveys with the given options and prints a row of the table.
fn print_row(
    name: &str,
    options: &RefineOptions,
    surveys: &[Survey],
) -> Result<(), Box<dyn std::error::Error>> {
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let (mut seconds, mut square, mut worst, mut out) = (0.0, 0.0, 0.0f64, 0);
    for survey in surveys {
        let since = Instant::now();
        let refined = refine(survey, options, &silent)?;
        seconds += since.elapsed().as_secs_f64();
        let truth = poses_of(survey.truth.as_deref().unwrap_or_default());
        let poses = poses_of(&refined.trajectory);
        let error = wall_error(survey.surface.as_ref(), &survey.camera, &poses, &truth)?;
        square += error.px.rms.powi(2);
        worst = worst.max(error.px.max);
        let frames = refined.report.frames.iter();
        out += frames.filter(|f| f.flag != FrameFlag::Photometric).count();
    }
    let n = surveys.len() as f64;
    let (seconds, rms) = (seconds / n, (square / n).sqrt());
    println!("| {name} | {seconds:.1} | {rms:.4} | {worst:.4} | {out} |");
    Ok(())
}
