//! The command line: arguments, printing and exit codes; the work is done by the library.

mod carrier;
mod check;
mod compare;
mod config;
mod configuration;
mod converge;
mod convert;
mod demo;
mod export;
mod failure;
mod frame_times;
mod gyro;
mod hardships;
mod init;
mod json;
mod locate;
mod outputs;
mod plan;
mod poses;
mod project;
mod record;
mod refine;
mod report;
mod resume;
mod shell;
mod simulate;
mod stitch;
mod suggestion;
mod terminal;
mod textured;
mod tunnel;
mod view;

pub use failure::Failure;
pub use terminal::Terminal;

use crate::persist::atomic;
use clap::{Parser, Subcommand};
use std::sync::Arc;

/// Repairs the trajectory of a revolving tunnel camera by photometric consistency and unrolls the
/// wall into one metric panorama.
#[derive(Debug, Parser)]
#[command(
    name = "tunnelstitch",
    version,
    max_term_width = 100,
    arg_required_else_help = true
)]
pub struct Cli {
    #[command(flatten)]
    global: Global,
    #[command(subcommand)]
    command: Command,
}

/// Flags that every command understands.
#[derive(Debug, clap::Args)]
pub struct Global {
    /// No progress bars and no summaries; only errors and what --json asks for.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Threads to work with [default: all cores]. The result does not depend on it.
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub threads: Option<u16>,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::DemoArguments),
    Simulate(simulate::SimulateArguments),
    Init(init::InitArguments),
    Check(check::CheckArguments),
    Plan(plan::PlanArguments),
    Gyro(gyro::GyroArguments),
    Refine(refine::RefineArguments),
    Stitch(stitch::StitchArguments),
    Locate(locate::LocateArguments),
    Compare(compare::CompareArguments),
    Convert(convert::ConvertArguments),
    Report(report::ReportArguments),
    Export(export::ExportArguments),
    View(view::ViewArguments),
    Converge(converge::ConvergeArguments),
    Project(project::ProjectArguments),
    Config(config::ConfigArguments),
    Completions(shell::CompletionsArguments),
    Man(shell::ManArguments),
}

/// Parses the arguments and runs the command.
///
/// # Errors
/// [`Failure`], with the text to show and the exit code to leave with.
pub fn run() -> Result<(), Failure> {
    let configuration = configuration::parse(std::env::args_os().collect())?;
    let cli = configuration.cli;
    let run = record::Run {
        command: configuration.command,
        arguments: command_line(),
        options: configuration.options,
    };
    if let Some(threads) = cli.global.threads {
        rayon::ThreadPoolBuilder::new()
            .num_threads(usize::from(threads))
            .build_global()
            .map_err(|error| Failure::bug(format!("cannot start {threads} threads: {error}")))?;
    }
    // Nothing half-written stays behind; 130 is what a shell expects after Ctrl-C.
    let goes_on = matches!(cli.command, Command::Refine(_) | Command::Stitch(_));
    ctrlc::set_handler(move || {
        atomic::remove_unfinished();
        if goes_on {
            eprintln!("interrupted; the same command goes on from here");
        }
        std::process::exit(130);
    })
    .map_err(|error| Failure::bug(format!("cannot watch for Ctrl-C: {error}")))?;
    let terminal = Arc::new(Terminal::new(cli.global.quiet));
    match cli.command {
        Command::Demo(arguments) => demo::run(&arguments, &run, &terminal),
        Command::Simulate(arguments) => simulate::run(&arguments, &run, &terminal),
        Command::Init(arguments) => init::run(&arguments, &terminal),
        Command::Check(arguments) => check::run(&arguments, &terminal),
        Command::Plan(arguments) => plan::run(&arguments, &run, &terminal),
        Command::Gyro(arguments) => gyro::run(&arguments, &run, &terminal),
        Command::Refine(arguments) => refine::run(&arguments, &run, &terminal),
        Command::Stitch(arguments) => stitch::run(&arguments, &run, &terminal),
        Command::Locate(arguments) => locate::run(&arguments, &terminal),
        Command::Compare(arguments) => compare::run(&arguments, &run, &terminal),
        Command::Convert(arguments) => convert::run(&arguments, &run, &terminal),
        Command::Report(arguments) => report::run(&arguments, &run, &terminal),
        Command::Export(arguments) => export::run(&arguments, &run, &terminal),
        Command::View(arguments) => view::run(&arguments, &terminal),
        Command::Converge(arguments) => converge::run(&arguments, &run, &terminal),
        Command::Project(arguments) => project::run(&arguments, &run, &terminal),
        Command::Config(arguments) => config::run(&arguments, &terminal),
        Command::Completions(arguments) => shell::completions(&arguments),
        Command::Man(arguments) => shell::man(&arguments, &terminal),
    }
}

/// The command line that the program was started with, the program by its name only.
fn command_line() -> Vec<String> {
    let arguments = std::env::args_os().skip(1);
    std::iter::once("tunnelstitch".to_owned())
        .chain(arguments.map(|argument| argument.to_string_lossy().into_owned()))
        .collect()
}
