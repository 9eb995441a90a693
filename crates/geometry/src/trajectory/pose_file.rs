//! Pose files in their own convention.

use super::detection::detect_format;
use super::entry_list::ParsedPoses;
use super::error::PoseError;
use super::format::PoseFormat;
use super::pose_conflict::PoseConflict;
use super::pose_entry::PoseEntry;
use super::pose_options::PoseFileOptions;
use super::stamped_pose::{StampedPose, Trajectory};
use super::{
    bundler, colmap, colmap_binary, csv, euroc, kitti, matrix_blocks, matrix_files, meshroom,
    metashape, nerfstudio, open3d, openmvg, opensfm, own_json, pix4d, realitycapture, record3d,
    recorded, text, tum,
};
use crate::recordings::is_recording;
use std::path::{Path, PathBuf};

/// A file of poses, in its own convention, with at least one pose. Times, if present, increase;
/// names, if present, differ.
#[derive(Clone, Debug)]
pub struct PoseFile {
    /// The path of the file.
    pub path: PathBuf,
    /// The format of the file.
    pub format: PoseFormat,
    /// The poses.
    pub entries: Vec<PoseEntry>,
    /// Poses that were left out because another has their time, and differs
    /// ([`DuplicateTimes::Merge`](super::DuplicateTimes::Merge)).
    pub conflicts: Vec<PoseConflict>,
}

impl PoseFile {
    /// The poses with their times, or with their indices in the file if it has no times.
    pub fn trajectory(&self) -> Trajectory {
        let stamped = |(index, entry): (usize, &PoseEntry)| StampedPose {
            time_s: entry.time_s.unwrap_or(index as f64),
            pose: entry.pose,
        };
        self.entries.iter().enumerate().map(stamped).collect()
    }

    /// The poses at times that are so many seconds later, if any.
    #[must_use]
    pub fn later(mut self, offset_s: Option<f64>) -> Self {
        let times = self.entries.iter_mut().flat_map(|entry| &mut entry.time_s);
        for time_s in times {
            *time_s += offset_s.unwrap_or_default();
        }
        self
    }

    /// True if all poses have names.
    pub fn has_names(&self) -> bool {
        self.entries.iter().all(|entry| entry.name.is_some())
    }

    /// True if all poses have times.
    pub fn has_times(&self) -> bool {
        self.entries.iter().all(|entry| entry.time_s.is_some())
    }
}

/// Reads a file of poses, in the given format or in the one detected from its content, as
/// [`read_poses_with`] does.
///
/// # Errors
/// [`PoseError`]: an unreadable file, an unknown format, a line that is no pose, times that do not
/// increase, two poses of one frame, no pose at all.
pub fn read_poses(path: &Path, format: Option<PoseFormat>) -> Result<PoseFile, PoseError> {
    let options = PoseFileOptions {
        format,
        ..PoseFileOptions::default()
    };
    read_poses_with(path, &options)
}

/// Reads a file of poses with options. A folder is a COLMAP model, or has a matrix in each of its
/// files; a file whose name ends in `.bin` is of a COLMAP model, too; a recording is one whose name
/// ends in `.mcap` or `.bag`.
///
/// # Errors
/// Those of [`read_poses`]; a column that `options` names and the file has not.
pub fn read_poses_with(path: &Path, options: &PoseFileOptions) -> Result<PoseFile, PoseError> {
    let model = path.is_dir().then(|| colmap_images(path));
    let has_matrices = options.format != Some(PoseFormat::Colmap)
        && model.as_ref().is_some_and(|images| !images.exists());
    let path = model.filter(|_| !has_matrices).unwrap_or(path.to_owned());
    let (format, parsed) = match options.format {
        None | Some(PoseFormat::Kitti) if has_matrices => {
            (PoseFormat::Kitti, matrix_files::read(&path)?.into())
        }
        None | Some(PoseFormat::Colmap) if colmap_binary::is_binary(&path) => {
            (PoseFormat::Colmap, colmap_binary::read(&path)?.into())
        }
        None | Some(PoseFormat::Recording) if is_recording(&path) => {
            let parsed = recorded::read(&path, &options.recorded)?;
            (PoseFormat::Recording, parsed)
        }
        _ => read_text(&path, options)?,
    };
    let ParsedPoses { entries, conflicts } = parsed;
    if entries.is_empty() {
        return Err(PoseError::no_poses(&path));
    }
    if let Some(k) = entries.iter().position(|entry| !entry.pose.is_finite()) {
        let what = format!("pose {}: its numbers are too large", k + 1);
        return Err(PoseError::file(&path, what));
    }
    Ok(PoseFile {
        path,
        format,
        entries,
        conflicts,
    })
}

/// The pose file in the folder of a COLMAP model: that of the text model, unless there is only the
/// binary one.
fn colmap_images(folder: &Path) -> PathBuf {
    let [text, binary] = [colmap::IMAGES_FILE, colmap_binary::IMAGES_FILE].map(|f| folder.join(f));
    if binary.exists() && !text.exists() {
        binary
    } else {
        text
    }
}

/// Reads a text of poses in the given format or in the one detected.
fn read_text(
    path: &Path,
    options: &PoseFileOptions,
) -> Result<(PoseFormat, ParsedPoses), PoseError> {
    let text = text::read(path)?;
    if matches!(options.format, None | Some(PoseFormat::Kitti))
        && let Some(entries) = open3d::parse(path, &text)?
    {
        return Ok((PoseFormat::Kitti, entries.into()));
    }
    let may_be_own = matches!(options.format, None | Some(PoseFormat::Json));
    if may_be_own && own_json::has_poses(path, &text) {
        return Ok((PoseFormat::Json, own_json::parse(path, &text, options)?));
    }
    let text = matrix_blocks::on_one_line(&text);
    let format = match options.format {
        Some(format) => format,
        None => detect_format(path, &text, options)?,
    };
    let duplicates = options.duplicate_times;
    let parsed = match format {
        PoseFormat::Tum => tum::parse(path, &text, options)?,
        PoseFormat::Kitti => kitti::parse(path, &text)?.into(),
        PoseFormat::Csv => csv::parse(path, &text, options)?,
        PoseFormat::Colmap => colmap::parse(path, &text)?.into(),
        PoseFormat::Nerfstudio => nerfstudio::parse(path, &text)?.into(),
        PoseFormat::Euroc => euroc::parse(path, &text, duplicates)?,
        PoseFormat::Opensfm => opensfm::parse(path, &text)?.into(),
        PoseFormat::Bundler => bundler::parse(path, &text)?.into(),
        PoseFormat::Meshroom => meshroom::parse(path, &text)?.into(),
        PoseFormat::Openmvg => openmvg::parse(path, &text)?.into(),
        PoseFormat::Metashape => metashape::parse(path, &text)?.into(),
        PoseFormat::Realitycapture => realitycapture::parse(path, &text)?.into(),
        PoseFormat::Pix4d => pix4d::parse(path, &text)?.into(),
        PoseFormat::Json => own_json::parse(path, &text, options)?,
        PoseFormat::Record3d => record3d::parse(path, &text, options)?,
        PoseFormat::Recording => {
            return Err(PoseError::file(
                path,
                "is no recording, whose name ends in .mcap or .bag",
            ));
        }
    };
    Ok((format, parsed))
}
