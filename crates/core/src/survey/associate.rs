//! Association of poses with frames.

use super::error::SurveyError;
use super::frame_times::from_pictures;
use super::skipped_frame::SkippedFrame;
use super::strangers::strangers_among;
use crate::frames::FrameFile;
use percent_encoding::percent_decode_str;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::ffi::OsStr;
use std::path::Path;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::trajectory::{PoseEntry, PoseFile, StampedPose, Trajectory, se3};
use unicode_normalization::UnicodeNormalization;

/// The criterion by which poses are associated with frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Associate {
    /// By order: the first pose belongs to the first frame and so on, with as many poses as frames.
    Order,
    /// By the frame's name in the file of poses.
    Name,
    /// By the frame's time.
    Time,
}

/// Default tolerance between the times of a frame and its pose, seconds; the default of `evo`.
pub const TIME_TOLERANCE_S: f64 = 0.01;

/// Extensions of pictures that names in pose files may have where the frames have another.
const PICTURE_EXTENSIONS: [&str; 15] = [
    "jpg", "jpeg", "png", "tif", "tiff", "webp", "bmp", "pgm", "ppm", "heic", "heif", "dng", "cr2",
    "nef", "arw",
];

/// Parameters of the association by time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TimeAssociation {
    /// Largest difference between the times of a frame and its pose, seconds.
    pub tolerance_s: f64,
    /// True to interpolate between the two neighbouring poses.
    pub interpolate: bool,
}

/// Associates poses by order, in the convention of the file. The times are the file's, else the
/// frames', else the indices. A file with poses of the `skipped` frames, too, is one of all frames.
///
/// # Errors
/// Different numbers of poses and frames.
pub(super) fn by_order(
    file: &PoseFile,
    frames: &[FrameFile],
    skipped: &[SkippedFrame],
    times_s: Option<&[f64]>,
) -> Result<Trajectory, SurveyError> {
    let is_of_all = file.entries.len() == frames.len() + skipped.len();
    let is_skipped = |k: usize| is_of_all && skipped.iter().any(|frame| frame.index == k);
    let entries = file.entries.iter().enumerate();
    let entries: Vec<&PoseEntry> = entries
        .filter_map(|(k, entry)| (!is_skipped(k)).then_some(entry))
        .collect();
    if entries.len() != frames.len() {
        return Err(SurveyError::Count {
            path: file.path.clone(),
            poses: file.entries.len(),
            frames: frames.len(),
            remedy: count_remedy(file, frames, times_s),
        });
    }
    Ok(entries
        .into_iter()
        .enumerate()
        .map(|(k, entry)| stamped(entry, k, times_s))
        .collect())
}

/// Associates the poses that a file has yet with frames by their indices, in the convention of the
/// file.
pub(super) fn present_by_order(file: &PoseFile, frames: &[FrameFile]) -> Vec<Option<StampedPose>> {
    let entry = |frame: &FrameFile| file.entries.get(frame.index);
    let pose = |frame: &FrameFile| entry(frame).map(|entry| stamped(entry, frame.index, None));
    frames.iter().map(pose).collect()
}

/// The remedy for other numbers of poses and frames: to move away pictures that are no frames, or
/// another association.
fn count_remedy(file: &PoseFile, frames: &[FrameFile], times_s: Option<&[f64]>) -> String {
    let strangers = (frames.len() > file.entries.len()).then(|| strangers_among(frames));
    if let Some(Some(strangers)) = strangers {
        return format!("; {strangers}");
    }
    let has_times = || times_s.is_some() || from_pictures(frames, None).is_ok();
    let other = if file.has_names() {
        "; or associate them by name (--associate name)"
    } else if file.has_times() && has_times() {
        "; or associate them by time (--associate time)"
    } else if file.has_times() {
        "; or associate them by time (--associate time), with a list of the frames' times \
         (--frame-times FILE)"
    } else {
        ""
    };
    other.to_owned()
}

/// Associates poses by name: the name in the file of poses must equal the frame's path or its end.
/// Where none does, its extension may be missing, then capitals may differ, then its extension may
/// be that of another format of pictures, since frames are converted. Backslashes are slashes, and
/// signs that one of the two has percent-encoded (`%20`) are those that they stand for. Poses of
/// other files are ignored, and frames without a pose have none.
///
/// # Errors
/// A file without names; a frame with several poses.
pub(super) fn by_name(
    file: &PoseFile,
    frames: &[FrameFile],
    times_s: Option<&[f64]>,
) -> Result<Vec<Option<StampedPose>>, SurveyError> {
    let fail = |what: String| SurveyError::Association {
        path: file.path.clone(),
        what,
    };
    if !file.has_names() {
        return Err(fail(
            "has no names of frames; associate its poses by --associate order or time".to_owned(),
        ));
    }
    let named = PosesByName::of(file);
    let of_frame = |frame: &FrameFile| {
        let entry = match named.of_frame(frame) {
            [] => return Ok(None),
            [(_, only)] => Ok(*only),
            // Several folders contain files of that name: compare the path's components.
            several => {
                let without_extension = frame.path.with_extension("");
                let is_end = |path: &str| {
                    let path = relative(Path::new(path));
                    frame.path.ends_with(path) || without_extension.ends_with(path)
                };
                let mut fitting = several.iter().filter(|(path, _)| is_end(path));
                match (fitting.next(), fitting.next()) {
                    (Some((_, only)), None) => Ok(*only),
                    _ => Err(fail(format!(
                        "{} poses could be those of frame {} ({}); names in the file must end the \
                         frames' paths",
                        several.len(),
                        frame.index,
                        printed(&frame.path)
                    ))),
                }
            }
        }?;
        Ok(Some(stamped(entry, frame.index, times_s)))
    };
    frames.iter().map(of_frame).collect()
}

/// A pose with its name, in which slashes separate.
type NamedPose<'a> = (String, &'a PoseEntry);

/// The poses of a file by the names of their frames.
struct PosesByName<'a> {
    /// By the last component of the name.
    exact: HashMap<String, Vec<NamedPose<'a>>>,
    /// By that in lower case.
    lower: HashMap<String, Vec<NamedPose<'a>>>,
    /// By that without the extension of a picture.
    stem: HashMap<String, Vec<NamedPose<'a>>>,
}

impl<'a> PosesByName<'a> {
    fn of(file: &'a PoseFile) -> Self {
        let mut poses = Self {
            exact: HashMap::new(),
            lower: HashMap::new(),
            stem: HashMap::new(),
        };
        for entry in &file.entries {
            let name = decoded(entry.name.as_deref().unwrap_or_default()).replace('\\', "/");
            let base = name.rsplit('/').next().unwrap_or_default().to_owned();
            let lower = base.to_lowercase();
            let add = |poses: &mut HashMap<String, Vec<NamedPose<'a>>>, key: String| {
                poses.entry(key).or_default().push((name.clone(), entry));
            };
            if let Some((stem, extension)) = lower.rsplit_once('.')
                && PICTURE_EXTENSIONS.contains(&extension)
            {
                add(&mut poses.stem, stem.to_owned());
            }
            add(&mut poses.exact, base);
            add(&mut poses.lower, lower);
        }
        poses
    }

    /// The poses whose names are most like that of a frame.
    fn of_frame(&self, frame: &FrameFile) -> &[NamedPose<'a>] {
        let text = |part: Option<&OsStr>| decoded(&part.unwrap_or_default().to_string_lossy());
        let (name, stem) = (text(frame.path.file_name()), text(frame.path.file_stem()));
        let found = (self.exact.get(&name))
            .or_else(|| self.exact.get(&stem))
            .or_else(|| self.lower.get(&name.to_lowercase()))
            .or_else(|| self.lower.get(&stem.to_lowercase()))
            .or_else(|| self.stem.get(&stem.to_lowercase()));
        found.map_or(&[], Vec::as_slice)
    }
}

/// A name without percent-encoding (`frame%2001.png`), as addresses have it, and with its accents
/// in the letters, which macOS writes as signs of their own in some names of files.
fn decoded(name: &str) -> String {
    let plain = percent_decode_str(name).decode_utf8();
    plain.as_deref().unwrap_or(name).nfc().collect()
}

/// A path without its root and `.` components.
fn relative(path: &Path) -> &Path {
    path.strip_prefix("./").unwrap_or(path)
}

fn stamped(entry: &PoseEntry, frame: usize, times_s: Option<&[f64]>) -> StampedPose {
    let own = times_s.and_then(|times_s| times_s.get(frame).copied());
    StampedPose {
        time_s: entry.time_s.or(own).unwrap_or(frame as f64),
        pose: entry.pose,
    }
}

/// Associates poses by time: the nearest pose, or the interpolation between its neighbours
/// ([`se3::between`]). There is no extrapolation beyond the first and the last pose.
///
/// # Errors
/// A file without times; a frame whose nearest pose is farther than the tolerance; with
/// interpolation, a frame before the first pose or after the last, or between two poses whose
/// rotations differ too much.
pub(super) fn by_time(
    file: &PoseFile,
    frames: &[FrameFile],
    times_s: &[f64],
    how: TimeAssociation,
) -> Result<Trajectory, SurveyError> {
    let fail = |what: String| SurveyError::Association {
        path: file.path.clone(),
        what,
    };
    if !file.has_times() {
        return Err(fail(
            "has no times; associate its poses by --associate order or name".to_owned(),
        ));
    }
    let all = file.trajectory();
    let of_frame = |(frame, &time_s): (&FrameFile, &f64)| {
        let fail = |what: String| {
            fail(format!(
                "frame {} ({}) at {time_s} s: {what}",
                frame.index,
                printed(&frame.path)
            ))
        };
        let after = all.partition_point(|stamped| stamped.time_s < time_s);
        let (next, last) = (
            all.get(after),
            after.checked_sub(1).and_then(|k| all.get(k)),
        );
        let off = |stamped: &StampedPose| (stamped.time_s - time_s).abs();
        let nearest = match (last, next) {
            (Some(last), Some(next)) if off(last) <= off(next) => last,
            (_, Some(next)) => next,
            (Some(last), None) => last,
            (None, None) => return Err(fail("there is no pose at all".to_owned())),
        };
        if off(nearest) > how.tolerance_s {
            return Err(fail(format!(
                "the nearest pose is at {} s, {:.6} s away, more than the tolerance of {} s \
                 (--time-tolerance-s)",
                nearest.time_s,
                off(nearest),
                how.tolerance_s
            )));
        }
        let pose = match (how.interpolate && nearest.time_s != time_s, last, next) {
            (false, ..) => nearest.pose,
            (true, Some(last), Some(next)) => {
                let share = (time_s - last.time_s) / (next.time_s - last.time_s);
                se3::between(&last.pose, &next.pose, share).ok_or_else(|| {
                    fail(format!(
                        "the poses at {} s and {} s are turned too far from each other to find \
                         the way between them",
                        last.time_s, next.time_s
                    ))
                })?
            }
            (true, ..) => {
                return Err(fail(format!(
                    "lies beyond the poses, the nearest of which is at {} s, and nothing is \
                     extrapolated",
                    nearest.time_s
                )));
            }
        };
        Ok(StampedPose { time_s, pose })
    };
    frames.iter().zip(times_s).map(of_frame).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::{PoseFormat, spiral};

    fn frames(paths: &[&str]) -> Vec<FrameFile> {
        let frame = |(index, path): (usize, &&str)| FrameFile::picture(index, path.into());
        paths.iter().enumerate().map(frame).collect()
    }

    /// Poses k of a spiral at the times 10 + k, with these names.
    fn file(names: &[&str]) -> PoseFile {
        let poses = spiral(names.len(), 0.1, 0.5);
        let entry = |(k, name): (usize, &&str)| PoseEntry {
            camera: None,
            name: Some((*name).to_owned()),
            time_s: Some(10.0 + k as f64),
            pose: poses[k],
        };
        PoseFile {
            path: "poses.csv".into(),
            format: PoseFormat::Csv,
            entries: names.iter().enumerate().map(entry).collect(),
            conflicts: Vec::new(),
        }
    }

    #[test]
    fn names_find_their_poses_in_any_order() {
        let file = file(&["left/b.png", "./a.png", "right/b.png", "c.png"]);
        let found = by_name(&file, &frames(&["s/a.png", "s/right/b.png"]), None).unwrap();
        let times_s = |found: &[Option<StampedPose>]| -> Vec<Option<f64>> {
            found
                .iter()
                .map(|pose| Some(pose.as_ref()?.time_s))
                .collect()
        };
        assert_eq!(times_s(&found), [Some(11.0), Some(12.0)]);
        let found = by_name(&file, &frames(&["s/d.png", "s/c.png"]), None).unwrap();
        assert_eq!(times_s(&found), [None, Some(13.0)]);
        let message = by_name(&file, &frames(&["s/b.png"]), None)
            .unwrap_err()
            .to_string();
        assert!(message.contains("2 poses could be"), "{message}");
    }

    #[test]
    fn names_may_lack_their_extension() {
        let file = file(&["./left/b", "right/b", "c.1", "d.png", "d"]);
        let frames = frames(&["s/right/b.png", "s/c.1.png", "s/d.png", "s/e.png"]);
        let found = by_name(&file, &frames, None).unwrap();
        let times_s: Vec<_> = found
            .iter()
            .map(|pose| Some(pose.as_ref()?.time_s))
            .collect();
        assert_eq!(times_s, [Some(11.0), Some(12.0), Some(13.0), None]);
    }

    /// Names of other systems, and those of frames before they were converted.
    #[test]
    fn names_may_differ_in_capitals_slashes_and_format() {
        let found = |names: &[&str], path: &str| {
            let found = by_name(&file(names), &frames(&[path]), None);
            found.map(|poses| poses[0].map(|pose| pose.time_s))
        };
        let names = [
            r"C:\Survey\IMG_1.JPG",
            r"C:\Survey\IMG_2.JPG",
            "1.25",
            "2.5",
        ];
        for (path, expected) in [
            ("s/IMG_1.JPG", Some(10.0)),
            ("s/img_2.jpg", Some(11.0)),
            ("s/IMG_2.png", Some(11.0)),
            ("s/1.25.png", Some(12.0)),
            ("s/2.png", None),
        ] {
            assert_eq!(found(&names, path).unwrap(), expected, "{path}");
        }
        let addresses = ["file:///s/a%20b.png", "s%2Fcaf%C3%A9.png", "100%.png"];
        for (path, expected) in [
            ("s/a b.png", Some(10.0)),
            ("s/a%20b.png", Some(10.0)),
            ("s/café.png", Some(11.0)),
            ("s/100%.png", Some(12.0)),
        ] {
            assert_eq!(found(&addresses, path).unwrap(), expected, "{path}");
        }
        // The most alike name counts, and where there are several, none.
        assert_eq!(found(&["A.png", "a.png"], "a.png").unwrap(), Some(11.0));
        let error = found(&["a.jpg", "a.tif"], "a.png").unwrap_err().to_string();
        assert!(error.contains("2 poses could be"), "{error}");
    }

    #[test]
    fn times_find_the_nearest_or_the_way_between() {
        let file = file(&["", "", ""]);
        let how = |interpolate| TimeAssociation {
            tolerance_s: 0.5,
            interpolate,
        };
        let two = frames(&["a", "b"]);
        let nearest = by_time(&file, &two, &[9.75, 11.25], how(false)).unwrap();
        assert_eq!(nearest[0].pose, file.entries[0].pose);
        assert_eq!(
            (nearest[1].time_s, nearest[1].pose),
            (11.25, file.entries[1].pose)
        );
        let between = by_time(&file, &two, &[10.0, 11.25], how(true)).unwrap();
        assert_eq!(between[0].pose, file.entries[0].pose);
        let expected = spiral(10, 0.025, 0.125)[5];
        assert!(between[1].pose.local(&expected).norm() < 1e-12);
        for (times_s, interpolate, expected) in [
            (
                [10.0, 12.75],
                false,
                ["frame 1 (b) at 12.75 s", "nearest pose is at 12 s, 0.75"],
            ),
            (
                [10.0, 12.25],
                true,
                ["frame 1 (b) at 12.25 s", "nothing is extrapolated"],
            ),
            (
                [9.9, 11.0],
                true,
                ["frame 0 (a) at 9.9 s", "nearest of which is at 10 s"],
            ),
        ] {
            let message = by_time(&file, &two, &times_s, how(interpolate))
                .unwrap_err()
                .to_string();
            assert!(
                expected.iter().all(|part| message.contains(part)),
                "{message}"
            );
        }
    }

    #[test]
    fn the_order_wants_as_many() {
        let message = by_order(&file(&["a", "b"]), &frames(&["a"]), &[], None)
            .unwrap_err()
            .to_string();
        assert!(
            message.contains("2 poses for 1 frames") && message.contains("--associate name"),
            "{message}"
        );
    }

    #[test]
    fn the_poses_of_skipped_frames_are_passed_over() {
        let skipped = [SkippedFrame {
            index: 1,
            file: "b".to_owned(),
            reason: String::new(),
        }];
        let two = frames(&["a", "c"]);
        let times_s = |names: &[&str]| -> Vec<f64> {
            let found = by_order(&file(names), &two, &skipped, None).unwrap();
            found.iter().map(|stamped| stamped.time_s).collect()
        };
        assert_eq!(times_s(&["", "", ""]), [10.0, 12.0]);
        assert_eq!(times_s(&["", ""]), [10.0, 11.0]);
    }
}
