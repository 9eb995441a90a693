//! `tunnelstitch demo`: the whole job on a simulated survey.

use super::compare::{compare_poses, write_comparison};
use super::record::{RUN_FILE, Run};
use super::refine::{refine_into, summarise};
use super::report::report_into;
use super::{Failure, Terminal, json};
use crate::persist::atomic;
use crate::refine::RefineOptions;
use crate::render::{Interpolation, Layout};
use crate::report::{RefinedFiles, Sources};
use crate::simulate::{self, SimulateOptions};
use crate::survey::Survey;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

/// Shows the whole job: simulates a survey with wrong poses, refines them, stitches and compares.
///
/// The survey is a revolving camera's flight through a brick tunnel: ten turns of twelve frames,
/// each step 2° and a few centimetres off the plan. An earlier demo in the same folder is replaced.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  tunnelstitch demo\n  tunnelstitch demo --turns 2 --out small-demo"
)]
pub struct DemoArguments {
    /// Folder for everything; made if missing.
    #[arg(long, short, value_name = "DIR", default_value = "tunnelstitch-demo")]
    out: PathBuf,
    /// Turns of the camera, twelve frames each.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..=1000))]
    turns: u16,
    /// Seed of wall, jitter and noise.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Print compare.json on standard output instead of the tables.
    #[arg(long)]
    json: bool,
}

/// Runs the command.
///
/// # Errors
/// An output that cannot be written.
pub fn run(arguments: &DemoArguments, run: &Run, terminal: &Arc<Terminal>) -> Result<(), Failure> {
    let since = Instant::now();
    let say = |text: String| {
        if !arguments.json {
            terminal.say(text);
        }
    };
    let [survey_folder, refined_folder, compare_folder, report_folder] =
        ["survey", "refined", "compare", "report"].map(|name| arguments.out.join(name));
    let (survey_path, refined_path, compare_path, report_path) = (
        survey_folder.display(),
        refined_folder.display(),
        compare_folder.display(),
        report_folder.display(),
    );

    let options = SimulateOptions {
        frames: 12 * usize::from(arguments.turns),
        seed: arguments.seed,
        ..SimulateOptions::free()
    };
    say(format!(
        "tunnelstitch simulate free --turns {} --seed {} --out {survey_path}",
        arguments.turns, arguments.seed
    ));
    simulate::write_survey(&options, &survey_folder, true, terminal.as_ref())?;

    say(format!(
        "\ntunnelstitch refine {survey_path} --out {refined_path}"
    ));
    let refine_options = RefineOptions::default();
    let survey = Survey::open(&survey_folder)?;
    let (refined, _) = refine_into(
        &survey,
        &refine_options,
        &refined_folder,
        run,
        None,
        terminal,
    )?;
    if !arguments.json {
        summarise(&refined, terminal);
    }

    let poses = refined_folder.join("poses.tum");
    say(format!(
        "\ntunnelstitch compare {survey_path} --refined {} --out {compare_path}",
        poses.display()
    ));
    let refined = RefinedFiles::read(&survey, &refined_folder)?;
    atomic::create_folder(&compare_folder)?;
    let (comparison, drawings) = compare_poses(
        &survey,
        &refined.poses,
        None,
        Interpolation::default(),
        terminal,
    )?;
    let sources = Sources {
        survey: &survey,
        refined,
        comparison: &comparison,
        drawings: &drawings,
        command: run.arguments.clone(),
    };
    report_into(sources, &report_folder, terminal)?;
    let json = write_comparison(
        &survey,
        &poses,
        Layout::default(),
        &comparison,
        drawings,
        &compare_folder,
        terminal,
    )?;
    run.write(&arguments.out.join(RUN_FILE), &[])?;
    if arguments.json {
        return json::print_text(&json);
    }
    say(format!(
        "{comparison}\n\n\
         tunnelstitch report {survey_path} --refined {refined_path} --out {report_path}\n\n\
         {:.0} s in all. Look at\n  \
         {report_path}/report.html       everything on one page, for a browser; report.json has its numbers\n  \
         {compare_path}/before-after.png  what the poses did to the panorama, above before, below after\n  \
         {compare_path}/refined.png       the whole panorama; baseline.png and truth.png lie beside it\n  \
         {refined_path}/poses.tum         the refined trajectory; refine.json says how sure it is",
        since.elapsed().as_secs_f64()
    ));
    Ok(())
}
