//! `tunnelstitch export`: writes the textured wall for 3D programs and for web servers.

use crate::cli::arguments::{LayerArguments, LayerName, PosesArguments, TextureArguments, resume};
use crate::cli::commands::export_shards::{join_shards, write_seams, write_shard};
use crate::cli::output::{
    DryRunArguments, Failure, Job, RUN_FILE, RunRecord, Terminal, check_parent_folder, json, record,
};
use crate::files::printed;
use crate::inspect::{
    ExportFiles, MANIFEST, PosedLayer, TILESET, TextureShards, Viewer, plan_layers, plan_wall,
    stage_page, stage_wall,
};
use crate::persist::atomic::{self, OutputSet};
use crate::persist::shard_number::ShardNumber;
use crate::render::{Canvas, PanoramaJob};
use crate::survey::Survey;
use crate::trajectory::{Trajectory, poses_of};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Writes the wall as a textured 3D mesh in metres, in the tunnel's coordinates.
///
/// In glTF y points up, in the tunnel z: (x, y, z) is written as (x, z, −y). Blender and viewers of
/// 3D Tiles undo this rotation.
#[derive(Debug, clap::Args)]
#[command(
    group = clap::ArgGroup::new("output").required(true).multiple(true),
    after_help = "Examples:\n  \
    tunnelstitch export my-survey --poses refined/poses.tum --glb wall.glb\n      \
    one file, for Blender, Unity, Unreal or a viewer of glTF\n  \
    tunnelstitch export my-survey --poses refined/poses.tum --3dtiles wall-tiles\n      \
    kilometres, for Cesium and other programs that stream 3D Tiles\n  \
    tunnelstitch export my-survey --poses refined/poses.tum --web walk\n      \
    a page for any web server: python3 -m http.server --directory walk\n\n\
    3D Tiles of a long survey in two shards, on two machines, and joined:\n  \
    tunnelstitch export my-survey --seams --3dtiles parts\n  \
    tunnelstitch export my-survey --shard 1/2 --3dtiles parts\n  \
    tunnelstitch export my-survey --shard 2/2 --3dtiles parts\n  \
    tunnelstitch export my-survey --join parts --3dtiles wall-tiles"
)]
pub struct ExportArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    #[command(flatten)]
    poses: PosesArguments,
    /// One glTF file (GLB), for short pieces of tunnel.
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
    /// Find only exposures and seams of the 3D Tiles, and write seams.state into the folder
    /// --3dtiles, for --shard.
    #[arg(
        long,
        requires = "tiles",
        conflicts_with_all = ["shard", "join", "glb", "web"],
        help_heading = "Shards of 3D Tiles"
    )]
    seams: bool,
    /// Draw only shard K of N stretches along the tunnel, counted from 1, with the exposures and
    /// seams in the folder --3dtiles, and write shard-K-of-N into it, for --join. It decodes its
    /// own frames only.
    #[arg(
        long,
        value_name = "K/N",
        requires = "tiles",
        conflicts_with_all = ["join", "glb", "web"],
        help_heading = "Shards of 3D Tiles"
    )]
    shard: Option<ShardNumber>,
    /// Cut the 3D Tiles from the seams and all shards in FOLDER. They have the bytes of those that
    /// are drawn as a whole.
    #[arg(
        long,
        value_name = "FOLDER",
        requires = "tiles",
        conflicts_with_all = ["glb", "web"],
        help_heading = "Shards of 3D Tiles"
    )]
    join: Option<PathBuf>,
    #[command(flatten)]
    layers: LayerArguments,
    #[command(flatten)]
    textures: TextureArguments,
    #[command(flatten)]
    dry_run: DryRunArguments,
}

/// Description of the output.
#[derive(Serialize)]
struct ExportReport<'a> {
    glb: Option<&'a Path>,
    tiles: Option<&'a Path>,
    web: Option<&'a Path>,
    /// Canvas of glb and tiles.
    canvas: Option<Canvas>,
    chainage_m: Option<[f64; 2]>,
    /// Layers of web.
    layers: Vec<LayerName>,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses or the output.
pub fn run(
    arguments: &ExportArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    check_outputs(arguments)?;
    let (survey, trajectory) = arguments.poses.open(&arguments.survey, terminal)?;
    if arguments.dry_run.is_set() {
        return describe(arguments, (survey, trajectory))?.print(terminal);
    }
    let inputs = record::hash_survey(&survey, arguments.poses.file())?;
    let files = arguments.files();
    let options = arguments.textures.options();
    let mut outputs = OutputSet::default();
    let poses = poses_of(&trajectory);
    let texture = || -> Result<TextureShards, Failure> {
        Ok(TextureShards {
            survey: &survey,
            poses: &poses,
            options,
            origin: resume::origin(&survey, &arguments.options_of_parts(), inputs.clone())?,
            job: PanoramaJob::new(terminal, 1),
        })
    };
    if let Some(parts) = arguments.folder_of_parts() {
        let texture = texture()?;
        return match arguments.shard {
            Some(shard) => write_shard(&texture, parts, shard, terminal),
            None => write_seams(&texture, parts, terminal),
        };
    }
    let has_wall = files.glb.is_some() || files.tiles.is_some();
    let job = PanoramaJob::new(terminal, usize::from(has_wall) + arguments.count_layers());
    let canvas = match (&arguments.join, &arguments.tiles) {
        (Some(parts), Some(tiles)) => Some(join_shards(&texture()?, parts, tiles, &mut outputs)?),
        _ if has_wall => Some(stage_wall(
            &survey,
            &poses,
            &options,
            files,
            &mut outputs,
            &job,
        )?),
        _ => None,
    };
    let layers = match &arguments.web {
        Some(folder) => {
            let page = (folder.as_path(), &mut outputs);
            let job = job.after(usize::from(has_wall));
            add_page(arguments, page, (survey, trajectory), &job)?
        }
        None => Vec::new(),
    };
    for path in arguments.run_files() {
        record.add_to(&mut outputs, &path, &inputs)?;
    }
    outputs.commit()?;
    let report = ExportReport {
        glb: files.glb,
        tiles: files.tiles,
        web: arguments.web.as_deref(),
        canvas,
        chainage_m: canvas.map(|canvas| canvas.chainage_m()),
        layers,
    };
    if terminal.is_json() {
        json::print(&report)
    } else {
        print_summary(&report, terminal);
        Ok(())
    }
}

impl ExportArguments {
    /// Files that are drawn from one panorama.
    fn files(&self) -> ExportFiles<'_> {
        ExportFiles {
            glb: self.glb.as_deref(),
            tiles: self.tiles.as_deref(),
        }
    }

    /// The folder of the parts of the 3D Tiles, if one of them is written instead of all.
    fn folder_of_parts(&self) -> Option<&Path> {
        let is_part = self.seams || self.shard.is_some();
        self.tiles.as_deref().filter(|_| is_part)
    }

    /// Everything that parts of the 3D Tiles depend on, except the survey.
    fn options_of_parts(&self) -> impl Serialize {
        let options = self.textures.options();
        (options.px_per_metre, options.render, options.quality)
    }

    /// Number of layers of the page, if there is one.
    fn count_layers(&self) -> usize {
        let layers = self.web.as_ref().map(|_| &self.layers);
        layers.map_or(0, |layers| layers.count(&self.survey, &self.poses))
    }

    /// Paths of the records of the run.
    fn run_files(&self) -> Vec<PathBuf> {
        let beside = self.glb.iter().map(|glb| record::path_beside(glb));
        let folders = self.tiles.iter().chain(&self.web);
        let inside = folders.map(|folder| folder.join(RUN_FILE));
        beside.chain(inside).collect()
    }
}

/// The work, which is checked as far as is possible without frames.
///
/// # Errors
/// Layers that do not exist, poses that cannot be placed on the wall, too little memory.
fn describe(arguments: &ExportArguments, opened: (Survey, Trajectory)) -> Result<Job, Failure> {
    let (options, files) = (arguments.textures.options(), arguments.files());
    let outputs = [&arguments.glb, &arguments.tiles, &arguments.web];
    let mut job = Job {
        writes: outputs.into_iter().flatten().cloned().collect(),
        ..Job::of(&opened.0, arguments.poses.file())
    };
    if arguments.folder_of_parts().is_none() {
        job.writes.extend(arguments.run_files());
    }
    if files.glb.is_some() || files.tiles.is_some() {
        let plan = plan_wall(&opened.0, &poses_of(&opened.1), &options, files)?;
        job.panorama_px = Some([plan.canvas.columns, plan.canvas.rows]);
        job.memory_bytes = Some(plan.memory_bytes);
    }
    if arguments.web.is_some() {
        let layers = &arguments.layers;
        let (survey, selected) = layers.select(&arguments.survey, &arguments.poses, opened)?;
        let posed: Vec<PosedLayer> = selected.into_iter().map(|(_, posed)| posed).collect();
        let bytes = plan_layers(&survey, &posed, &options)?;
        job.memory_bytes = job.memory_bytes.max(Some(bytes));
    }
    Ok(job)
}

fn print_summary(report: &ExportReport, terminal: &Terminal) {
    if let Some(canvas) = report.canvas {
        let [from_m, to_m] = canvas.chainage_m();
        for path in [report.glb, report.tiles].into_iter().flatten() {
            terminal.say(format!(
                "{}: {} × {} px of wall, {:.2} px per metre, chainage {from_m:.3} to {to_m:.3} m",
                printed(path),
                canvas.columns,
                canvas.rows,
                canvas.px_per_metre
            ));
        }
    }
    if let Some(folder) = report.web {
        let names: Vec<&str> = report.layers.iter().map(|name| name.text()).collect();
        terminal.say(format!(
            "{}: {}, for any web server, or `tunnelstitch view {0}`",
            printed(folder),
            names.join(", "),
        ));
    }
}

/// Checks the names, and that the program has its viewer, before any work is done.
fn check_outputs(arguments: &ExportArguments) -> Result<(), Failure> {
    if let Some(parts) = arguments.folder_of_parts() {
        return Ok(atomic::check_folder(parts)?);
    }
    if let Some(glb) = &arguments.glb {
        if glb.extension().is_none_or(|extension| extension != "glb") {
            return Err(Failure::usage(format!(
                "--glb {}: the name must end in .glb",
                printed(glb)
            )));
        }
        check_parent_folder(glb)?;
    }
    for (folder, file) in [(&arguments.tiles, TILESET), (&arguments.web, MANIFEST)] {
        if let Some(folder) = folder {
            check_parent_folder(folder)?;
            check_replaceable(folder, file)?;
        }
    }
    if arguments.web.is_some() {
        Viewer::bundled()?;
    }
    Ok(())
}

/// Refuses a folder whose content would be lost: one that is not empty and is no earlier export,
/// recognised by `file`.
fn check_replaceable(folder: &Path, file: &str) -> Result<(), Failure> {
    let is_empty = std::fs::read_dir(folder).map_or(true, |mut entries| entries.next().is_none());
    if is_empty || folder.join(file).is_file() {
        return Ok(());
    }
    Err(Failure::usage(format!(
        "{}: holds other files than an earlier export; name another folder",
        printed(folder)
    )))
}

/// Adds the page of --web to a set of outputs; returns its layers.
fn add_page(
    arguments: &ExportArguments,
    page: (&Path, &mut OutputSet),
    opened: (Survey, Trajectory),
    job: &PanoramaJob,
) -> Result<Vec<LayerName>, Failure> {
    let layers = &arguments.layers;
    let (survey, selected) = layers.select(&arguments.survey, &arguments.poses, opened)?;
    let (names, posed): (Vec<_>, Vec<_>) = selected.into_iter().unzip();
    let options = arguments.textures.options();
    stage_page(&survey, &posed, &options, layers.twelve_at_deg, page, job)?;
    Ok(names)
}
