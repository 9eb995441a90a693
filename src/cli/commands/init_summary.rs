//! The summary of `tunnelstitch init`: what it took of a folder and what it left aside, and why.

use crate::files::printed;
use crate::frames::PictureOrientation;
use crate::survey::{
    AXIS_FILE, Discovery, FoundAxis, FoundCalibration, LeftAside, PictureGroup, SelectedCamera,
};
use crate::trajectory::PoseFile;
use std::path::{Path, PathBuf};

/// Lists what was recognised, then what was left aside, one line each.
pub(super) fn summary(found: &Discovery) -> Vec<String> {
    let taken = frames(found)
        .into_iter()
        .chain(mask(found))
        .chain(calibrations(found))
        .chain(poses(found))
        .chain(found.axis.iter().map(axis));
    taken.chain(left_aside(found)).collect()
}

/// A line: the part of the survey, and the files.
fn row(name: &str, text: impl AsRef<str>) -> String {
    format!("  {name:<16}{}", text.as_ref())
}

/// The frames, then other videos and pictures.
fn frames(found: &Discovery) -> Vec<String> {
    let mut lines = Vec::new();
    if let Some(video) = &found.video {
        let (width, height) = video.size;
        let count = match video.every {
            1 => video.count.to_string(),
            every => format!("{} of every {every}", video.count),
        };
        let path = printed(&video.path);
        let text = format!("{path} ({count} pictures, {width} × {height} px)");
        lines.push(row("frames", text));
    }
    if let Some((path, images)) = &found.recorded {
        let (path, topic, count) = (printed(path), &images.topic, images.count);
        let size = images.size;
        let size = size.map_or("unreadable".to_owned(), |(w, h)| format!("{w} × {h} px"));
        let text = format!("{path}, topic {topic} ({count} images, {size})");
        lines.push(row("frames", text));
        for other in &images.others {
            let text = format!("{other}: it has not more; topic under [frames] takes it");
            lines.push(row("other topic", text));
        }
    }
    if let Some(group) = found.picture_frames() {
        lines.push(row("frames", pictures(group, &reading(found))));
    }
    for camera in found.rig.iter().flat_map(|rig| &rig.cameras) {
        let text = format!("{} (camera {} of a rig)", camera.pattern, camera.name);
        lines.push(row("camera", text));
    }
    let chosen = found.video.as_ref().map(|video| &video.path);
    let why = match chosen {
        Some(_) => "another video is taken",
        None if found.recorded.is_some() => "there is a recording; --video takes it",
        None => "there are pictures; --video takes it",
    };
    for video in found.videos.iter().filter(|video| Some(*video) != chosen) {
        lines.push(row("other video", format!("{}: {why}", printed(video))));
    }
    let taken = found.recorded.as_ref().map(|(path, _)| path);
    let others = found
        .recordings
        .iter()
        .filter(|parts| Some(&parts.path) != taken);
    for parts in others.filter(|parts| parts.images.is_some()) {
        let text = format!("{}: its images are not taken", printed(&parts.path));
        lines.push(row("other recording", text));
    }
    for group in found.other_pictures() {
        let why = match (&group.fault, found.picture_frames()) {
            (Some(fault), _) => fault.clone(),
            (None, None) => "the frames are in another file".to_owned(),
            (None, Some(_)) => format!(
                "a survey takes one group of pictures, the largest; images = {:?} under [frames] \
                 takes this",
                group.pattern
            ),
        };
        let text = format!("{}: {why}", pictures(group, ""));
        lines.push(row("other pictures", text));
    }
    lines
}

/// The reading of the frames other than as they are stored.
fn reading(found: &Discovery) -> String {
    let bits = found.bits.map(|bits| format!(", {bits} bits in 16"));
    let is_turned = found.orientation() == Some(PictureOrientation::Exif);
    let turned = if is_turned {
        ", turned as EXIF says"
    } else {
        ""
    };
    bits.unwrap_or_default() + turned
}

/// A group of pictures.
fn pictures(group: &PictureGroup, reading: &str) -> String {
    let size = group
        .size
        .map_or("unreadable".to_owned(), |(w, h)| format!("{w} × {h} px"));
    format!("{} ({}, {size}{reading})", group.pattern, group.count)
}

fn mask(found: &Discovery) -> Option<String> {
    let mask = found.mask.as_ref();
    mask.map(|mask| row("mask", printed(mask).to_string()))
}

/// The calibration, then others; or that there is none.
fn calibrations(found: &Discovery) -> Vec<String> {
    if found.calibrations.is_empty() {
        let text = "none: a pinhole is guessed, and refine searches for its focal length";
        return vec![row("calibration", text)];
    }
    let has_rig = found.rig.is_some();
    let (_, frames) = found.frames();
    let size = |k: usize| found.calibrations.get(k).map(FoundCalibration::size);
    let line = |(k, found): (usize, &FoundCalibration)| {
        let (width, height) = found.size();
        let selected = found.selected.as_ref().filter(|_| !has_rig);
        let selected = selected.map_or(String::new(), |selected| {
            let SelectedCamera { name, of } = selected;
            format!("; camera {name}, one of {of} that differ: name under [camera] selects another")
        });
        let text = format!("{} ({width} × {height} px{selected})", printed(&found.path));
        match k {
            0 if found.is_scaled_to(frames) => {
                row("calibration", text + ": it is scaled to the frames' size")
            }
            0 => row("calibration", text),
            _ if size(k) == size(0) => row("another", format!("{text}: one is enough")),
            _ => row(
                "another",
                format!("{text}: the first fits the frames no worse"),
            ),
        }
    };
    found.calibrations.iter().enumerate().map(line).collect()
}

/// The initial and the true poses, then others.
fn poses(found: &Discovery) -> Vec<String> {
    if found.initial().is_none() {
        let text = "none found: tunnelstitch plan makes them from a plan, tunnelstitch gyro from a \
                    log of a gyro";
        let mut lines = vec![row("initial poses", text)];
        lines.extend(
            found
                .poses
                .iter()
                .map(|(path, _)| row("true poses", printed(path).to_string())),
        );
        return lines;
    }
    let is_same = |other: Option<&(PathBuf, _)>, path: &Path| other.is_some_and(|(p, _)| p == path);
    let (frames, _) = found.frames();
    let line = |(path, poses): &(PathBuf, PoseFile)| {
        let (format, count) = (poses.format, poses.entries.len());
        let text = format!("{} ({format:?}, {count} poses)", printed(path));
        if is_same(found.initial(), path) {
            row("initial poses", text)
        } else if is_same(found.truth(), path) {
            row("true poses", text)
        } else if count != frames {
            row("other poses", format!("{text}: there are {frames} frames"))
        } else {
            row("other poses", format!("{text}: one file is enough"))
        }
    };
    found.poses.iter().map(line).collect()
}

/// A found axis, in the unit of the poses.
fn axis(found: &FoundAxis) -> String {
    let path = &found.path;
    let [x, y, z] = found.axis.axis;
    row(
        "axis",
        format!(
            "{AXIS_FILE} ({x:.3} {y:.3} {z:.3}, the line through {} of {} cameras: {:.4} RMS and \
             {:.4} at most off it over a length of {:.4} units of the poses)",
            path.count, found.poses, path.rms_distance, path.max_distance, path.length
        ),
    )
}

/// The files that are no part of the survey.
fn left_aside(found: &Discovery) -> Vec<String> {
    let line = |aside: &LeftAside| {
        let pattern = printed(Path::new(&aside.pattern));
        let files = match aside.count {
            1 => pattern.to_string(),
            count => format!("{pattern} ({count})"),
        };
        row("left aside", format!("{files}: {}", aside.reason))
    };
    found.left_aside.iter().map(line).collect()
}
