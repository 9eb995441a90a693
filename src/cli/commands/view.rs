//! `tunnelstitch view`: shows the tunnel in the browser.

use crate::cli::arguments::{LayerArguments, PosesArguments, TextureArguments};
use crate::cli::output::{DryRunArguments, Failure, Job, Terminal, json};
use crate::files::limits::MAX_REPORT_BYTES;
use crate::files::{printed, read_text};
use crate::inspect::{
    MANIFEST, MARKS_CSV, MARKS_GEOJSON, Marks, PosedLayer, Server, ServerContent, Viewer,
    draw_layers, plan_layers, pose_source_frames,
};
use crate::persist::atomic::ScratchFolder;
use crate::render::PanoramaJob;
use crate::report::REFINEMENT_FILE;
use crate::survey::{SURVEY_FILE, Survey};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Shows the tunnel in the browser: move along the wall, measure, mark defects, look at the frames
/// that show a point.
///
/// The page is served on 127.0.0.1, for this machine only, until Ctrl-C. Marks are kept in
/// marks.geojson and marks.csv beside survey.toml (or in the folder of `export --web`); nothing
/// else is written. If refine has found that the wall is deformed, a layer shows the deviation from
/// best-fit circles with the value under the pointer.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch view my-survey --poses refined/poses.tum\n      \
    draws refined, initial and true poses, and prints the address\n  \
    tunnelstitch view refined\n      \
    the same, from a folder of refine\n  \
    tunnelstitch export my-survey --poses refined/poses.tum --web walk; \
    tunnelstitch view walk\n      \
    draws once, shows often; without the frames")]
pub struct ViewArguments {
    /// Folder of the survey, or its survey.toml; or a folder that `refine` or `export --web` has
    /// written.
    survey: PathBuf,
    #[command(flatten)]
    poses: PosesArguments,
    /// Port to listen on; 0 chooses a free one.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 7770,
        help_heading = "Server"
    )]
    port: u16,
    /// Also open the page in the system's browser. While the browser starts, other users of this
    /// machine may see the address, with its token, among the running programs.
    #[arg(long, help_heading = "Server")]
    open: bool,
    #[command(flatten)]
    layers: LayerArguments,
    #[command(flatten)]
    textures: TextureArguments,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses, the marks or the port.
pub fn run(arguments: &ViewArguments, terminal: &Terminal) -> Result<(), Failure> {
    let viewer = Viewer::bundled()?;
    if arguments.survey.join(MANIFEST).is_file() {
        let served = ServerContent {
            folder: arguments.survey.clone(),
            viewer,
            source_frames: None,
            marks: Marks::open(&arguments.survey)?,
        };
        if arguments.dry_run.is_set() {
            let job = Job {
                reads: vec![arguments.survey.join(MANIFEST)],
                may_write: mark_files(&arguments.survey),
                ..Job::default()
            };
            return describe(served, job, arguments, terminal);
        }
        return serve(served, arguments, terminal);
    }
    let (survey, poses) = match refined_folder(&arguments.survey)? {
        Some(refined) if arguments.poses.file().is_none() => refined,
        _ => (arguments.survey.clone(), arguments.poses.clone()),
    };
    let opened = poses.open(&survey, terminal)?;
    let (survey, layers) = arguments.layers.select(&survey, &poses, opened)?;
    let layers: Vec<_> = layers.into_iter().map(|(_, layer)| layer).collect();
    let marks = Marks::open(&survey.folder)?;
    if arguments.dry_run.is_set() {
        let job = job(&survey, &layers, arguments, poses.file())?;
        let served = ServerContent {
            folder: survey.folder,
            viewer,
            source_frames: None,
            marks,
        };
        return describe(served, job, arguments, terminal);
    }
    let scratch = ScratchFolder::inside(&std::env::temp_dir())?;
    draw_layers(
        &survey,
        &layers,
        &arguments.textures.options(),
        arguments.layers.twelve_at_deg,
        scratch.path(),
        &PanoramaJob::new(terminal, layers.len()),
    )?;
    let served = ServerContent {
        folder: scratch.path().to_owned(),
        viewer,
        source_frames: Some(pose_source_frames(survey, layers)?),
        marks,
    };
    serve(served, arguments, terminal)
}

/// The work before the page is served.
///
/// # Errors
/// Poses that cannot be placed on the wall, too little memory.
fn job(
    survey: &Survey,
    layers: &[PosedLayer],
    arguments: &ViewArguments,
    poses: Option<&Path>,
) -> Result<Job, Failure> {
    let options = arguments.textures.options();
    Ok(Job {
        may_write: mark_files(&survey.folder),
        amount: Some(format!("{} layers to draw", layers.len())),
        memory_bytes: Some(plan_layers(survey, layers, &options)?),
        ..Job::of(survey, poses)
    })
}

/// The files of marks in a folder.
fn mark_files(folder: &Path) -> Vec<PathBuf> {
    [MARKS_GEOJSON, MARKS_CSV]
        .map(|name| folder.join(name))
        .to_vec()
}

/// Prints the work, for `--dry-run`, once the port is known to be free.
///
/// # Errors
/// A port that is in use.
fn describe(
    served: ServerContent,
    job: Job,
    arguments: &ViewArguments,
    terminal: &Terminal,
) -> Result<(), Failure> {
    Server::listen(served, arguments.port)?;
    job.print(terminal)
}

/// Finds the survey and the poses of a folder that `refine` has written; `None` for other folders.
///
/// # Errors
/// A survey that no longer exists.
fn refined_folder(folder: &Path) -> Result<Option<(PathBuf, PosesArguments)>, Failure> {
    let report = folder.join(REFINEMENT_FILE);
    let Ok(text) = read_text(&report, MAX_REPORT_BYTES) else {
        return Ok(None);
    };
    let value: Option<serde_json::Value> = serde_json::from_str(&text).ok();
    let named = value
        .as_ref()
        .and_then(|value| value["survey"].as_str())
        .map(PathBuf::from);
    let own = Some(folder.to_owned()).filter(|folder| folder.join(SURVEY_FILE).is_file());
    let poses = folder.join("poses.tum");
    match own.or(named.filter(|survey| survey.exists())) {
        Some(survey) => Ok(Some((survey, PosesArguments::from_file(&poses)))),
        None => Err(Failure::usage(format!(
            "{}: its survey does not exist; use `tunnelstitch view SURVEY --poses {}`",
            printed(&report),
            printed(&poses)
        ))),
    }
}

/// The address of the page, for `--json`.
#[derive(Serialize)]
struct ViewReport<'a> {
    address: &'a str,
}

fn serve(
    served: ServerContent,
    arguments: &ViewArguments,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let folder: &Path = &served.folder.clone();
    let server = Server::listen(served, arguments.port)?;
    let address: &str = &server.address();
    // Nobody and no program can find the server without this line.
    if terminal.is_json() {
        json::print(&ViewReport { address })?;
    } else {
        json::print_text(&format!("{address} (Ctrl-C ends it)\n"))?;
    }
    if arguments.open
        && let Err(error) = open::that_detached(address)
    {
        terminal.warn(format!(
            "no browser was opened ({error}); open the printed address"
        ));
    }
    server.run();
    Err(Failure::bug(format!(
        "{}: the server has ended",
        printed(folder)
    )))
}
