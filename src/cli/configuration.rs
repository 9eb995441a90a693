//! Where options come from. One order for all: a flag on the command line, else a variable
//! `TUNNELSTITCH_<COMMAND>_<OPTION>`, else `[options.<command>]` of `survey.toml`, else the
//! default.

use super::{Cli, Failure};
use crate::survey::{Survey, toml_path};
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{ArgMatches, Command, CommandFactory, FromArgMatches};
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};

/// Commands whose options a survey may hold: those that take one.
pub const CONFIGURABLE: [&str; 11] = [
    "check", "plan", "gyro", "refine", "stitch", "locate", "compare", "convert", "report",
    "export", "view",
];

/// The arguments as parsed, and every option in effect with where it comes from.
pub struct Configuration {
    /// The arguments.
    pub cli: Cli,
    /// The command.
    pub command: String,
    /// Its options.
    pub options: Vec<EffectiveOption>,
}

/// An option of a command.
#[derive(Clone, Debug, PartialEq)]
pub struct EffectiveOption {
    /// Its long flag, with underscores.
    pub name: String,
    /// Its values; none if it is not set.
    pub values: Vec<String>,
    /// True for a flag without a value.
    pub switch: bool,
    /// Where it comes from.
    pub source: Source,
}

/// Where an option comes from.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Source {
    /// The command line.
    Flag,
    /// This variable.
    Variable(String),
    /// `survey.toml`.
    Survey,
    /// The default.
    Default,
}

/// The command line with its variables.
pub fn command() -> Command {
    let command = Cli::command();
    let global = |arg: clap::Arg| match arg.get_long() {
        Some(long) => {
            let name = variable(None, long);
            arg.env(name)
        }
        None => arg,
    };
    command.mut_args(global).mut_subcommands(|sub| {
        let name = sub.get_name().to_owned();
        let own = sub.mut_args(|arg| match arg.get_long() {
            Some("help" | "version") | None => arg,
            Some(long) => {
                let variable = variable(Some(&name), long);
                arg.env(variable).hide_env(true)
            }
        });
        let order = format!(
            "Options may also be set as TUNNELSTITCH_{}_<OPTION>{}; `tunnelstitch config` shows what is in effect.",
            upper(&name),
            if CONFIGURABLE.contains(&name.as_str()) { format!(" and under [options.{name}] in survey.toml") } else { String::new() }
        );
        let help = own.get_after_help().map(|help| format!("{help}\n\n"));
        own.after_help(help.unwrap_or_default() + &order)
    })
}

fn upper(name: &str) -> String {
    name.to_uppercase().replace('-', "_")
}

fn variable(command: Option<&str>, long: &str) -> String {
    let command = command.map_or(String::new(), |name| upper(name) + "_");
    format!("TUNNELSTITCH_{command}{}", upper(long))
}

/// Parses `arguments` (the program's name first).
///
/// # Errors
/// Wrong options in `survey.toml`. Wrong arguments, and what only asks for help, end the program as
/// clap does.
pub fn parse(arguments: Vec<OsString>) -> Result<Configuration, Failure> {
    let command = command();
    let given = command.clone().try_get_matches_from(&arguments);
    let held = match &given {
        Ok(matches) => of_survey(&command, matches)?,
        // What is missing may be in the survey.
        Err(error) if error.kind() == ErrorKind::MissingRequiredArgument => {
            of_survey(&command, &without_required(&command, &arguments)?)?
        }
        Err(_) => None,
    };
    let (matches, from_survey) = match held {
        None => (given.unwrap_or_else(|error| error.exit()), Vec::new()),
        Some(held) => {
            let mut all = arguments;
            // Before what a lone `--` marks as no options.
            let end = all.iter().position(|word| word == "--");
            let end = end.unwrap_or(all.len());
            all.splice(end..end, held.arguments);
            let matches = command.clone().try_get_matches_from(&all);
            let matches = matches.map_err(|error| {
                if error.kind() == ErrorKind::MissingRequiredArgument {
                    error.exit();
                }
                let text = error.to_string();
                let what = text.strip_prefix("error: ").unwrap_or(&text);
                Failure::input(format!(
                    "{}: [options.{}]: {what}",
                    held.path.display(),
                    held.command
                ))
            })?;
            (matches, held.names)
        }
    };
    let cli = Cli::from_arg_matches(&matches).unwrap_or_else(|error| error.exit());
    let (name, options) = match matches.subcommand() {
        Some((name, own)) => (name, effective(&command, name, own, &from_survey)),
        None => ("", Vec::new()),
    };
    Ok(Configuration {
        cli,
        command: name.to_owned(),
        options,
    })
}

/// Options that a survey holds for a command.
struct Held {
    path: PathBuf,
    command: String,
    names: Vec<String>,
    arguments: Vec<OsString>,
}

/// What `survey.toml` has for the command of `matches`, without what flags and variables say.
fn of_survey(command: &Command, matches: &ArgMatches) -> Result<Option<Held>, Failure> {
    let Some((name, own)) = matches.subcommand() else {
        return Ok(None);
    };
    let survey = match own.try_get_one::<PathBuf>("survey") {
        Ok(Some(survey)) => survey,
        Ok(None) | Err(_) => return Ok(None),
    };
    // What is wrong with the file is told when the survey is opened.
    let Ok(file) = Survey::read_file(survey) else {
        return Ok(None);
    };
    let path = toml_path(survey);
    let fail = |what: String| Failure::input(format!("{}: {what}", path.display()));
    if let Some(other) = file
        .options
        .keys()
        .find(|key| !CONFIGURABLE.contains(&key.as_str()))
    {
        return Err(fail(format!(
            "[options.{other}]: no such section; there are {}",
            CONFIGURABLE
                .map(|name| format!("[options.{name}]"))
                .join(", ")
        )));
    }
    let (Some(table), Some(sub)) = (file.options.get(name), command.find_subcommand(name)) else {
        return Ok(None);
    };
    let mut held = Held {
        path: path.clone(),
        command: name.to_owned(),
        names: Vec::new(),
        arguments: Vec::new(),
    };
    for (key, value) in table {
        let long = key.replace('_', "-");
        let arg = options(command, sub).find(|(_, other)| *other == long);
        let Some((arg, _)) = arg else {
            let names = options(command, sub).map(|(_, long)| long.replace('-', "_"));
            return Err(fail(format!(
                "[options.{name}]: unknown option `{key}`; there are {}",
                names.collect::<Vec<_>>().join(", ")
            )));
        };
        let given = own.value_source(arg.get_id().as_str());
        if matches!(
            given,
            Some(ValueSource::CommandLine | ValueSource::EnvVariable)
        ) {
            continue;
        }
        let word = word(value).map_err(|what| fail(format!("[options.{name}]: {key}: {what}")))?;
        let default = arg.get_default_values().join(OsStr::new(","));
        match word {
            Word::Switch(false) => continue,
            Word::Switch(true) => held.arguments.push(format!("--{long}").into()),
            // What is so in any case keeps no other option out.
            Word::Value(text) if default == *text => continue,
            Word::Value(text) => held.arguments.push(format!("--{long}={text}").into()),
        }
        held.names.push(key.replace('-', "_"));
    }
    Ok((!held.names.is_empty()).then_some(held))
}

/// The options of a command, those that all commands have included, with their long flags.
fn options<'a>(
    command: &'a Command,
    sub: &'a Command,
) -> impl Iterator<Item = (&'a clap::Arg, &'a str)> {
    let arguments = sub.get_arguments().chain(command.get_arguments());
    arguments.filter_map(|arg| {
        let long = arg.get_long()?;
        (!matches!(long, "help" | "version")).then_some((arg, long))
    })
}

/// What a value in `survey.toml` says on the command line.
enum Word {
    /// A flag without a value, given or not.
    Switch(bool),
    /// The value of one that has one.
    Value(String),
}

fn word(value: &toml::Value) -> Result<Word, String> {
    let text = |value: &toml::Value| match value {
        toml::Value::String(text) => Ok(text.clone()),
        toml::Value::Integer(number) => Ok(number.to_string()),
        toml::Value::Float(number) => Ok(number.to_string()),
        _ => Err("must be a text, a number, true or false, or a list of these".to_owned()),
    };
    Ok(match value {
        toml::Value::Boolean(set) => Word::Switch(*set),
        toml::Value::Array(list) => {
            let list: Vec<String> = list.iter().map(text).collect::<Result<_, _>>()?;
            Word::Value(list.join(","))
        }
        value => Word::Value(text(value)?),
    })
}

/// Every option of command `name` with its value and where that comes from.
fn effective(
    command: &Command,
    name: &str,
    matches: &ArgMatches,
    from_survey: &[String],
) -> Vec<EffectiveOption> {
    let Some(sub) = command.find_subcommand(name) else {
        return Vec::new();
    };
    options(command, sub)
        .map(|(arg, long)| {
            let id = arg.get_id().as_str();
            let option = long.replace('-', "_");
            let values = matches.try_get_raw(id).ok().flatten();
            let values: Vec<String> = values
                .into_iter()
                .flatten()
                .map(|value| value.to_string_lossy().into_owned())
                .collect();
            let source = match matches.value_source(id) {
                Some(ValueSource::CommandLine) if from_survey.contains(&option) => Source::Survey,
                Some(ValueSource::CommandLine) => Source::Flag,
                Some(ValueSource::EnvVariable) => {
                    let command = (!arg.is_global_set()).then_some(name);
                    Source::Variable(variable(command, long))
                }
                _ => Source::Default,
            };
            EffectiveOption {
                name: option,
                values,
                switch: !arg.get_action().takes_values(),
                source,
            }
        })
        .collect()
}

/// The options of command `name` for a survey, as if it were run with no flags.
///
/// # Errors
/// As [`parse`].
pub fn of_command(name: &str, survey: &Path) -> Result<Vec<EffectiveOption>, Failure> {
    let command = command();
    let mut arguments: Vec<OsString> = vec![
        "tunnelstitch".into(),
        name.into(),
        survey.as_os_str().into(),
    ];
    let plain = without_required(&command, &arguments)?;
    let held = of_survey(&command, &plain)?;
    let names = match held {
        None => Vec::new(),
        Some(held) => {
            arguments.extend(held.arguments);
            held.names
        }
    };
    let matches = without_required(&command, &arguments)?;
    Ok(match matches.subcommand() {
        Some((name, own)) => effective(&command, name, own, &names),
        None => Vec::new(),
    })
}

/// Parses arguments that lack what a run would need besides.
fn without_required(command: &Command, arguments: &[OsString]) -> Result<ArgMatches, Failure> {
    match command.clone().try_get_matches_from(arguments) {
        Ok(matches) => Ok(matches),
        Err(error) if error.kind() == ErrorKind::MissingRequiredArgument => command
            .clone()
            .ignore_errors(true)
            .try_get_matches_from(arguments)
            .map_err(|error| Failure::bug(error.to_string())),
        Err(error) => Err(Failure::input(error.to_string())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn survey(options: &str) -> tempfile::TempDir {
        let dir = tempfile::tempdir().unwrap();
        let text = "[tunnel]\nshape = \"circle\"\nradius_m = 3.0\n[camera]\nfile = \"c.json\"\n[frames]\nimages = \"*.png\"\n\
                    [poses]\ninitial = \"p.tum\"\n";
        std::fs::write(dir.path().join("survey.toml"), text.to_owned() + options).unwrap();
        dir
    }

    fn parsed(survey: &tempfile::TempDir, more: &[&str]) -> Result<Vec<EffectiveOption>, Failure> {
        let folder = survey.path().to_str().unwrap();
        let words = ["tunnelstitch", "stitch", folder, "--out", "p.png"];
        let words = words.iter().chain(more).map(OsString::from);
        Ok(parse(words.collect())?.options)
    }

    fn option<'a>(options: &'a [EffectiveOption], name: &str) -> &'a EffectiveOption {
        options.iter().find(|option| option.name == name).unwrap()
    }

    #[test]
    fn the_command_line_is_consistent() {
        command().debug_assert();
    }

    #[test]
    fn every_command_that_takes_a_survey_can_be_configured() {
        let command = command();
        let takes_one = |sub: &&Command| sub.get_arguments().any(|arg| arg.get_id() == "survey");
        let names = command.get_subcommands().filter(takes_one);
        let names: Vec<&str> = names.map(Command::get_name).collect();
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
        assert_eq!(of("mode").source, Source::Survey);
        assert_eq!(of("no_blend").values, ["true"]);
        assert_eq!(of("px_per_metre").values, ["70"]);
        assert_eq!(of("px_per_metre").source, Source::Flag);
        assert_eq!(of("interpolation").source, Source::Default);
        let shown = of_command("stitch", survey.path()).unwrap();
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
