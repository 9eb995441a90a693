//! `tunnelstitch network-map`: writes the map of a network.

use crate::cli::output::{Failure, Terminal};
use crate::files::printed;
use crate::jobs::{Job, Network};
use crate::network_map::{SectionState, draw_map};
use crate::persist::atomic;
use serde::Serialize;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Writes the map of a network: a GeoPackage of its sections, manholes and defects for a GIS.
///
/// Every section is a line with its state (refined, not usable, failed, not run), share of
/// photometric frames, uncertainty, worst deformation, defects, and links to report, panorama and
/// poses. Marks of `view` are points on it. It shows the job as it is, whatever is done of it.
///
/// `run-job` does this after all sections have ended, if network.toml has a `crs`.
#[derive(Debug, clap::Args)]
#[command(after_help = "network.toml says where the sections are:\n  \
    crs = \"EPSG:2056\"         # of all positions: projected, in metres\n\n  \
    [[manhole]]\n  id = \"K12\"\n  position_m = [2600000.0, 1200000.0]   # east, north\n\n  \
    [[section]]\n  id = \"K12-K13\"\n  survey = \"2026/K12-K13\"\n  \
    from = \"K12\"              # from here chainage increases\n  to = \"K13\"\n\n\
    Example:\n  tunnelstitch network-map network.toml job --out network.gpkg")]
pub struct NetworkMapArguments {
    /// The network.toml.
    network: PathBuf,
    /// Folder that plan-job has written for it.
    job: PathBuf,
    /// The GeoPackage.
    #[arg(long, short, value_name = "FILE.gpkg")]
    out: PathBuf,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the network, its job, its results or the output.
pub fn run(arguments: &NetworkMapArguments, terminal: &Terminal) -> Result<(), Failure> {
    let NetworkMapArguments { network, job, out } = arguments;
    let network = Network::read(network)?;
    let (map, states) = draw_map(&network, &Job::read(job)?, job, atomic::parent_folder(out))?;
    let bytes = map.encode().map_err(crate::network_map::MapError::from)?;
    atomic::write(out, |writer| writer.write_all(&bytes))?;
    let mut sections: BTreeMap<&str, usize> = BTreeMap::new();
    for state in &states {
        *sections.entry(SectionState::name(state)).or_default() += 1;
    }
    let counts: Vec<String> = sections
        .iter()
        .map(|(state, count)| format!("{count} {state}"))
        .collect();
    let crs = map.crs;
    terminal.say(format!(
        "wrote {}: {} sections ({}) in {}",
        printed(out),
        states.len(),
        counts.join(", "),
        crs.name()
    ));
    terminal.result(&MapReport {
        out,
        crs: format!("EPSG:{}", crs.code()),
        sections,
    })
}

/// The result, for `--json`.
#[derive(Serialize)]
struct MapReport<'a> {
    out: &'a Path,
    crs: String,
    /// Number of sections by their state.
    sections: BTreeMap<&'a str, usize>,
}
