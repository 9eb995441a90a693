//! Pose files in their own convention.

use super::detection::detect_format;
use super::error::PoseError;
use super::format::PoseFormat;
use super::pose_entry::PoseEntry;
use super::stamped_pose::{StampedPose, Trajectory};
use super::{colmap, colmap_binary, csv, euroc, kitti, nerfstudio, text, tum};
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

    /// True if all poses have names.
    pub fn has_names(&self) -> bool {
        self.entries.iter().all(|entry| entry.name.is_some())
    }

    /// True if all poses have times.
    pub fn has_times(&self) -> bool {
        self.entries.iter().all(|entry| entry.time_s.is_some())
    }
}

/// Reads a file of poses, in the given format or in the one detected from its content. A folder is
/// a COLMAP model, and so is a file whose name ends in `.bin`.
///
/// # Errors
/// [`PoseError`]: an unreadable file, an unknown format, a line that is no pose, times that do not
/// increase, two poses of one frame, no pose at all.
pub fn read_poses(path: &Path, format: Option<PoseFormat>) -> Result<PoseFile, PoseError> {
    let path = if path.is_dir() {
        colmap_images(path)
    } else {
        path.to_owned()
    };
    let (format, entries) = match format {
        None | Some(PoseFormat::Colmap) if colmap_binary::is_binary(&path) => {
            (PoseFormat::Colmap, colmap_binary::read(&path)?)
        }
        format => read_text(&path, format)?,
    };
    if entries.is_empty() {
        return Err(PoseError::file(&path, "holds no poses"));
    }
    Ok(PoseFile {
        path,
        format,
        entries,
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
    format: Option<PoseFormat>,
) -> Result<(PoseFormat, Vec<PoseEntry>), PoseError> {
    let text = text::read(path)?;
    let format = match format {
        Some(format) => format,
        None => detect_format(path, &text)?,
    };
    let parse = match format {
        PoseFormat::Tum => tum::parse,
        PoseFormat::Kitti => kitti::parse,
        PoseFormat::Csv => csv::parse,
        PoseFormat::Colmap => colmap::parse,
        PoseFormat::Nerfstudio => nerfstudio::parse,
        PoseFormat::Euroc => euroc::parse,
    };
    Ok((format, parse(path, &text)?))
}
