//! `tunnelstitch completions` and `tunnelstitch man`: what shells and `man` know of the program.

use super::{Failure, Terminal, configuration, json};
use crate::persist::atomic::{self, WriteError};
use clap_complete::Shell;
use std::path::PathBuf;

/// Prints a shell's completions of all commands and options.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  tunnelstitch completions bash > ~/.local/share/bash-completion/completions/tunnelstitch\n  \
                  tunnelstitch completions fish > ~/.config/fish/completions/tunnelstitch.fish"
)]
pub struct CompletionsArguments {
    /// The shell.
    shell: Shell,
}

/// Writes the manual pages, one for the program and one for every command.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  tunnelstitch man --out ~/.local/share/man/man1")]
pub struct ManArguments {
    /// Folder for the pages; made if need be.
    #[arg(long, short, value_name = "DIR")]
    out: PathBuf,
}

/// Runs `completions`.
///
/// # Errors
/// Standard output that cannot be written.
pub fn completions(arguments: &CompletionsArguments) -> Result<(), Failure> {
    let mut command = configuration::command();
    let mut script = Vec::new();
    clap_complete::generate(arguments.shell, &mut command, "tunnelstitch", &mut script);
    json::print_text(&String::from_utf8_lossy(&script))
}

/// Runs `man`.
///
/// # Errors
/// A page that cannot be written.
pub fn man(arguments: &ManArguments, terminal: &Terminal) -> Result<(), Failure> {
    atomic::create_folder(&arguments.out)?;
    let mut command = configuration::command();
    // Puts the program's name before those of its commands, and the global flags among their own.
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
    terminal.say(format!("wrote {}", arguments.out.display()));
    Ok(())
}
