//! `tunnelstitch report`: writes an HTML report of a refined survey.

use crate::cli::arguments::{PoseReadingArguments, output_folder, positive};
use crate::cli::commands::overlay::leave_out_overlay;
use crate::cli::output::{
    DryRunArguments, Failure, Job, RUN_FILE, RunRecord, Terminal, json, record,
};
use crate::evaluate::compare_survey;
use crate::files::printed;
use crate::persist::atomic::{self, OutputSet, StagedFolder};
use crate::progress::Progress;
use crate::render::Interpolation;
use crate::report::{self, PICTURES, RefinedFiles, Report, Sources};
use crate::survey::Survey;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes an HTML report of a refined survey: which poses were corrected, and with what
/// uncertainty.
///
/// Writes report.html (one file that needs no other files and no network), report.json (the same
/// numbers) and report_pictures/ (the pictures of the page) into DIR.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tunnelstitch report my-survey --refined refined --out report")]
pub struct ReportArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// Folder that refine has written, or the poses (TUM) in it. Other poses are accepted, but
    /// then the page lacks residuals, costs and flags. The flags for reading poses apply to those
    /// of the survey only.
    #[arg(long, value_name = "DIR|FILE")]
    refined: PathBuf,
    /// Folder for the report; created if missing.
    #[arg(long, short, value_name = "DIR", value_parser = output_folder())]
    out: PathBuf,
    /// Resolution at which initial, refined and true poses are compared, pixels per metre of wall
    /// [default: the frames' own resolution at the wall, less for long surveys].
    #[arg(long, value_name = "N", value_parser = positive)]
    px_per_metre: Option<f64>,
    #[command(flatten)]
    reading: PoseReadingArguments,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses, the files of refine, or the output.
pub fn run(
    arguments: &ReportArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let mut survey =
        arguments
            .reading
            .open_beside(&arguments.survey, &arguments.refined, terminal)?;
    let refined = RefinedFiles::read(&survey, &arguments.refined)?;
    leave_out_overlay(&mut survey, terminal)?;
    if arguments.dry_run.is_set() {
        return describe(&survey, &refined, &arguments.out).print(terminal);
    }
    let px_per_metre = match arguments.px_per_metre {
        Some(px_per_metre) => Some(px_per_metre),
        None => report::choose_resolution(&survey, &refined.poses)?,
    };
    let (comparison, drawings) = &compare_survey(
        &survey,
        &refined.poses,
        px_per_metre,
        Interpolation::default(),
        terminal,
    )?;
    let files = refined.files();
    let inputs = record::hash_survey(&survey, files.iter().map(PathBuf::as_path))?;
    let sources = Sources {
        survey: &survey,
        refined,
        comparison,
        drawings,
        command: record.arguments.clone(),
    };
    let (report, json, mut outputs) = stage_report(sources, &arguments.out, terminal)?;
    record.add_to(&mut outputs, &arguments.out.join(RUN_FILE), &inputs)?;
    outputs.commit()?;
    if terminal.is_json() {
        return json::print_text(&json);
    }
    for note in &report.notes {
        terminal.say(format!("  {note}"));
    }
    terminal.say(format!(
        "wrote {}",
        printed(&arguments.out.join("report.html"))
    ));
    Ok(())
}

/// The work of a report, for `--dry-run`.
fn describe(survey: &Survey, refined: &RefinedFiles, out: &Path) -> Job {
    let files = refined.files();
    let names = ["report.html", "report.json", PICTURES, RUN_FILE];
    Job {
        writes: names.map(|name| out.join(name)).to_vec(),
        ..Job::of(survey, files.iter().map(PathBuf::as_path))
    }
}

/// Writes report.html, report.json and report_pictures/ for `out`; returns the report, the text of
/// report.json and the files, which have not their names yet.
///
/// # Errors
/// A flagged frame that cannot be read, or an output that cannot be written.
pub fn stage_report(
    sources: Sources,
    out: &Path,
    terminal: &Terminal,
) -> Result<(Report, String, OutputSet), Failure> {
    terminal.start("report", 1);
    let (report, pictures) = report::gather(sources)?;
    let page = report::page(&report, &pictures)?;
    let json = json::text(&report)?;
    atomic::create_folder(out)?;
    let folder = StagedFolder::begin(&out.join(PICTURES))?;
    for (name, bytes) in &pictures {
        let path = folder.path().join(name);
        atomic::write(&path, |writer| writer.write_all(bytes))?;
    }
    let mut outputs = OutputSet::default();
    outputs.folder(folder)?;
    outputs.write_text(&out.join("report.json"), &json)?;
    outputs.write_text(&out.join("report.html"), &page)?;
    terminal.finish();
    Ok((report, json, outputs))
}
