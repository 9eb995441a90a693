//! `tunnelstitch init`: writes a `survey.toml` for the files of a folder.

use crate::cli::arguments::positive;
use crate::cli::output::{Failure, Terminal};
use crate::files::printed;
use crate::persist::atomic;
use crate::survey::{AXIS_FILE, Discovery, FoundAxis, SURVEY_FILE, Survey, SurveyError};
use crate::trajectory::TunnelAxis;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Searches a folder for frames, calibration and poses, and writes a commented survey.toml for
/// them.
///
/// The frames are the largest group of pictures in one folder, or those of a video if there are no
/// pictures. A calibration that fits their size and poses of the same number are preferred. Poses of
/// structure from motion on a straight line tell the tunnel's axis, which is written to axis.json.
/// The command prints what it has recognised and what is missing.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    tunnelstitch init my-survey --radius-m 1.5\n  \
    tunnelstitch init my-model --radius-m 0.15 --unit-m 0.52\n  \
    tunnelstitch init my-survey --video my-survey/GX010001.MP4 --every 5")]
pub struct InitArguments {
    /// The folder.
    folder: PathBuf,
    /// Radius of the tunnel, metres; without it survey.toml has a line to be filled in.
    #[arg(long, value_name = "M", value_parser = positive)]
    radius_m: Option<f64>,
    /// Metres of one unit of the poses. Programs of structure from motion give poses without a scale:
    /// divide a measured length by the same length in units of the poses.
    #[arg(long, value_name = "M", value_parser = positive)]
    unit_m: Option<f64>,
    /// Video that holds the frames. ffmpeg decodes it picture by picture; no pictures are stored.
    #[arg(long, value_name = "FILE")]
    video: Option<PathBuf>,
    /// Use every N-th picture of the video as a frame [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
    /// Replace an existing survey.toml, and axis.json if one is found.
    #[arg(long)]
    force: bool,
}

/// Runs the command.
///
/// # Errors
/// A folder that cannot be read or holds no pictures; a survey.toml that exists already.
pub fn run(arguments: &InitArguments, terminal: &Terminal) -> Result<(), Failure> {
    let folder = &arguments.folder;
    let path = folder.join(SURVEY_FILE);
    refuse_existing(&path, arguments.force)?;
    let mut found = Discovery::of(folder)
        .map_err(|error| Failure::input(format!("{}: {error}", printed(folder))))?;
    choose_frames(arguments, &mut found)?;
    found.find_axis(arguments.unit_m, arguments.radius_m);
    for line in summary(&found) {
        terminal.say(line);
    }
    if let Some(found) = &found.axis {
        write_axis(folder, &found.axis, arguments.force)?;
    }
    atomic::write_text(&path, &found.survey_toml(arguments.radius_m))?;
    terminal.say(format!("wrote {}", printed(&path)));
    if let Some(sentence) = unknown_scale(&found) {
        terminal.warn(sentence);
    }
    let missing = Survey::open(folder)
        .err()
        .map(|error| missing(&found, &error));
    match &missing {
        None => terminal.say(format!("next: tunnelstitch check {}", printed(folder))),
        Some(missing) => terminal.warn(format!("not ready yet: {missing}")),
    }
    let is_video = found.video.is_some();
    terminal.result(&InitReport {
        survey_file: &path,
        images: (found.pictures.first().filter(|_| !is_video)).map(|group| group.pattern.as_str()),
        video: found.video.as_ref().map(|video| video.path.as_path()),
        mask: found.mask.as_deref(),
        calibration: found.calibrations.first().map(|(path, _)| path.as_path()),
        initial_poses: found.initial().map(|(path, _)| path.as_path()),
        true_poses: found.truth().map(|(path, _)| path.as_path()),
        tunnel_axis: found.axis.as_ref().map(|found| &found.axis),
        lacks_scale: found.lacks_scale(),
        missing,
    })
}

/// Refuses to replace a file without `--force`.
fn refuse_existing(path: &Path, force: bool) -> Result<(), Failure> {
    if path.exists() && !force {
        return Err(Failure::input(format!(
            "{}: exists already; --force replaces it",
            printed(path)
        )));
    }
    Ok(())
}

/// Writes the file of the tunnel's axis.
fn write_axis(folder: &Path, axis: &TunnelAxis, force: bool) -> Result<(), Failure> {
    let path = folder.join(AXIS_FILE);
    refuse_existing(&path, force)?;
    let json = serde_json::to_string(axis).map_err(|error| Failure::bug(error.to_string()))?;
    Ok(atomic::write_text(&path, &(json + "\n"))?)
}

/// The sentence about poses without a known scale, if they have none.
fn unknown_scale(found: &Discovery) -> Option<String> {
    let (path, poses) = found.initial().filter(|_| found.lacks_scale())?;
    let length = found.axis.as_ref().map_or(String::new(), |found| {
        format!(
            "; the cameras go {:.4} units along the tunnel: divide the metres of that way by it",
            found.path.length
        )
    });
    Some(format!(
        "{}: {:?} gives poses without a scale, and one unit is taken for 1 m; give the metres of a \
         unit by --unit-m{length}",
        printed(path),
        poses.format
    ))
}

/// The reason why a survey cannot be opened. Cameras outside of the tunnel mean nothing while the
/// scale of their positions is unknown.
fn missing(found: &Discovery, error: &SurveyError) -> String {
    match error {
        SurveyError::Placement { .. } if found.axis.is_some() && found.lacks_scale() => {
            "cameras are outside of the tunnel if a unit of the poses is 1 m; give the metres of a \
             unit by --unit-m"
                .to_owned()
        }
        error => error.to_string(),
    }
}

/// The parts that were found, for `--json`; paths are relative to the folder.
#[derive(Serialize)]
struct InitReport<'a> {
    survey_file: &'a Path,
    images: Option<&'a str>,
    video: Option<&'a Path>,
    mask: Option<&'a Path>,
    calibration: Option<&'a Path>,
    initial_poses: Option<&'a Path>,
    true_poses: Option<&'a Path>,
    /// The axis in axis.json, if one was found.
    tunnel_axis: Option<&'a TunnelAxis>,
    /// True if the poses have no known scale.
    lacks_scale: bool,
    /// The error that keeps the survey from being used, if there is one.
    missing: Option<String>,
}

/// Chooses a video as source of the frames if one is named or there are no pictures.
fn choose_frames(arguments: &InitArguments, found: &mut Discovery) -> Result<(), Failure> {
    let folder = &arguments.folder;
    let video = match &arguments.video {
        Some(video) => Some(relative_to(folder, video)),
        None if found.pictures.is_empty() => found.videos.first().cloned(),
        None => None,
    };
    match video {
        Some(video) => {
            found.choose_video(folder, &video, arguments.every.unwrap_or(1) as usize)?;
            Ok(())
        }
        None if found.pictures.is_empty() => Err(Failure::input(format!(
            "{}: holds no pictures (JPEG, PNG, TIFF, WebP) and no video, up to three folders below",
            printed(folder)
        ))),
        None if arguments.every.is_some() => Err(Failure::usage(
            "--every needs a video, but the folder holds pictures: name the video with --video",
        )),
        None => Ok(()),
    }
}

/// A path as survey.toml in `folder` has it.
fn relative_to(folder: &Path, path: &Path) -> PathBuf {
    let relative = folder.canonicalize().ok().and_then(|folder| {
        let path = path.canonicalize().ok()?;
        pathdiff::diff_paths(path, folder)
    });
    // A missing file is reported when it is opened.
    relative.unwrap_or_else(|| std::path::absolute(path).unwrap_or_else(|_| path.to_owned()))
}

/// Lists what was recognised, one line each.
fn summary(found: &Discovery) -> Vec<String> {
    let mut lines = Vec::new();
    let row = |name: &str, text: String| format!("  {name:<16}{text}");
    if let Some(video) = &found.video {
        let (width, height) = video.size;
        let count = match video.every {
            1 => video.count.to_string(),
            every => format!("{} of every {every}", video.count),
        };
        let path = printed(&video.path);
        lines.push(row(
            "frames",
            format!("{path} ({count} pictures, {width} × {height} px)"),
        ));
    }
    let chosen = found.video.as_ref().map(|video| &video.path);
    for video in found.videos.iter().filter(|video| Some(*video) != chosen) {
        lines.push(row("other video", printed(video).to_string()));
    }
    for (k, group) in found.pictures.iter().enumerate() {
        let size = group
            .size
            .map_or("unreadable".to_owned(), |(w, h)| format!("{w} × {h} px"));
        let name = if k == 0 && found.video.is_none() {
            "frames"
        } else {
            "other pictures"
        };
        let text = format!("{} ({}, {size})", group.pattern, group.count);
        lines.push(row(name, text));
    }
    if let Some(mask) = &found.mask {
        lines.push(row("mask", printed(mask).to_string()));
    }
    for (k, (path, camera)) in found.calibrations.iter().enumerate() {
        let name = if k == 0 { "calibration" } else { "another" };
        let (width, height) = (camera.width, camera.height);
        let text = format!("{} ({width} × {height} px)", printed(path));
        lines.push(row(name, text));
    }
    let is_same = |other: Option<&(PathBuf, _)>, path: &Path| other.is_some_and(|(p, _)| p == path);
    for (path, poses) in &found.poses {
        let name = if is_same(found.initial(), path) {
            "initial poses"
        } else if is_same(found.truth(), path) {
            "true poses"
        } else {
            "other poses"
        };
        let (format, count) = (poses.format, poses.entries.len());
        lines.push(row(
            name,
            format!("{} ({format:?}, {count} poses)", printed(path)),
        ));
    }
    if let Some(found) = &found.axis {
        lines.push(row("axis", axis_text(found)));
    }
    lines
}

/// The description of a found axis, in the unit of the poses.
fn axis_text(found: &FoundAxis) -> String {
    let path = &found.path;
    let [x, y, z] = found.axis.axis;
    format!(
        "{AXIS_FILE} ({x:.3} {y:.3} {z:.3}, the line through {} of {} cameras: {:.4} RMS and {:.4} \
         at most off it over a length of {:.4} units of the poses)",
        path.count, found.poses, path.rms_distance, path.max_distance, path.length
    )
}
