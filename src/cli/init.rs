//! `tunnelstitch init`: a `survey.toml` for what a folder holds.

use super::{Failure, Terminal};
use crate::persist::atomic;
use crate::survey::{Discovery, SURVEY_FILE, Survey};
use crate::trajectory::PoseFormat;
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Looks into a folder for frames, calibration and poses, and writes a commented survey.toml for
/// them.
///
/// Frames are the largest group of pictures of one folder, or those of a video if there are none; a
/// calibration that fits their size and poses that are as many are preferred. What was recognised
/// is printed, and what is still missing.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  tunnelstitch init my-survey --radius-m 1.5\n  tunnelstitch init my-survey --video my-survey/GX010001.MP4 --every 5"
)]
pub struct InitArguments {
    /// The folder.
    folder: PathBuf,
    /// Radius of the tunnel, metres; else a line to be filled in.
    #[arg(long, value_name = "M", value_parser = super::stitch::positive)]
    radius_m: Option<f64>,
    /// The video that the frames are in. It is read by ffmpeg, picture by picture; nothing is
    /// unpacked.
    #[arg(long, value_name = "FILE")]
    video: Option<PathBuf>,
    /// Every so many-th picture of the video is a frame.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
    /// Replace a survey.toml that is there.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// A folder that cannot be read or holds no pictures; a survey.toml that is there already.
pub fn run(arguments: &InitArguments, terminal: &Terminal) -> Result<(), Failure> {
    let folder = &arguments.folder;
    let path = folder.join(SURVEY_FILE);
    if path.exists() && !arguments.force {
        return Err(Failure::input(format!(
            "{}: is there already; --force replaces it",
            path.display()
        )));
    }
    let mut found = Discovery::of(folder)
        .map_err(|error| Failure::input(format!("{}: {error}", folder.display())))?;
    let video = match &arguments.video {
        Some(video) => Some(from_folder(folder, video)),
        None if found.pictures.is_empty() => found.videos.first().cloned(),
        None => None,
    };
    match video {
        Some(video) => {
            found.choose_video(folder, &video, arguments.every.unwrap_or(1) as usize)?;
        }
        None if found.pictures.is_empty() => {
            return Err(Failure::input(format!(
                "{}: holds no pictures (JPEG, PNG, TIFF, WebP) and no video, not even three folders below",
                folder.display()
            )));
        }
        None if arguments.every.is_some() => {
            return Err(Failure::usage(
                "--every goes with a video; the folder holds pictures: say which video with --video",
            ));
        }
        None => {}
    }
    for line in report(&found) {
        terminal.say(line);
    }
    atomic::write_text(&path, &text(&found, arguments.radius_m))?;
    terminal.say(format!("wrote {}", path.display()));
    match Survey::open(folder) {
        Ok(_) => terminal.say(format!("next: tunnelstitch check {}", folder.display())),
        Err(error) => terminal.warn(format!("not ready yet: {error}")),
    }
    Ok(())
}

/// A path as survey.toml in `folder` has it.
fn from_folder(folder: &Path, path: &Path) -> PathBuf {
    let relative = folder.canonicalize().ok().and_then(|folder| {
        let path = path.canonicalize().ok()?;
        pathdiff::diff_paths(path, folder)
    });
    // Not there, which is said when it is opened.
    relative.unwrap_or_else(|| std::path::absolute(path).unwrap_or_else(|_| path.to_owned()))
}

/// What was recognised, a line each.
fn report(found: &Discovery) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(video) = &found.video {
        let (width, height) = video.size;
        lines.push(format!(
            "  {:<16}{} ({} pictures, {width} × {height} px)",
            "frames",
            video.path.display(),
            match video.every {
                1 => video.count.to_string(),
                every => format!("{} of every {every}", video.count),
            },
        ));
    }
    let chosen = found.video.as_ref().map(|video| &video.path);
    for video in found.videos.iter().filter(|video| Some(*video) != chosen) {
        lines.push(format!("  {:<16}{}", "other video", video.display()));
    }
    for (k, group) in found.pictures.iter().enumerate() {
        let size = group
            .size
            .map_or("unreadable".to_owned(), |(w, h)| format!("{w} × {h} px"));
        let which = if k == 0 && found.video.is_none() {
            "frames"
        } else {
            "other pictures"
        };
        lines.push(format!(
            "  {which:<16}{} ({}, {size})",
            group.pattern, group.count
        ));
    }
    if let Some(mask) = &found.mask {
        lines.push(format!("  {:<16}{}", "mask", mask.display()));
    }
    for (k, (path, camera)) in found.calibrations.iter().enumerate() {
        let which = if k == 0 { "calibration" } else { "another" };
        lines.push(format!(
            "  {which:<16}{} ({} × {} px)",
            path.display(),
            camera.width,
            camera.height
        ));
    }
    let same = |other: Option<&(PathBuf, _)>, path: &Path| other.is_some_and(|(p, _)| p == path);
    for (path, poses) in &found.poses {
        let which = if same(found.initial(), path) {
            "initial poses"
        } else if same(found.truth(), path) {
            "true poses"
        } else {
            "other poses"
        };
        lines.push(format!(
            "  {which:<16}{} ({:?}, {} poses)",
            path.display(),
            poses.format,
            poses.entries.len()
        ));
    }
    lines
}

/// A text as TOML has it.
fn quoted(text: impl AsRef<Path>) -> String {
    toml::Value::String(text.as_ref().to_string_lossy().into_owned()).to_string()
}

fn text(found: &Discovery, radius_m: Option<f64>) -> String {
    let mut text = String::from(
        "# A survey for tunnelstitch. Paths are relative to this file.\n\n[tunnel]\nshape = \"circle\"\n",
    );
    // Writing into a string cannot fail.
    let _ = match radius_m {
        Some(radius_m) => writeln!(text, "radius_m = {radius_m:?}"),
        None => writeln!(
            text,
            "# Measure the tunnel's radius in metres and take away the # of the next line.\n# radius_m = 3.0"
        ),
    };
    text += "# ignore = [{ theta_deg = [150, 210], chainage_m = [2.0, 5.5] }]    # water, plants: refine does not look there\n";
    text += "\n[camera]\n";
    let _ = match found.calibrations.first() {
        Some((path, _)) => writeln!(text, "file = {}", quoted(path)),
        None => writeln!(
            text,
            "# No calibration was found: OpenCV, ROS or Kalibr YAML, COLMAP's cameras.txt, nerfstudio's transforms.json, or our camera.json.\n\
             file = \"camera.json\""
        ),
    };
    let pattern = found
        .pictures
        .first()
        .map_or("*.jpg", |group| &group.pattern);
    let _ = match &found.video {
        Some(video) => writeln!(
            text,
            "\n[frames]\nvideo = {}\nevery = {}    # of its pictures; their times are the video's",
            quoted(&video.path),
            video.every
        ),
        None => writeln!(
            text,
            "\n[frames]\nimages = {}    # sorted by name",
            quoted(pattern)
        ),
    };
    text += &match &found.mask {
        Some(mask) => format!("mask = {}    # black where no frame shows the wall\n", quoted(mask)),
        None => "# mask = \"mask.png\"    # a picture of the frames' size, black where none of them shows the wall\n".to_owned(),
    };
    text += "\n[poses]\n";
    let (count, _) = found.frames();
    match found.initial() {
        None => {
            text += "# No poses were found: TUM, KITTI, CSV, COLMAP, nerfstudio or EuRoC.\ninitial = \"baseline.tum\"\n";
        }
        Some((path, poses)) => {
            let _ = writeln!(
                text,
                "initial = {}    # {} poses for {count} frames",
                quoted(path),
                poses.entries.len()
            );
            if poses.entries.len() != count && poses.has_times() && !poses.has_names() {
                text += match &found.video {
                    Some(_) => {
                        "associate = \"time\"       # by the video's times, or by [frames] times = FILE\ninterpolate = true\n"
                    }
                    None => {
                        "associate = \"time\"       # by the frames' names, or by [frames] times = FILE\n# interpolate = true\n"
                    }
                };
            }
            if poses.format == PoseFormat::Euroc {
                text += "# These are a body's poses: how the camera is mounted (its sensor.yaml, or a 4 × 4 matrix).\n\
                         # body_to_camera = \"sensor.yaml\"\n";
            }
        }
    }
    if let Some((path, _)) = found.truth() {
        let _ = writeln!(
            text,
            "truth = {}      # only ever used to compare",
            quoted(path)
        );
    }
    text += "# convention = \"c2w\"       # or \"w2c\"; each format has its own\n\
             # camera_axes = \"opencv\"   # or \"opengl\"; each format has its own\n\
             # tunnel_frame = \"axis.json\"   # where the tunnel's axis lies, if it is not the poses' y axis\n\n\
             [prior]                     # how far off the initial poses may be, 1-σ\n\
             model = \"random-walk\"       # errors add up from frame to frame; or \"independent\"\n\
             rotation_sigma_deg = 2.0    # about each axis\n\
             translation_sigma_m = [0.02, 0.02, 0.03]\n";
    text
}
