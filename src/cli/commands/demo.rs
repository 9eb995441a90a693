//! `tunnelstitch demo`: runs all steps on a simulated survey.

use super::compare::stage_comparison;
use super::overlay::leave_out_overlay;
use super::refine_files::{check_outputs, stage_refined};
use super::refine_summary::print_summary;
use super::report::stage_report;
use crate::cli::arguments::output_folder;
use crate::cli::output::{DryRunArguments, Failure, Job, RUN_FILE, RunRecord, Terminal, json};
use crate::evaluate::{Comparison, compare_survey};
use crate::files::printed;
use crate::persist::atomic;
use crate::refine::RefineOptions;
use crate::render::{Interpolation, Layout};
use crate::report::{RefinedFiles, Sources};
use crate::simulate::{self, SimulateOptions};
use crate::survey::Survey;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Runs all steps: simulates a survey with pose errors, refines the poses, compares and reports.
///
/// In the survey a rotating camera flies through a brick tunnel: ten turns of twelve frames; each
/// step deviates from the plan by 2° and a few centimetres (1-σ). An earlier demo in the same
/// folder is replaced.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  tunnelstitch demo\n  tunnelstitch demo --turns 2 --out small-demo"
)]
pub struct DemoArguments {
    /// Folder for all output; created if missing.
    #[arg(
        long,
        short,
        value_name = "DIR",
        default_value = "tunnelstitch-demo",
        value_parser = output_folder()
    )]
    out: PathBuf,
    /// Number of turns of the camera, twelve frames each.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 10,
        value_parser = clap::value_parser!(u16).range(1..=1000)
    )]
    turns: u16,
    /// Random seed of wall, jitter and noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

/// Frames of a turn of the camera.
const FRAMES_PER_TURN: usize = 12;

/// Folders of the demo's steps.
struct DemoFolders {
    survey: PathBuf,
    refined: PathBuf,
    compared: PathBuf,
    report: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// An output that cannot be written.
pub fn run(
    arguments: &DemoArguments,
    record: &RunRecord,
    terminal: &Arc<Terminal>,
) -> Result<(), Failure> {
    let since = Instant::now();
    let say = |text: String| terminal.say(text);
    let folder = |name: &str| arguments.out.join(name);
    let folders = DemoFolders {
        survey: folder("survey"),
        refined: folder("refined"),
        compared: folder("compare"),
        report: folder("report"),
    };
    if arguments.dry_run.is_set() {
        return describe(arguments, &folders).print(terminal);
    }
    let (survey_path, refined_path) = (printed(&folders.survey), printed(&folders.refined));
    let compare_path = printed(&folders.compared);
    let options = SimulateOptions {
        frames: FRAMES_PER_TURN * usize::from(arguments.turns),
        seed: arguments.seed,
        ..SimulateOptions::free()
    };
    say(format!(
        "tunnelstitch simulate free --turns {} --seed {} --out {survey_path}",
        arguments.turns, arguments.seed
    ));
    simulate::write_survey(&options, &folders.survey, true, terminal.as_ref())?;

    say(format!(
        "\ntunnelstitch refine {survey_path} --out {refined_path}"
    ));
    let mut survey = Survey::open(&folders.survey)?;
    let out = &folders.refined;
    check_outputs(&survey, out)?;
    let overlay = leave_out_overlay(&mut survey, terminal)?;
    let options = RefineOptions::default();
    let (refined, _, outputs) = stage_refined(
        &survey,
        &overlay,
        &options,
        out,
        record,
        (None, None),
        terminal,
    )?;
    outputs.commit()?;
    if !terminal.is_json() {
        print_summary(&refined.report, false, terminal);
    }

    let poses = folders.refined.join("poses.tum");
    say(format!(
        "\ntunnelstitch compare {survey_path} --refined {} --out {compare_path}",
        printed(&poses)
    ));
    let (comparison, json) = compare_and_report(&survey, &folders, record, terminal)?;
    record.write(&arguments.out.join(RUN_FILE), &[])?;
    if terminal.is_json() {
        return json::print_text(&json);
    }
    let report_path = printed(&folders.report);
    say(format!(
        "{comparison}\n\n\
         tunnelstitch report {survey_path} --refined {refined_path} --out {report_path}\n\n\
         {:.0} s in total. Results:\n  \
         {report_path}/report.html       all results on one page; report.json has its numbers\n  \
         {compare_path}/before-after.png  extract: initial poses above, refined below\n  \
         {compare_path}/refined.png       the panorama; baseline.png and truth.png beside it\n  \
         {refined_path}/poses.tum         the refined poses; refine.json has their uncertainty",
        since.elapsed().as_secs_f64()
    ));
    Ok(())
}

/// The work of the demo, for `--dry-run`.
fn describe(arguments: &DemoArguments, folders: &DemoFolders) -> Job {
    let DemoFolders {
        survey,
        refined,
        compared,
        report,
    } = folders;
    let frames = FRAMES_PER_TURN * usize::from(arguments.turns);
    let mut writes = [survey, refined, compared, report]
        .map(PathBuf::clone)
        .to_vec();
    writes.push(arguments.out.join(RUN_FILE));
    Job {
        writes,
        amount: Some(format!(
            "{frames} frames to simulate, refine, compare and report"
        )),
        ..Job::default()
    }
}

/// Compares initial, refined and true poses and writes the report; returns the comparison and the
/// text of compare.json.
fn compare_and_report(
    survey: &Survey,
    folders: &DemoFolders,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(Comparison, String), Failure> {
    let refined = RefinedFiles::read(survey, &folders.refined)?;
    let poses = refined.path.clone();
    atomic::create_folder(&folders.compared)?;
    let (comparison, drawings) = compare_survey(
        survey,
        &refined.poses,
        None,
        Interpolation::default(),
        terminal,
    )?;
    let sources = Sources {
        survey,
        refined,
        comparison: &comparison,
        drawings: &drawings,
        command: record.arguments.clone(),
    };
    let (_, _, report) = stage_report(sources, &folders.report, terminal)?;
    report.commit()?;
    let (json, outputs) = stage_comparison(
        survey,
        &poses,
        Layout::default(),
        &comparison,
        drawings,
        &folders.compared,
        terminal,
    )?;
    outputs.commit()?;
    Ok((comparison, json))
}
