//! `tunnelstitch view`: a walk through the tunnel in the browser.

use super::poses::PosesArgument;
use super::textured::{LayersArguments, Poses, TextureArguments};
use super::{Failure, Terminal};
use crate::inspect::{MANIFEST, Marks, Server, ServerContent, SourceFrames, Viewer};
use crate::persist::atomic::ScratchFolder;
use crate::render::place;
use crate::survey::{SURVEY_FILE, Survey};
use std::path::{Path, PathBuf};

/// Shows the tunnel in the browser: walk along the wall, measure, mark defects, look at the frames
/// behind a place.
///
/// The page is served on 127.0.0.1, for this machine only, until Ctrl-C. Marks are kept in
/// marks.geojson and marks.csv beside survey.toml (or in the folder of `export --web`); nothing
/// else is written.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch view my-survey --poses refined/poses.tum\n      \
    draws refined, initial and true poses, and says where to look\n  \
    tunnelstitch view refined\n      \
    the same\n  \
    tunnelstitch export my-survey --poses refined/poses.tum --web walk; tunnelstitch view walk\n      \
    draws once, shows often; without the frames")]
pub struct ViewArguments {
    /// Folder of the survey, or its survey.toml; or a folder that `refine` or `export --web` has
    /// written.
    survey: PathBuf,
    #[command(flatten)]
    poses: PosesArgument,
    /// Port to listen on; 0: any that is free.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 7770,
        help_heading = "Server"
    )]
    port: u16,
    #[command(flatten)]
    layers: LayersArguments,
    #[command(flatten)]
    textures: TextureArguments,
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
        return serve(served, arguments.port, terminal);
    }
    let (survey, poses) = match refined(&arguments.survey)? {
        Some(refined) if arguments.poses.file().is_none() => refined,
        _ => (arguments.survey.clone(), arguments.poses.clone()),
    };
    let opened = poses.open(&survey, terminal)?;
    let (survey, layers) = arguments.layers.of(&survey, &poses, opened)?;
    let marks = Marks::open(&survey.folder)?;
    let scratch = ScratchFolder::inside(&std::env::temp_dir())?;
    arguments.layers.draw(
        (&survey, &layers),
        &arguments.textures,
        scratch.path(),
        terminal,
    )?;
    let served = ServerContent {
        folder: scratch.path().to_owned(),
        viewer,
        source_frames: Some(source_frames(survey, layers)?),
        marks,
    };
    serve(served, arguments.port, terminal)
}

/// The survey and the poses of a folder that `refine` has written; nothing for other folders.
fn refined(folder: &Path) -> Result<Option<(PathBuf, PosesArgument)>, Failure> {
    let report = folder.join("refine.json");
    let Ok(text) = std::fs::read_to_string(&report) else {
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
        Some(survey) => Ok(Some((survey, PosesArgument::of_file(&poses)))),
        None => Err(Failure::usage(format!(
            "{}: the survey that it names is not there; use `tunnelstitch view SURVEY --poses {}`",
            report.display(),
            poses.display()
        ))),
    }
}

/// The frames of the survey, placed by every layer.
fn source_frames(survey: Survey, layers: Vec<Poses>) -> Result<SourceFrames, Failure> {
    let mut placements = Vec::new();
    for Poses {
        name,
        poses,
        shutter,
    } in layers
    {
        let placed = place(survey.surface.as_ref(), &survey.camera, &poses, &shutter)?;
        placements.push((name.text().to_owned(), placed));
    }
    Ok(SourceFrames {
        surface: survey.surface,
        camera: survey.camera,
        frames: survey.frames,
        placements,
    })
}

fn serve(served: ServerContent, port: u16, terminal: &Terminal) -> Result<(), Failure> {
    let folder: &Path = &served.folder.clone();
    let server = Server::listen(served, port)?;
    // Where nobody sees the summary, programs wait for this line.
    terminal.say(format!("{} (Ctrl-C ends it)", server.address()));
    server.run();
    Err(Failure::bug(format!(
        "{}: the server has ended",
        folder.display()
    )))
}
