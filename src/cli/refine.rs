//! `tunnelstitch refine`.

use super::{Failure, Terminal, json};
use crate::PROGRAM;
use crate::atomic;
use crate::progress::Progress;
use crate::refine::{FrameFlag, RefineOptions, RefineReport, Refined, refine};
use crate::survey::{Survey, SurveyFile};
use crate::trajectory::tum;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Corrects the poses of a survey by photometric consistency.
///
/// Reads SURVEY/survey.toml and writes poses.tum (camera-to-world, for evo and everything else that reads
/// TUM), refine.json (costs, residuals, gains, 1-σ of every frame, timings) and covariance.csv (6 × 6
/// covariance of every frame and of neighbours) into DIR.
#[derive(Debug, clap::Args)]
pub struct RefineArguments {
    /// Folder of the survey (with survey.toml), or the file itself.
    survey: PathBuf,
    /// Folder for the results; made if missing.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
    /// End the last solve with the first step shorter than 0.1 px or twice the uncertainty, most often its first: less time.
    #[arg(long)]
    fast: bool,
    /// Steps of each global solve, at the most.
    #[arg(long, value_name = "N", default_value_t = RefineOptions::default().max_iterations, value_parser = clap::value_parser!(u64).range(1..))]
    max_iterations: u64,
    /// Print refine.json on standard output instead of the summary.
    #[arg(long)]
    json: bool,
}

/// `refine.json`.
#[derive(Serialize)]
struct ReportFile<'a> {
    /// Name and version of the program.
    program: &'static str,
    /// The survey as given, and what its survey.toml says.
    survey: &'a Path,
    survey_file: &'a SurveyFile,
    /// The effective options.
    options: &'a RefineOptions,
    #[serde(flatten)]
    report: &'a RefineReport,
}

/// Runs the command.
///
/// # Errors
/// Bad input, or an output that cannot be written.
pub fn run(arguments: &RefineArguments, terminal: &Arc<Terminal>) -> Result<(), Failure> {
    let options = RefineOptions {
        max_iterations: arguments.max_iterations,
        ..match arguments.fast {
            true => RefineOptions::fast(),
            false => RefineOptions::default(),
        }
    };
    let (refined, json) = refine_into(&arguments.survey, &options, &arguments.out, terminal)?;
    if arguments.json {
        json::print_text(&json)?;
    } else {
        summarise(&refined, terminal);
        terminal.say(format!(
            "wrote {} and {}",
            arguments.out.join("poses.tum").display(),
            arguments.out.join("refine.json").display()
        ));
    }
    Ok(())
}

/// Refines a survey and writes poses.tum, refine.json and covariance.csv into `out`; returns the text of the latter too.
///
/// # Errors
/// Bad input, or an output that cannot be written.
pub fn refine_into(
    survey_path: &Path,
    options: &RefineOptions,
    out: &Path,
    terminal: &Arc<Terminal>,
) -> Result<(Refined, String), Failure> {
    let survey = Survey::open(survey_path)?;
    atomic::create_folder(out)?;
    let progress: Arc<dyn Progress> = Arc::clone(terminal) as Arc<dyn Progress>;
    let refined = refine(&survey, options, &progress)?;
    let json = json::text(&ReportFile {
        program: PROGRAM,
        survey: survey_path,
        survey_file: &survey.file,
        options,
        report: &refined.report,
    })?;
    atomic::write_text(&out.join("poses.tum"), &tum::format(&refined.trajectory))?;
    atomic::write_text(&out.join("refine.json"), &json)?;
    let sigmas: Vec<_> = refined
        .report
        .frames
        .iter()
        .map(|frame| frame.sigma)
        .collect();
    atomic::write_text(
        &out.join("covariance.csv"),
        &refined.covariances.csv(&sigmas),
    )?;
    Ok((refined, json))
}

/// Prints what the refinement did.
pub fn summarise(refined: &Refined, terminal: &Terminal) {
    let report = &refined.report;
    terminal.say("  level  steps        cost: start → end      observations  noise (grey)");
    for level in &report.levels {
        let solve = &level.solve;
        terminal.say(format!(
            "  {:>5}  {:>5}  {:>12.4e} → {:>11.4e}  {:>12}  {:>12.2}",
            level.level,
            solve.iterations,
            solve.cost_start,
            solve.cost_end,
            solve.observations,
            solve.sigma
        ));
    }
    let mean = |value: &dyn Fn(&crate::refine::FrameReport) -> f64| {
        report.frames.iter().map(value).sum::<f64>() / report.frames.len() as f64
    };
    terminal.say(format!(
        "  stopped: {}\n  mean 1-σ: rotation {:.4}°, translation {:.2} mm, on the wall {:.2} mm ({:.3} px)",
        report.stopped_because,
        mean(&|f| f.sigma.rotation_deg),
        1e3 * mean(&|f| f.sigma.translation_m),
        1e3 * mean(&|f| f.sigma.wall_m),
        mean(&|f| f.sigma.wall_px),
    ));
    let seconds: f64 = report.timings.iter().map(|t| t.seconds).sum();
    let stages: Vec<String> = report
        .timings
        .iter()
        .map(|t| format!("{} {:.2} s", t.stage, t.seconds))
        .collect();
    terminal.say(format!("  {seconds:.2} s: {}", stages.join(", ")));
    if report.frames_on_prior == 0 {
        terminal.say(format!("  all {} frames improved", report.frames.len()));
    } else {
        terminal.warn(format!(
            "{} of {} frames could not be made sure by their pixels; do not rely on them without their prior:",
            report.frames_on_prior,
            report.frames.len()
        ));
        if report.frames_on_prior == report.frames.len() {
            terminal.warn(
                "  no frame is sure: too few overlapping frames, a wall without texture, poses in another convention \
                 (they must be camera-to-world, with the tunnel's axis along y), or a wrong radius_m, calibration or \
                 [prior]",
            );
        }
        for frame in &report.frames {
            if let (FrameFlag::Prior, Some(reason)) = (frame.flag, &frame.reason) {
                terminal.warn(format!(
                    "  frame {} ({}): {reason}",
                    frame.index, frame.file
                ));
            }
        }
    }
}
