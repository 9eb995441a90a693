//! `tunnelstitch convert`: writes poses in another format.

use crate::camera::{ColmapCamera, UnknownModelError};
use crate::cli::arguments::PosesArguments;
use crate::cli::output::{
    Failure, RUN_FILE, RunRecord, Terminal, check_parent_folder, is_stream, json, record,
    refuse_overwriting, refuse_two_results, survey_files,
};
use crate::files::printed;
use crate::persist::atomic::{self, OutputSet, StagedFolder, WriteError};
use crate::trajectory::{StampedPose, colmap, csv, kitti, nerfstudio, tum};
use clap::ValueEnum;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Writes poses in another format, in the tunnel's frame and the convention of the format.
///
/// There is one pose per frame, in the order of the frames. Paths of the frames are relative to the
/// survey's folder (csv, colmap) or to the folder of the output (nerfstudio). The output of colmap
/// and nerfstudio includes the camera.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch convert survey --poses refined/poses.tum --to colmap --out sparse\n      \
    for COLMAP, with the survey's folder as its image path\n  \
    tunnelstitch convert survey --poses vio.tum --pose-convention w2c \
    --tunnel-frame axis.json --to tum --out in-tunnel.tum\n      \
    poses of another world frame and convention, for every other command")]
pub struct ConvertArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// Format of the output.
    #[arg(long, value_enum, value_name = "FORMAT")]
    to: OutputFormat,
    /// The file to write; for colmap a folder, created if missing. `-` prints the poses on standard
    /// output, without a record of the run.
    #[arg(long, short, value_name = "PATH")]
    out: PathBuf,
    #[command(flatten)]
    poses: PosesArguments,
}

/// Names of formats that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum OutputFormat {
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
pub fn run(
    arguments: &ConvertArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let (survey, trajectory) = arguments.poses.open(&arguments.survey, terminal)?;
    let out = &arguments.out;
    refuse_two_results(out, terminal)?;
    refuse_overwriting(std::slice::from_ref(out), survey_files(&survey))?;
    let inputs = record::hash_survey(&survey, arguments.poses.file())?;
    let has_names = !matches!(arguments.to, OutputFormat::Tum | OutputFormat::Kitti);
    let recorded = survey
        .frames
        .iter()
        .find(|frame| frame.shared_file().is_some() && !frame.is_in_video() && has_names);
    if let Some(frame) = recorded {
        terminal.warn(format!(
            "the frames are in {}, named {} and so on; other programs need them as files of \
             these names",
            printed(frame.file()),
            printed(&frame.path)
        ));
    }
    if let Some(frame) = survey
        .frames
        .iter()
        .find(|frame| frame.is_in_video() && has_names)
    {
        terminal.warn(format!(
            "the frames are pictures of a video, named {} and so on; other programs need them as \
             files: ffmpeg -i {} -fps_mode passthrough -start_number 0 pictures/%06d.png",
            printed(&frame.path),
            printed(frame.file())
        ));
    }
    let camera = || {
        if survey.cameras.is_rig() {
            return Err(Failure::usage(
                "the frames are those of a rig of several cameras; poses alone are written --to \
                 tum, kitti or csv",
            ));
        }
        ColmapCamera::of(survey.cameras.of(0))
            .map_err(|error| unknown_model(&error, "tum, kitti or csv"))
    };
    let names = || survey.frame_paths_from(&survey.folder);
    let text = match arguments.to {
        OutputFormat::Tum => tum::format(&trajectory),
        OutputFormat::Kitti => kitti::format(&trajectory),
        OutputFormat::Csv => csv::format(&names(), &trajectory),
        OutputFormat::Nerfstudio => {
            let folder = out.parent().unwrap_or(Path::new(""));
            let keys = camera()?.nerfstudio();
            let keys = keys.map_err(|error| unknown_model(&error, "colmap"))?;
            nerfstudio::format(keys, &survey.frame_paths_from(folder), &trajectory)
        }
        OutputFormat::Colmap if is_stream(out) => {
            return Err(Failure::usage(
                "--to colmap writes a folder, which cannot be printed; name one by --out",
            ));
        }
        OutputFormat::Colmap => {
            let mut outputs = OutputSet::default();
            outputs.folder(stage_colmap(out, &camera()?, &names(), &trajectory)?)?;
            record.add_to(&mut outputs, &out.join(RUN_FILE), &inputs)?;
            outputs.commit()?;
            return print_result(out, trajectory.len(), terminal);
        }
    };
    if is_stream(out) {
        return json::print_text(&text);
    }
    check_parent_folder(out)?;
    let mut outputs = OutputSet::default();
    outputs.write_text(out, &text)?;
    record.add_to(&mut outputs, &record::path_beside(out), &inputs)?;
    outputs.commit()?;
    print_result(out, trajectory.len(), terminal)
}

/// The result, for `--json`.
#[derive(Serialize)]
struct ConvertReport<'a> {
    out: &'a Path,
    poses: usize,
}

fn print_result(out: &Path, poses: usize, terminal: &Terminal) -> Result<(), Failure> {
    terminal.say(format!("wrote {poses} poses to {}", printed(out)));
    terminal.result(&ConvertReport { out, poses })
}

/// The failure of a format that cannot hold the camera's lens.
fn unknown_model(error: &UnknownModelError, other: &str) -> Failure {
    Failure::input(format!(
        "{error}; write {other}, or calibrate with a model that it has (PINHOLE, OPENCV, \
         OPENCV_FISHEYE)"
    ))
}

/// Files of a COLMAP model.
const MODEL_FILES: [&str; 3] = [
    colmap::CAMERAS_FILE,
    colmap::IMAGES_FILE,
    colmap::POINTS_FILE,
];

/// Writes a COLMAP model that is to replace an earlier one, but no folder with other files.
fn stage_colmap(
    out: &Path,
    camera: &ColmapCamera,
    names: &[String],
    trajectory: &[StampedPose],
) -> Result<StagedFolder, Failure> {
    if out.exists() {
        let entries = std::fs::read_dir(out).map_err(|error| WriteError::new(out, error))?;
        let is_of_model = |entry: std::io::Result<std::fs::DirEntry>| {
            let mut names = MODEL_FILES.iter().chain([&RUN_FILE]);
            entry.is_ok_and(|entry| names.any(|name| entry.file_name() == *name))
        };
        if !entries.into_iter().all(is_of_model) {
            return Err(Failure::usage(format!(
                "{}: holds other files than {}, so it is not replaced; choose another folder",
                printed(out),
                MODEL_FILES.join(", ")
            )));
        }
    }
    let images = colmap::format_images(names, trajectory)
        .map_err(|error| Failure::input(error.to_string()))?;
    let staged = StagedFolder::begin(out)?;
    let texts = [
        camera.cameras_txt(),
        images,
        colmap::format_points().to_owned(),
    ];
    for (name, text) in MODEL_FILES.iter().zip(texts) {
        atomic::write_text(&staged.path().join(name), &text)?;
    }
    Ok(staged)
}
