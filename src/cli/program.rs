//! The command line as a whole: global flags, all commands, and the call of the chosen one.

use super::commands::{
    check, compare, config, converge, convert, demo, export, gyro, init, locate, network_map, plan,
    plan_job, project, refine, report, run_job, run_task, shell, simulate, stitch, view,
};
use super::configuration;
use super::help::{group_commands, shorten_short_help};
use super::output::{
    Failure, RunRecord, Terminal, end_capture, print_error, print_failures_as_json,
    refused_arguments,
};
use crate::jobs::end_processes;
use crate::persist::atomic;
use clap::{CommandFactory, FromArgMatches, Parser, Subcommand};
use std::sync::Arc;
use tunnelstitch_geometry::numerics::simd_dispatch::{SimdLimit, limit_simd};

/// Refines the trajectory of a rotating tunnel camera by photometric bundle adjustment and unrolls
/// the wall into one metric panorama.
#[derive(Debug, Parser)]
#[command(
    name = "tunnelstitch",
    version,
    max_term_width = 100,
    arg_required_else_help = true
)]
struct Cli {
    #[command(flatten)]
    global: GlobalArguments,
    #[command(subcommand)]
    command: Command,
}

/// Flags of all commands.
#[derive(Debug, clap::Args)]
struct GlobalArguments {
    /// Print no progress bars and no summaries, only errors, warnings and the output of --json.
    #[arg(long, short, global = true)]
    quiet: bool,
    /// Print the result as one JSON document on standard output instead of a summary, and an error
    /// as one line {"error": ..., "exit_code": ...} on standard error.
    #[arg(long, global = true)]
    json: bool,
    /// Number of threads [default: all cores]. The result does not depend on it.
    #[arg(
        long,
        global = true,
        value_name = "N",
        value_parser = clap::value_parser!(u16).range(1..=1024)
    )]
    threads: Option<u16>,
    /// Widest vector instructions to use. The result does not depend on it.
    #[arg(
        long,
        global = true,
        value_enum,
        default_value_t,
        hide_short_help = true
    )]
    simd: SimdArgument,
}

/// Names of vector instructions.
#[derive(Clone, Copy, Debug, Default, clap::ValueEnum)]
enum SimdArgument {
    /// The widest of the processor.
    #[default]
    Widest,
    /// AVX2, if the processor has it.
    Avx2,
    /// Those that every processor of its kind has.
    Baseline,
}

impl From<SimdArgument> for SimdLimit {
    fn from(argument: SimdArgument) -> Self {
        match argument {
            SimdArgument::Widest => Self::Widest,
            SimdArgument::Avx2 => Self::Avx2,
            SimdArgument::Baseline => Self::Baseline,
        }
    }
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
    PlanJob(plan_job::PlanJobArguments),
    RunJob(run_job::RunJobArguments),
    RunTask(run_task::RunTaskArguments),
    NetworkMap(network_map::NetworkMapArguments),
    Project(project::ProjectArguments),
    Config(config::ConfigArguments),
    Completions(shell::CompletionsArguments),
    Man(shell::ManArguments),
}

/// Parses the arguments and runs the command.
///
/// # Errors
/// [`Failure`] with the text to print and the exit code.
pub fn run() -> Result<(), Failure> {
    let arguments: Vec<_> = std::env::args_os().collect();
    print_failures_as_json(configuration::asks_for_json(&arguments));
    let command = shorten_short_help(group_commands(Cli::command()));
    let command = configuration::with_variables(command);
    let parsed = configuration::parse(&command, arguments)?;
    let cli = Cli::from_arg_matches(&parsed.matches).map_err(|error| refused_arguments(&error))?;
    print_failures_as_json(cli.global.json);
    let record = RunRecord {
        command: parsed.command,
        arguments: command_line(),
        options: configuration::options_table(&parsed.options),
    };
    // 0 is one thread for each core.
    let threads = cli.global.threads.map_or(0, usize::from);
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build_global()
        .map_err(|error| {
            Failure::temporary(format!(
                "cannot start the threads: {error}; give fewer --threads, or end other programs"
            ))
        })?;
    limit_simd(cli.global.simd.into());
    handle_interrupts(&cli.command)?;
    let terminal = Arc::new(Terminal::new(cli.global.quiet, cli.global.json));
    cli.command.run(&command, &record, &terminal)
}

/// Ends a capture that is followed on Ctrl-C; else removes unfinished files and ends the program
/// with 130, the code that shells expect.
fn handle_interrupts(command: &Command) -> Result<(), Failure> {
    let is_resumable = matches!(
        command,
        Command::Refine(_) | Command::Stitch(_) | Command::RunJob(_)
    );
    ctrlc::set_handler(move || {
        if end_capture() {
            return;
        }
        end_processes();
        atomic::remove_unfinished();
        if is_resumable {
            print_error("interrupted; the same command continues from here");
        }
        std::process::exit(130);
    })
    .map_err(|error| match error {
        // It takes a pipe and a thread.
        ctrlc::Error::System(source) => Failure::temporary(format!(
            "cannot watch for Ctrl-C: {source}; allow more memory, threads or open files"
        )),
        error => Failure::bug(format!("cannot watch for Ctrl-C: {error}")),
    })
}

impl Command {
    /// Runs the command; `definition` is the whole command line with its variables.
    fn run(
        &self,
        definition: &clap::Command,
        record: &RunRecord,
        terminal: &Arc<Terminal>,
    ) -> Result<(), Failure> {
        match self {
            Self::Demo(arguments) => demo::run(arguments, record, terminal),
            Self::Simulate(arguments) => simulate::run(arguments, record, terminal),
            Self::Init(arguments) => init::run(arguments, terminal),
            Self::Check(arguments) => check::run(arguments, terminal),
            Self::Plan(arguments) => plan::run(arguments, record, terminal),
            Self::Gyro(arguments) => gyro::run(arguments, record, terminal),
            Self::Refine(arguments) => refine::run(arguments, record, terminal),
            Self::Stitch(arguments) => stitch::run(arguments, record, terminal),
            Self::Locate(arguments) => locate::run(arguments, terminal),
            Self::Compare(arguments) => compare::run(arguments, record, terminal),
            Self::Convert(arguments) => convert::run(arguments, record, terminal),
            Self::Report(arguments) => report::run(arguments, record, terminal),
            Self::Export(arguments) => export::run(arguments, record, terminal),
            Self::View(arguments) => view::run(arguments, terminal),
            Self::Converge(arguments) => converge::run(arguments, record, terminal),
            Self::PlanJob(arguments) => plan_job::run(arguments, terminal),
            Self::RunJob(arguments) => run_job::run(arguments, terminal),
            Self::RunTask(arguments) => run_task::run(arguments, terminal),
            Self::NetworkMap(arguments) => network_map::run(arguments, terminal),
            Self::Project(arguments) => project::run(arguments, record, terminal),
            Self::Config(arguments) => config::run(arguments, definition, terminal),
            Self::Completions(arguments) => shell::print_completions(arguments, definition),
            Self::Man(arguments) => shell::write_manual(arguments, definition, terminal),
        }
    }
}

/// The command line of this process, with the program's name instead of its path.
fn command_line() -> Vec<String> {
    let arguments = std::env::args_os().skip(1);
    std::iter::once("tunnelstitch".to_owned())
        .chain(arguments.map(|argument| argument.to_string_lossy().into_owned()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::configuration::{
        CONFIGURABLE, EffectiveOption, options_of_command, parse, with_variables,
    };
    use super::*;
    use crate::cli::help::grouped_names;
    use std::ffi::OsString;

    fn definition() -> clap::Command {
        with_variables(shorten_short_help(group_commands(Cli::command())))
    }

    fn survey(options: &str) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        let text = "[tunnel]\nshape = \"circle\"\nradius_m = 3.0\n[camera]\nfile = \"c.json\"\n\
                    [frames]\nimages = \"*.png\"\n[poses]\ninitial = \"p.tum\"\n";
        std::fs::write(dir.path().join("survey.toml"), text.to_owned() + options).unwrap();
        dir
    }

    fn parsed(survey: &tempfile::TempDir, more: &[&str]) -> Result<Vec<EffectiveOption>, Failure> {
        let folder = survey.path().to_str().unwrap();
        let words = ["tunnelstitch", "stitch", folder, "--out", "p.png"];
        let words = words.iter().chain(more).map(OsString::from);
        Ok(parse(&definition(), words.collect())?.options)
    }

    fn option<'a>(options: &'a [EffectiveOption], name: &str) -> &'a EffectiveOption {
        options.iter().find(|option| option.name == name).unwrap()
    }

    #[test]
    fn the_command_line_is_consistent() {
        definition().debug_assert();
    }

    #[test]
    fn every_command_stands_under_a_heading() {
        let command = definition();
        let mut names: Vec<&str> = command
            .get_subcommands()
            .map(clap::Command::get_name)
            .collect();
        names.push("help");
        let mut grouped = grouped_names();
        names.sort_unstable();
        grouped.sort_unstable();
        assert_eq!(names, grouped);
    }

    #[test]
    fn every_command_that_takes_a_survey_can_be_configured() {
        let command = definition();
        let takes_one = |sub: &&clap::Command| {
            let mut arguments = sub.get_arguments();
            arguments.any(|arg| arg.get_id() == "survey")
        };
        let names = command.get_subcommands().filter(takes_one);
        let names: Vec<&str> = names.map(clap::Command::get_name).collect();
        let others: Vec<&str> = names.into_iter().filter(|name| *name != "config").collect();
        assert_eq!(others, CONFIGURABLE);
    }

    #[test]
    fn a_survey_holds_options_and_flags_come_before_them() {
        let survey =
            survey("[options.stitch]\nmode = \"average\"\nno_blend = true\npx_per_metre = 50\n");
        let options = parsed(&survey, &["--px-per-metre", "70"]).unwrap();
        let of = |name: &str| option(&options, name);
        assert_eq!(of("mode").values, ["average"]);
        assert_eq!(of("mode").source.text(), "survey.toml");
        assert_eq!(of("no_blend").values, ["true"]);
        assert_eq!(of("px_per_metre").values, ["70"]);
        assert_eq!(of("px_per_metre").source.text(), "flag");
        assert_eq!(of("interpolation").source.text(), "default");
        let shown = options_of_command(&definition(), "stitch", survey.path()).unwrap();
        assert_eq!(option(&shown, "px_per_metre").values, ["50"]);
        assert_eq!(option(&shown, "out").values, Vec::<String>::new());
    }

    #[test]
    fn wrong_options_of_a_survey_are_named() {
        for (options, expected) in [
            ("[options.stitch]\nmoed = 1\n", "unknown option `moed`"),
            (
                "[options.stich]\nmode = 1\n",
                "[options.stich]: no such section",
            ),
            (
                "[options.stitch]\nmode = \"best\"\n",
                "invalid value 'best'",
            ),
            ("[options.stitch]\nmode = {a = 1}\n", "must be a text"),
        ] {
            let message = parsed(&survey(options), &[]).unwrap_err().message;
            assert!(message.contains(expected), "{message}");
            assert!(
                message.contains("survey") || message.contains("options"),
                "{message}"
            );
        }
    }
}
