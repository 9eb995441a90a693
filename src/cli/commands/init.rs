//! `tunnelstitch init`: writes a `survey.toml` for the files of a folder.

use super::init_summary::summary;
use crate::cli::arguments::positive;
use crate::cli::output::{Failure, Terminal};
use crate::files::printed;
use crate::persist::atomic;
use crate::survey::{AXIS_FILE, Discovery, LeftAside, SURVEY_FILE, Survey, SurveyError};
use crate::trajectory::{PoseError, TunnelAxis};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Searches a folder for frames, calibration and poses, and writes a commented survey.toml for
/// them.
///
/// The frames are the largest group of pictures in one folder, or the images of a recording, or
/// those of a video, if there are no pictures. A calibration that fits their size and poses of the
/// same number are preferred. Poses of structure from motion on a straight line tell the tunnel's
/// axis, which is written to axis.json. The command prints what it took, what it left aside and
/// why, and what is missing.
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
    /// Metres of one unit of the poses. Programs of structure from motion give poses without a
    /// scale: divide a measured length by the same length in units of the poses.
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
    found.find_bits(folder);
    found.find_axis(arguments.unit_m, arguments.radius_m);
    for line in summary(&found) {
        terminal.say(line);
    }
    if let Some(found) = &found.axis {
        write_axis(folder, &found.axis, arguments.force)?;
    }
    atomic::write_text(&path, &found.survey_toml(arguments.radius_m))?;
    terminal.say(format!("wrote {}", printed(&path)));
    let sentences = pictures_beside(&found).chain(unknown_scale(&found));
    for sentence in sentences.chain(faulty_calibrations(&found)) {
        terminal.warn(sentence);
    }
    let fault = found.picture_frames().and_then(|group| group.fault.clone());
    let missing =
        Survey::open(folder).map_or_else(|error| Some(missing(&found, &error)), |_| fault);
    match &missing {
        None => terminal.say(format!("next: tunnelstitch check {}", printed(folder))),
        Some(missing) => terminal.warn(format!("not ready yet: {missing}")),
    }
    terminal.result(&report(&path, &found, missing))
}

/// The result for `--json`.
fn report<'a>(path: &'a Path, found: &'a Discovery, missing: Option<String>) -> InitReport<'a> {
    InitReport {
        survey_file: path,
        images: found.picture_frames().map(|group| group.pattern.as_str()),
        other_pictures: found
            .other_pictures()
            .map(|group| group.pattern.as_str())
            .collect(),
        video: found.video.as_ref().map(|video| video.path.as_path()),
        recording: found.recorded.as_ref().map(|(path, _)| path.as_path()),
        mask: found.mask.as_deref(),
        calibration: found.calibrations.first().map(|found| found.path.as_path()),
        initial_poses: found.initial().map(|(path, _)| path.as_path()),
        true_poses: found.truth().map(|(path, _)| path.as_path()),
        tunnel_axis: found.axis.as_ref().map(|found| &found.axis),
        lacks_scale: found.lacks_scale(),
        left_aside: &found.left_aside,
        missing,
    }
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

/// The sentences about pictures that may belong to the sequence of the frames.
fn pictures_beside(found: &Discovery) -> impl Iterator<Item = String> {
    let frames = found.picture_frames().into_iter();
    let beside = frames.flat_map(|frames| {
        let others = found.other_pictures();
        others.filter_map(move |other| other.may_continue(frames).then_some((frames, other)))
    });
    beside.map(|(frames, other)| {
        format!(
            "{} ({}) are left aside, beside the frames {} ({}) and of their size: if they are \
             frames, too, convert them to the same format",
            other.pattern, other.count, frames.pattern, frames.count
        )
    })
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
         unit by --unit-m{length}; if nobody knows it, check and refine find it by the radius",
        printed(path),
        poses.format
    ))
}

/// The reason why a survey cannot be opened. Cameras outside of the tunnel mean nothing while the
/// scale of their positions is unknown.
fn missing(found: &Discovery, error: &SurveyError) -> String {
    match error {
        SurveyError::Poses(PoseError::Read { .. }) | SurveyError::NoInitialPoses { .. }
            if found.initial().is_none() && faulty_poses(found).is_some() =>
        {
            format!(
                "there are no poses: {}",
                faulty_poses(found).unwrap_or_default()
            )
        }
        SurveyError::Poses(PoseError::Read { .. }) | SurveyError::NoInitialPoses { .. }
            if found.initial().is_none() =>
        {
            "there are no poses; let tunnelstitch plan or tunnelstitch gyro make them, or name a \
             file by initial = \"…\" under [poses]"
                .to_owned()
        }
        SurveyError::Placement { .. } if found.axis.is_some() && found.lacks_scale() => {
            "cameras are outside of the tunnel if a unit of the poses is 1 m; give the metres of a \
             unit by --unit-m"
                .to_owned()
        }
        error => error.to_string(),
    }
}

/// The files that would hold the poses, but for a fault, with it.
fn faulty_poses(found: &Discovery) -> Option<String> {
    let aside = found.left_aside.iter();
    let faulty = aside.filter(|aside| aside.is_faulty_pose_file());
    let lines: Vec<String> = faulty
        .map(|aside| format!("{} has {}", aside.pattern, aside.reason))
        .collect();
    (!lines.is_empty()).then(|| lines.join("; "))
}

/// The sentences about calibrations that cannot be used, if there is no other.
fn faulty_calibrations(found: &Discovery) -> impl Iterator<Item = String> {
    let is_guessed = found.calibrations.is_empty();
    let aside = found.left_aside.iter().filter(move |_| is_guessed);
    let faulty = aside.filter(|aside| aside.is_faulty_calibration());
    faulty.map(|aside| {
        format!(
            "{} is not used, and a pinhole is guessed instead: {}",
            aside.pattern, aside.reason
        )
    })
}

/// The parts that were found, for `--json`; paths are relative to the folder.
#[derive(Serialize)]
struct InitReport<'a> {
    survey_file: &'a Path,
    images: Option<&'a str>,
    /// Patterns of the other pictures.
    other_pictures: Vec<&'a str>,
    video: Option<&'a Path>,
    recording: Option<&'a Path>,
    mask: Option<&'a Path>,
    calibration: Option<&'a Path>,
    initial_poses: Option<&'a Path>,
    true_poses: Option<&'a Path>,
    /// The axis in axis.json, if one was found.
    tunnel_axis: Option<&'a TunnelAxis>,
    /// The other files and folders.
    left_aside: &'a [LeftAside],
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
        None if found.pictures.is_empty() && found.choose_recording() => None,
        None if found.pictures.is_empty() => found.videos.first().cloned(),
        None => None,
    };
    match video {
        Some(video) => {
            found.choose_video(folder, &video, arguments.every.unwrap_or(1) as usize)?;
            Ok(())
        }
        None if found.recorded.is_some() && arguments.every.is_some() => Err(Failure::usage(
            "--every needs a video; for a recording, write `every` under [frames] of survey.toml",
        )),
        None if found.recorded.is_some() => Ok(()),
        None if found.pictures.is_empty() => Err(no_frames(folder, found)),
        None if arguments.every.is_some() => Err(Failure::usage(
            "--every needs a video, but the folder holds pictures: name the video with --video",
        )),
        None => Ok(()),
    }
}

/// The error of a folder without pictures that are read, and without a video.
fn no_frames(folder: &Path, found: &Discovery) -> Failure {
    let mut aside = found.left_aside.iter();
    let unread = aside.find(|aside| aside.is_unread_picture() || aside.is_archive());
    let unread = unread.map_or(String::new(), |aside| {
        format!("; {} ({}): {}", aside.pattern, aside.count, aside.reason)
    });
    Failure::input(format!(
        "{}: holds no pictures (JPEG, PNG, TIFF, WebP), no recording (MCAP, ROS 1 bag) of \
         some and no video, up to three folders below{unread}",
        printed(folder)
    ))
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
