//! `tunnelstitch convert`: poses in another format.

use super::poses::PosesArgument;
use super::record::{self, RUN_FILE, Run};
use super::{Failure, Terminal};
use crate::camera::ColmapCamera;
use crate::persist::atomic::{self, StagedFolder, WriteError};
use crate::survey::Survey;
use crate::trajectory::{StampedPose, colmap, csv, kitti, nerfstudio, tum};
use clap::ValueEnum;
use std::path::{Path, PathBuf};

/// Writes poses in another format, in the tunnel's frame and the format's own convention.
///
/// One pose per frame, in the frames' order. Frames are named by their paths from the survey's
/// folder (csv, colmap) or from the file's (nerfstudio). The camera goes with colmap and
/// nerfstudio.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch convert survey --poses refined/poses.tum --to colmap --out sparse\n      \
    for COLMAP, with the survey's folder as its image path\n  \
    tunnelstitch convert survey --poses vio.tum --pose-convention w2c --tunnel-frame axis.json --to tum --out in-tunnel.tum\n      \
    poses of another world and convention, for every other command")]
pub struct ConvertArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// The format to write.
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: ToArgument,
    /// The file; for colmap a folder, made if missing.
    #[arg(long, short, value_name = "PATH")]
    out: PathBuf,
    #[command(flatten)]
    poses: PosesArgument,
}

/// Formats that are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum ToArgument {
    /// time tx ty tz qx qy qz qw.
    Tum,
    /// The twelve numbers of a 3 × 4 matrix.
    Kitti,
    /// Named columns.
    Csv,
    /// COLMAP's text model: cameras.txt, images.txt and points3D.txt, which is empty.
    Colmap,
    /// nerfstudio's transforms.json.
    Nerfstudio,
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for everything wrong with the survey, the poses or the output.
pub fn run(arguments: &ConvertArguments, run: &Run, terminal: &Terminal) -> Result<(), Failure> {
    let (survey, trajectory) = arguments.poses.open(&arguments.survey, terminal)?;
    let out = &arguments.out;
    check_apart(&survey, out)?;
    let inputs = record::inputs(&survey, arguments.poses.file())?;
    let has_names = !matches!(arguments.to, ToArgument::Tum | ToArgument::Kitti);
    if let Some(frame) = survey
        .frames
        .iter()
        .find(|frame| frame.is_in_video() && has_names)
    {
        terminal.warn(format!(
            "the frames are pictures of a video and called {} and so on; other programs want files: ffmpeg -i {} -fps_mode passthrough \
             -start_number 0 pictures/%06d.png",
            frame.path.display(),
            frame.file().display()
        ));
    }
    let camera = ColmapCamera::of(&survey.camera);
    let of_survey = || names(&survey, &survey.folder);
    let text = match arguments.to {
        ToArgument::Tum => tum::format(&trajectory),
        ToArgument::Kitti => kitti::format(&trajectory),
        ToArgument::Csv => csv::format(&of_survey(), &trajectory),
        ToArgument::Nerfstudio => {
            let folder = out.parent().unwrap_or(Path::new(""));
            let keys = camera.nerfstudio().ok_or_else(|| {
                Failure::input("nerfstudio has no lens with k4 to k6; write colmap, or calibrate with 5 coefficients")
            })?;
            nerfstudio::format(keys, &names(&survey, folder), &trajectory)
        }
        ToArgument::Colmap => {
            write_colmap(out, &camera, &of_survey(), &trajectory)?;
            run.write(&out.join(RUN_FILE), &inputs)?;
            terminal.say(format!(
                "wrote {} poses to {}",
                trajectory.len(),
                out.display()
            ));
            return Ok(());
        }
    };
    super::stitch::parent_folder(out)?;
    atomic::write_text(out, &text)?;
    run.write(&record::beside(out), &inputs)?;
    terminal.say(format!(
        "wrote {} poses to {}",
        trajectory.len(),
        out.display()
    ));
    Ok(())
}

/// The files of a COLMAP model.
const MODEL: [&str; 3] = [
    colmap::CAMERAS_FILE,
    colmap::IMAGES_FILE,
    colmap::POINTS_FILE,
];

/// Writes a COLMAP model; an earlier one is replaced, a folder with anything else in it is not.
fn write_colmap(
    out: &Path,
    camera: &ColmapCamera,
    names: &[String],
    trajectory: &[StampedPose],
) -> Result<(), Failure> {
    if out.exists() {
        let entries = std::fs::read_dir(out).map_err(|error| WriteError::new(out, error))?;
        let is_ours = |entry: std::io::Result<std::fs::DirEntry>| {
            let mut ours = MODEL.iter().chain([&RUN_FILE]);
            entry.is_ok_and(|entry| ours.any(|name| entry.file_name() == *name))
        };
        if !entries.into_iter().all(is_ours) {
            return Err(Failure::usage(format!(
                "{}: holds more than {}, so it is not replaced; choose another folder",
                out.display(),
                MODEL.join(", ")
            )));
        }
    }
    let staged = StagedFolder::begin(out)?;
    let texts = [
        camera.cameras_txt(),
        colmap::format_images(names, trajectory),
        colmap::format_points().to_owned(),
    ];
    for (name, text) in MODEL.iter().zip(texts) {
        atomic::write_text(&staged.path().join(name), &text)?;
    }
    Ok(staged.finish()?)
}

/// The frames' paths from a folder, with slashes.
fn names(survey: &Survey, folder: &Path) -> Vec<String> {
    // Folders are resolved, since `..` leads elsewhere from a link; a frame that is a link keeps
    // its name.
    let resolved = |folder: &Path| {
        let folder = if folder.as_os_str().is_empty() {
            Path::new(".")
        } else {
            folder
        };
        let full = folder
            .canonicalize()
            .or_else(|_| std::path::absolute(folder));
        full.unwrap_or_else(|_| folder.to_owned())
    };
    let from = resolved(folder);
    let name = |path: &Path| {
        let file = path.file_name().unwrap_or_default();
        let path = resolved(path.parent().unwrap_or(Path::new(""))).join(file);
        let relative = pathdiff::diff_paths(&path, &from).unwrap_or(path);
        relative
            .to_string_lossy()
            .replace(std::path::MAIN_SEPARATOR, "/")
    };
    survey
        .frames
        .iter()
        .map(|frame| name(&frame.path))
        .collect()
}

/// Refuses an output that would replace what the survey is made of.
fn check_apart(survey: &Survey, out: &Path) -> Result<(), Failure> {
    let Ok(out_full) = out.canonicalize() else {
        // Not there yet.
        return Ok(());
    };
    let frames = survey.frames.iter().map(|frame| frame.file().to_owned());
    let files = survey.own_files().iter().cloned();
    let replaced = files.chain(frames).find(|path| {
        path.canonicalize()
            .is_ok_and(|path| path.starts_with(&out_full))
    });
    match replaced {
        Some(path) => Err(Failure::usage(format!(
            "{}: would replace {}; choose another name",
            out.display(),
            path.display()
        ))),
        None => Ok(()),
    }
}
