//! Search of a folder for the parts of a survey.

use super::file::SURVEY_FILE;
use super::straight_axis::FoundAxis;
use crate::frames::{FrameError, Video, open_picture};
use image::ImageDecoder;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::camera::{Camera, read_calibration};
use tunnelstitch_geometry::trajectory::{
    DuplicateTimes, PoseFile, PoseFileOptions, read_poses_with,
};

/// Levels of folders below the searched one.
const MAX_DEPTH: usize = 3;
/// Larger files are not tried as calibrations.
const MAX_CALIBRATION_BYTES: u64 = 4 << 20;
/// Larger files are not tried as poses.
const MAX_POSES_BYTES: u64 = 256 << 20;
/// Extensions of pictures.
const PICTURE_EXTENSIONS: [&str; 6] = ["jpg", "jpeg", "png", "tif", "tiff", "webp"];

/// Extensions of videos.
const VIDEO_EXTENSIONS: [&str; 7] = ["mp4", "mov", "m4v", "mkv", "avi", "webm", "mts"];

/// The pictures of one folder with one extension.
#[derive(Clone, Debug, PartialEq)]
pub struct PictureGroup {
    /// Glob pattern, relative to the searched folder.
    pub pattern: String,
    /// Number of pictures.
    pub count: usize,
    /// Width and height of the first picture, pixels, if readable.
    pub size: Option<(u32, u32)>,
}

/// A video whose pictures are the frames.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoChoice {
    /// The file, relative to the searched folder.
    pub path: PathBuf,
    /// Sampling interval of the frames, pictures.
    pub every: usize,
    /// Number of frames.
    pub count: usize,
    /// Width and height, pixels.
    pub size: (u32, u32),
}

/// The parts of a survey found in a folder; all paths are relative to the folder.
#[derive(Clone, Debug, Default)]
pub struct Discovery {
    /// A picture named `mask`.
    pub mask: Option<PathBuf>,
    /// The videos.
    pub videos: Vec<PathBuf>,
    /// The video of the frames, if one was chosen ([`Discovery::choose_video`]).
    pub video: Option<VideoChoice>,
    /// Groups of pictures, the largest first.
    pub pictures: Vec<PictureGroup>,
    /// Calibrations, those with the frames' size first.
    pub calibrations: Vec<(PathBuf, Camera)>,
    /// Pose files; first those with as many poses as frames, and among these first those not named
    /// as ground truth.
    pub poses: Vec<(PathBuf, PoseFile)>,
    /// Length of a unit of the initial poses, metres, if the user told it
    /// ([`Discovery::find_axis`]).
    pub unit_m: Option<f64>,
    /// The tunnel's axis in the world of the initial poses, if they show that it is not the
    /// world's y axis ([`Discovery::find_axis`]).
    pub axis: Option<FoundAxis>,
}

impl Discovery {
    /// Searches `folder` and three levels of folders below it, without hidden ones.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn of(folder: &Path) -> std::io::Result<Self> {
        let mut files = Vec::new();
        walk(folder, Path::new(""), MAX_DEPTH, &mut files)?;
        files.sort();
        let mut groups: BTreeMap<(PathBuf, String), Vec<&PathBuf>> = BTreeMap::new();
        let mut found = Self::default();
        // Poses with a time that is there twice are those to associate by time.
        let options = PoseFileOptions {
            duplicate_times: DuplicateTimes::Merge,
            ..PoseFileOptions::default()
        };
        for file in &files {
            let extension = file
                .extension()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            let lower = extension.to_lowercase();
            if PICTURE_EXTENSIONS.contains(&lower.as_str()) {
                if file
                    .file_stem()
                    .is_some_and(|stem| stem.eq_ignore_ascii_case("mask"))
                {
                    found.mask.get_or_insert_with(|| file.clone());
                    continue;
                }
                let parent = file.parent().unwrap_or(Path::new("")).to_owned();
                groups.entry((parent, extension)).or_default().push(file);
                continue;
            }
            if VIDEO_EXTENSIONS.contains(&lower.as_str()) {
                found.videos.push(file.clone());
                continue;
            }
            let path = folder.join(file);
            let bytes = path.metadata().map_or(0, |metadata| metadata.len());
            if file.ends_with(SURVEY_FILE) {
                continue;
            }
            if is_calibration(file, &lower)
                && bytes <= MAX_CALIBRATION_BYTES
                && let Ok(camera) = read_calibration(&path, None)
            {
                found.calibrations.push((file.clone(), camera));
            }
            if is_pose_file(file, &lower)
                && bytes <= MAX_POSES_BYTES
                && let Ok(poses) = read_poses_with(&path, &options)
            {
                found.poses.push((file.clone(), poses));
            }
        }
        found.pictures = groups
            .into_iter()
            .map(|((parent, extension), files)| PictureGroup {
                pattern: parent
                    .join(format!("*.{extension}"))
                    .to_string_lossy()
                    .replace('\\', "/"),
                count: files.len(),
                size: open_picture(&folder.join(files[0]))
                    .map(|decoder| decoder.dimensions())
                    .ok(),
            })
            .collect();
        found.sort();
        Ok(found)
    }

    /// Selects every `every`-th picture of a video as the frames; the path is relative to the
    /// searched `folder`.
    ///
    /// # Errors
    /// The errors of [`Video::open`].
    pub fn choose_video(
        &mut self,
        folder: &Path,
        path: &Path,
        every: usize,
    ) -> Result<(), FrameError> {
        let video = Video::open(&folder.join(path))?;
        self.video = Some(VideoChoice {
            path: path.to_owned(),
            every,
            count: video.pictures().div_ceil(every.max(1)),
            size: video.size(),
        });
        self.sort();
        Ok(())
    }

    /// Notes the length of a unit of the initial poses, metres, if it is known, and finds the axis
    /// of a straight tunnel of that radius, if it is known, for poses of structure from motion.
    pub fn find_axis(&mut self, unit_m: Option<f64>, radius_m: Option<f64>) {
        let initial = self.initial();
        self.axis = initial.and_then(|(_, poses)| FoundAxis::of(poses, unit_m, radius_m));
        self.unit_m = unit_m;
    }

    /// True if the initial poses are in a unit that neither their format nor the user tells.
    pub fn lacks_scale(&self) -> bool {
        let initial = self.initial();
        self.unit_m.is_none() && initial.is_some_and(|(_, poses)| poses.format.has_no_scale())
    }

    /// Number of frames, and their size if known, pixels.
    pub fn frames(&self) -> (usize, Option<(u32, u32)>) {
        let pictures = self.pictures.first();
        match &self.video {
            Some(video) => (video.count, Some(video.size)),
            None => pictures.map_or((0, None), |group| (group.count, group.size)),
        }
    }

    fn sort(&mut self) {
        self.pictures
            .sort_by_key(|group| std::cmp::Reverse(group.count));
        let (count, size) = self.frames();
        self.calibrations
            .sort_by_key(|(_, camera)| Some((camera.width, camera.height)) != size);
        self.poses.sort_by_key(|(path, poses)| {
            let other_count = poses.entries.len() != count;
            (
                other_count && !poses.has_times() && !poses.has_names(),
                is_truth(path),
                other_count,
            )
        });
    }

    /// The initial poses: the first file not named as ground truth.
    pub fn initial(&self) -> Option<&(PathBuf, PoseFile)> {
        self.poses.iter().find(|(path, _)| !is_truth(path))
    }

    /// The ground truth, if a file is named so.
    pub fn truth(&self) -> Option<&(PathBuf, PoseFile)> {
        self.poses.iter().find(|(path, _)| is_truth(path))
    }
}

/// True if a file may be a calibration, by its name; `extension` is in lower case.
fn is_calibration(file: &Path, extension: &str) -> bool {
    match extension {
        "json" | "toml" | "yaml" | "yml" | "txt" | "sfm" | "xml" => true,
        "bin" => file.ends_with("cameras.bin"),
        _ => false,
    }
}

/// True if a file may hold poses, by its name; `extension` is in lower case.
fn is_pose_file(file: &Path, extension: &str) -> bool {
    match extension {
        "txt" | "tum" | "csv" | "json" | "kitti" | "out" | "sfm" | "xml" => true,
        "bin" => file.ends_with("images.bin"),
        _ => false,
    }
}

/// True if a file's name denotes ground truth.
fn is_truth(path: &Path) -> bool {
    let name = path
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let words = ["truth", "groundtruth", "ground_truth", "ground-truth"];
    words.iter().any(|word| name.contains(word)) || name == "gt" || name.starts_with("gt_")
}

fn walk(root: &Path, inner: &Path, depth: usize, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    for entry in std::fs::read_dir(root.join(inner))? {
        let entry = entry?;
        let path = inner.join(entry.file_name());
        if entry.file_name().to_string_lossy().starts_with('.') {
            continue;
        }
        let kind = root.join(&path).metadata()?;
        if kind.is_file() {
            files.push(path);
        } else if kind.is_dir() && depth > 0 {
            // Unreadable folders are skipped.
            let _ = walk(root, &path, depth - 1, files);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_survey_is_found_part_by_part() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/blender_free48");
        let found = Discovery::of(&folder).unwrap();
        let group = &found.pictures[0];
        assert_eq!((group.pattern.as_str(), group.count), ("frames/*.jpg", 48));
        assert_eq!(group.size, Some((480, 360)));
        assert_eq!(found.calibrations[0].0, Path::new("camera.json"));
        assert_eq!(found.initial().unwrap().0, Path::new("baseline.tum"));
        assert_eq!(found.truth().unwrap().0, Path::new("groundtruth.tum"));
    }

    #[test]
    fn what_does_not_fit_the_pictures_comes_last() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
        std::fs::create_dir_all(dir.path().join("images/.hidden")).unwrap();
        for k in 0..3 {
            let picture = image::GrayImage::new(64, 48);
            picture
                .save(dir.path().join(format!("images/{k}.png")))
                .unwrap();
        }
        image::GrayImage::new(8, 8)
            .save(dir.path().join("images/.hidden/x.png"))
            .unwrap();
        write("a.txt", "1 PINHOLE 128 96 50 50 64 48\n");
        write("b.txt", "1 PINHOLE 64 48 50 50 32 24\n");
        write("few.txt", "1 0 0 0 0 0 0 0 1\n1 0 0 1 0 0 0 0 1\n");
        write("long.tum", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n");
        write(
            "right.tum",
            "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n",
        );
        image::GrayImage::new(64, 48)
            .save(dir.path().join("images/Mask.png"))
            .unwrap();
        write("notes.txt", "measured on a Monday\n");
        let found = Discovery::of(dir.path()).unwrap();
        assert_eq!(found.pictures.len(), 1);
        assert_eq!(found.pictures[0].pattern, "images/*.png");
        assert_eq!(found.pictures[0].count, 3);
        assert_eq!(found.mask.as_deref(), Some(Path::new("images/Mask.png")));
        assert_eq!(found.calibrations[0].0, Path::new("b.txt"));
        assert_eq!(found.initial().unwrap().0, Path::new("right.tum"));
        assert!(found.truth().is_none());
    }

    /// As many poses as frames are there only because one of two was left out.
    #[test]
    fn poses_that_contradict_each_other_are_associated_by_time() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["1.5.png", "2.5.png"] {
            let picture = image::GrayImage::new(64, 48);
            picture.save(dir.path().join(name)).unwrap();
        }
        let poses = "1.5 0 0 0 0 0 0 1\n2.5 0 0 0 0 0 0 1\n2.5 0 0.5 0 0 0 0 1\n";
        std::fs::write(dir.path().join("poses.tum"), poses).unwrap();
        let found = Discovery::of(dir.path()).unwrap();
        let text = found.survey_toml(Some(3.0));
        assert!(text.contains("\nassociate = \"time\""), "{text}");
    }
}
