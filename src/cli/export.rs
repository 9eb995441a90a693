//! `tunnelstitch export`: the wall for programs that show it in three dimensions.

use super::poses::PosesArgument;
use super::record::{self, RUN_FILE, Run};
use super::stitch::parent_folder;
use super::textured::{LayerName, LayersArguments, TextureArguments};
use super::{Failure, Terminal, json};
use crate::inspect::{GlbTarget, MANIFEST, MARKS_CSV, MARKS_GEOJSON, TILESET, TilesFolder, Viewer};
use crate::persist::atomic::{StagedFolder, WriteError};
use crate::render::{Canvas, Target};
use crate::survey::Survey;
use crate::trajectory::{Pose, Trajectory, poses_of};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Writes the wall in three dimensions, textured with the panorama: metric, in the tunnel's
/// coordinates.
///
/// glTF has y up, the tunnel z: (x, y, z) is written as (x, z, −y). Blender and viewers of 3D Tiles
/// turn it back by themselves.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("output").required(true).multiple(true),
    after_help = "Examples:\n  \
    tunnelstitch export my-survey --poses refined/poses.tum --glb wall.glb\n      \
    one file, for Blender, Unity, Unreal or a viewer of glTF\n  \
    tunnelstitch export my-survey --poses refined/poses.tum --3dtiles wall-tiles\n      \
    kilometres, for Cesium and other programs that stream 3D Tiles\n  \
    tunnelstitch export my-survey --poses refined/poses.tum --web walk\n      \
    a page to walk through, for any web server: python3 -m http.server --directory walk"
)]
pub struct ExportArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    #[command(flatten)]
    poses: PosesArgument,
    /// One file of glTF (GLB), for short pieces of tunnel.
    #[arg(long, value_name = "FILE", group = "output", help_heading = "Output")]
    glb: Option<PathBuf>,
    /// A folder of OGC 3D Tiles 1.1, for tunnels of any length: tileset.json and tiles in levels of
    /// detail.
    #[arg(
        long = "3dtiles",
        value_name = "DIR",
        group = "output",
        help_heading = "Output"
    )]
    tiles: Option<PathBuf>,
    /// A folder with the viewer and everything it shows, for any web server. Marks stay in the
    /// browser; `view` keeps them in files.
    #[arg(long, value_name = "DIR", group = "output", help_heading = "Output")]
    web: Option<PathBuf>,
    /// Print what was written as JSON.
    #[arg(long, help_heading = "Output")]
    json: bool,
    #[command(flatten)]
    layers: LayersArguments,
    #[command(flatten)]
    textures: TextureArguments,
}

/// What was written.
#[derive(Serialize)]
struct Report<'a> {
    glb: Option<&'a Path>,
    tiles: Option<&'a Path>,
    web: Option<&'a Path>,
    /// What glb and tiles show.
    canvas: Option<Canvas>,
    chainage_m: Option<[f64; 2]>,
    /// What web shows.
    layers: Vec<LayerName>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses or the output.
pub fn run(arguments: &ExportArguments, run: &Run, terminal: &Terminal) -> Result<(), Failure> {
    check(arguments)?;
    let (survey, given) = arguments.poses.open(&arguments.survey, terminal)?;
    let inputs = record::inputs(&survey, arguments.poses.file())?;
    let canvas = if arguments.glb.is_some() || arguments.tiles.is_some() {
        Some(files(arguments, &survey, &poses_of(&given), terminal)?)
    } else {
        None
    };
    let layers = match &arguments.web {
        Some(folder) => web(arguments, folder, (survey, given), terminal)?,
        None => Vec::new(),
    };
    if let Some(glb) = &arguments.glb {
        run.write(&record::beside(glb), &inputs)?;
    }
    for folder in arguments.tiles.iter().chain(&arguments.web) {
        run.write(&folder.join(RUN_FILE), &inputs)?;
    }
    if arguments.json {
        return json::print(&Report {
            glb: arguments.glb.as_deref(),
            tiles: arguments.tiles.as_deref(),
            web: arguments.web.as_deref(),
            canvas,
            chainage_m: canvas.map(|canvas| canvas.chainage_m()),
            layers,
        });
    }
    if let Some(canvas) = canvas {
        let [from_m, to_m] = canvas.chainage_m();
        for path in arguments.glb.iter().chain(&arguments.tiles) {
            terminal.say(format!(
                "{}: {} × {} px of wall, {:.2} px per metre, chainage {from_m:.3} to {to_m:.3} m",
                path.display(),
                canvas.columns,
                canvas.rows,
                canvas.px_per_metre
            ));
        }
    }
    if let Some(folder) = &arguments.web {
        let names: Vec<&str> = layers.iter().map(|name| name.text()).collect();
        terminal.say(format!(
            "{}: {}, for any web server, or `tunnelstitch view {0}`",
            folder.display(),
            names.join(", "),
        ));
    }
    Ok(())
}

/// Checks the names, and that there is a page, before any work is done.
fn check(arguments: &ExportArguments) -> Result<(), Failure> {
    if let Some(glb) = &arguments.glb {
        if glb.extension().is_none_or(|extension| extension != "glb") {
            return Err(Failure::usage(format!(
                "--glb {}: the name must end in .glb",
                glb.display()
            )));
        }
        parent_folder(glb)?;
    }
    for (folder, file) in [(&arguments.tiles, TILESET), (&arguments.web, MANIFEST)] {
        if let Some(folder) = folder {
            check_replaceable(folder, file)?;
        }
    }
    if arguments.web.is_some() {
        Viewer::bundled()?;
    }
    Ok(())
}

/// Refuses a folder that holds something else than an earlier export, known by one of its files:
/// all that is in it would be lost.
fn check_replaceable(folder: &Path, file: &str) -> Result<(), Failure> {
    let empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    if empty || folder.join(file).is_file() {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "{}: holds other things than an earlier export; name another folder",
        folder.display()
    )))
}

/// Writes `--glb` and `--3dtiles` from one panorama.
fn files(
    arguments: &ExportArguments,
    survey: &Survey,
    poses: &[Pose],
    terminal: &Terminal,
) -> Result<Canvas, Failure> {
    let surface = survey.surface.as_ref();
    let textures = &arguments.textures;
    let mut stitch = textures.stitch(survey, poses, &survey.shutter())?;
    let (canvas, format, quality) = (*stitch.canvas(), stitch.frames().format(), textures.quality);
    let mut single = match &arguments.glb {
        Some(path) => Some(GlbTarget::new(surface, &canvas, format, path, quality)?),
        None => None,
    };
    let mut tiles = match &arguments.tiles {
        Some(path) => Some(TilesFolder::begin(surface, &canvas, format, path, quality)?),
        None => None,
    };
    let bytes = single.as_ref().map_or(0, GlbTarget::max_bytes)
        + tiles.as_mut().map_or(0, |tiles| tiles.target().max_bytes());
    let budget = stitch.budget(bytes)?;
    let mut targets: Vec<&mut dyn Target> = Vec::new();
    targets.extend(single.as_mut().map(|single| single as &mut dyn Target));
    targets.extend(
        tiles
            .as_mut()
            .map(|tiles| tiles.target() as &mut dyn Target),
    );
    let settled = stitch.settle(&budget, terminal)?;
    let (plan, frames) = stitch.plan(settled);
    plan.draw(frames, budget.room, &mut targets, terminal)?;
    if let Some(single) = single {
        single.finish()?;
    }
    if let Some(tiles) = tiles {
        tiles.finish(&canvas)?;
    }
    Ok(canvas)
}

/// Writes `--web`; its layers.
fn web(
    arguments: &ExportArguments,
    folder: &Path,
    opened: (Survey, Trajectory),
    terminal: &Terminal,
) -> Result<Vec<LayerName>, Failure> {
    let layers = &arguments.layers;
    let (survey, all) = layers.of(&arguments.survey, &arguments.poses, opened)?;
    let staged = StagedFolder::begin(folder)?;
    layers.draw(
        (&survey, &all),
        &arguments.textures,
        staged.path(),
        terminal,
    )?;
    Viewer::bundled()?.write(staged.path())?;
    // Marks of an inspection outlive the pictures.
    for name in [MARKS_GEOJSON, MARKS_CSV] {
        let old = folder.join(name);
        if old.is_file() {
            let new = staged.path().join(name);
            std::fs::copy(&old, &new).map_err(|source| WriteError::new(&old, source))?;
        }
    }
    staged.finish()?;
    Ok(all.iter().map(|layer| layer.name).collect())
}
