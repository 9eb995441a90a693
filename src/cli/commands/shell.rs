//! `tunnelstitch completions` and `tunnelstitch man`: shell completions and manual pages.

use crate::cli::arguments::output_folder;
use crate::cli::output::{Failure, Terminal, json};
use crate::files::printed;
use crate::persist::atomic::{self, WriteError};
use clap_complete::Shell;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Prints the completions of all commands and options for a shell.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch completions bash > ~/.local/share/bash-completion/completions/tunnelstitch\n  \
    tunnelstitch completions fish > ~/.config/fish/completions/tunnelstitch.fish")]
pub struct CompletionsArguments {
    /// The shell.
    shell: Shell,
}

/// Writes the manual pages, one for the program and one for every command.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tunnelstitch man --out ~/.local/share/man/man1")]
pub struct ManArguments {
    /// Folder for the pages; created if missing.
    #[arg(long, short, value_name = "DIR", value_parser = output_folder())]
    out: PathBuf,
}

/// Runs `completions`; `definition` is the whole command line with its variables.
///
/// # Errors
/// Standard output that cannot be written.
pub fn print_completions(
    arguments: &CompletionsArguments,
    definition: &clap::Command,
) -> Result<(), Failure> {
    let mut command = definition.clone();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "tunnelstitch", &mut script);
    json::print_text(&String::from_utf8_lossy(&script))
}

/// Runs `man`; `definition` is the whole command line with its variables.
///
/// # Errors
/// A page that cannot be written.
pub fn write_manual(
    arguments: &ManArguments,
    definition: &clap::Command,
    terminal: &Terminal,
) -> Result<(), Failure> {
    atomic::create_folder(&arguments.out)?;
    let mut command = definition.clone();
    // Building adds the program's name and the global flags to every command.
    command.build();
    let mut pages = vec![command.clone()];
    let commands = command
        .get_subcommands()
        .filter(|sub| sub.get_name() != "help");
    pages.extend(commands.cloned());
    for page in pages {
        let name = match page.get_display_name() {
            Some(name) => name.to_owned(),
            None => page.get_name().to_owned(),
        };
        let path = arguments.out.join(format!("{name}.1"));
        let mut text = Vec::new();
        clap_mangen::Man::new(page)
            .render(&mut text)
            .map_err(|source| WriteError::new(&path, source))?;
        atomic::write_text(&path, &String::from_utf8_lossy(&text))?;
    }
    terminal.say(format!("wrote {}", printed(&arguments.out)));
    terminal.result(&ManReport {
        out: &arguments.out,
    })
}

/// The result, for `--json`.
#[derive(Serialize)]
struct ManReport<'a> {
    out: &'a Path,
}
