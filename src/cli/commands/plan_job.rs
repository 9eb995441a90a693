//! `tunnelstitch plan-job`: plans the work of a network of surveys as a graph of tasks.

use crate::cli::arguments::output_folder;
use crate::cli::output::{Failure, Terminal, duration_text};
use crate::files::printed;
use crate::jobs::{Division, JOB_FILE, Job, JobFolder, Network, PlanOptions, SectionStep, plan};
use crate::persist::atomic;
use crate::storage::{Mirror, StorageUrl};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Plans the work on a survey, or on a network of many, as a graph of tasks that any machine can
/// run.
///
/// Writes job.json into DIR: tasks with command, inputs, outputs, needs and order. Each is a call
/// of this program; `run-job` runs all of them on this machine, `run-task` one of them anywhere.
/// Planned again, what is done stays done, as far as nothing that it follows from has changed.
#[derive(Debug, clap::Args)]
#[command(after_help = "network.toml lists the sections of a network:\n  \
    [[section]]\n  id = \"K12-K13\"            # names the folder of its results\n  \
    survey = \"2026/K12-K13\"   # folder of the survey, or its survey.toml\n\n\
    With a `crs` and the places of manholes, `network-map --help`, the job has a map as well.\n\
    Options of a step are those of the section's survey.toml, as [options.stitch].\n\n\
    Example:\n  tunnelstitch plan-job network.toml --out job\n  tunnelstitch run-job job")]
pub struct PlanJobArguments {
    /// A network.toml, or a survey (its folder, or its survey.toml); with --out on storage, its
    /// address in the same bucket.
    #[arg(value_name = "NETWORK|SURVEY")]
    network: PathBuf,
    /// Folder of the job, or its address on storage (s3://bucket/folder); created if missing.
    #[arg(long, short, value_name = "DIR", value_parser = output_folder())]
    out: PathBuf,
    /// Steps of every section; a list. Without `refine`, the initial poses are used.
    #[arg(
        long,
        value_enum,
        value_delimiter = ',',
        default_values_t = [SectionStep::Refine, SectionStep::Stitch, SectionStep::Report]
    )]
    steps: Vec<SectionStep>,
    /// Processors of each task. The results do not depend on it.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 2,
        value_parser = clap::value_parser!(u16).range(1..=1024)
    )]
    cores: u16,
    /// Refine and stitch each section in N shards along the tunnel, tasks of their own that need
    /// less memory, and join them. Poses differ by a fraction of their 1-σ from those without
    /// shards, as those of a survey that begins elsewhere do; panoramas of the same poses do not.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    shards: Option<u32>,
    /// Refine and stitch each section in as many shards as it takes for no more than M frames of
    /// its own in each.
    #[arg(
        long,
        value_name = "M",
        conflicts_with = "shards",
        value_parser = clap::value_parser!(u32).range(1..)
    )]
    frames_per_shard: Option<u32>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the network, a survey, or the output.
pub fn run(arguments: &PlanJobArguments, terminal: &Terminal) -> Result<(), Failure> {
    let options = PlanOptions {
        steps: arguments.steps.iter().copied().collect(),
        cores: arguments.cores,
        division: match (arguments.shards, arguments.frames_per_shard) {
            (_, Some(frames)) => Division::FramesPerShard(frames as usize),
            (shards, None) => Division::Shards(shards.unwrap_or(1) as usize),
        },
    };
    if options.steps.contains(&SectionStep::Report) && !options.steps.contains(&SectionStep::Refine)
    {
        return Err(Failure::usage(
            "--steps report needs refine, whose results it reports",
        ));
    }
    let folder = JobFolder::new(&arguments.out)?;
    let network = read_network(&arguments.network, &folder)?;
    atomic::check_folder(folder.path())?;
    let job = plan(&network, folder.path(), &options)?;
    folder.write_job(&job)?;
    let report = PlanReport::of(&job, network.sections.len(), &arguments.out);
    terminal.say(format!(
        "planned {} tasks of {} sections: about {} of processor time, at most {} MiB for a task",
        report.tasks,
        report.sections,
        duration_text(report.processor_seconds),
        report.memory_bytes.div_ceil(1 << 20)
    ));
    terminal.say(format!(
        "wrote {}; tunnelstitch run-job {} runs it",
        printed(&arguments.out.join(JOB_FILE)),
        printed(&arguments.out)
    ));
    terminal.result(&report)
}

/// Reads the network of a job; one on storage is fetched with its surveys.
fn read_network(path: &Path, folder: &JobFolder) -> Result<Network, Failure> {
    let [network_url, job_url] = [StorageUrl::of(path)?, StorageUrl::of(folder.given())?];
    let bucket = |url: &Option<StorageUrl>| url.as_ref().map(StorageUrl::root);
    if bucket(&network_url) != bucket(&job_url) {
        return Err(Failure::usage(
            "the network and --out must both be on this machine, or both in one bucket: a job \
             names its surveys by relative paths",
        ));
    }
    let Some(url) = network_url else {
        return Ok(Network::read(path)?);
    };
    let mirror = Mirror::of_user();
    let network = Network::read(&mirror.fetch(&url)?)?;
    let folder = url.join(Path::new(".."))?;
    for section in &network.sections {
        let survey = section.survey.strip_prefix(mirror.path(&folder));
        let survey = survey.unwrap_or(&section.survey);
        let survey = match survey.extension().filter(|ending| *ending == "toml") {
            Some(_) => survey.parent().unwrap_or(Path::new("")),
            None => survey,
        };
        mirror.fetch(&folder.join(survey)?)?;
    }
    Ok(network)
}

/// The result, for `--json`.
#[derive(Serialize)]
struct PlanReport<'a> {
    out: &'a Path,
    sections: usize,
    tasks: usize,
    processor_seconds: f64,
    memory_bytes: u64,
}

impl<'a> PlanReport<'a> {
    fn of(job: &Job, sections: usize, out: &'a Path) -> Self {
        let needs = || job.tasks.iter().map(|task| task.needs);
        Self {
            out,
            sections,
            tasks: job.tasks.len(),
            processor_seconds: needs()
                .map(|needs| f64::from(needs.cores) * needs.seconds)
                .sum(),
            memory_bytes: needs().map(|needs| needs.memory_bytes).max().unwrap_or(0),
        }
    }
}
