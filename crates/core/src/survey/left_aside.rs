//! Files of a folder that are no part of the survey found in it, with the reasons.

use super::refusal::{Refusal, SurveyPart};
use crate::frames::{RAW_EXTENSIONS, UnreadFormat};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::trajectory::read_tunnel_frame;

/// Extensions of pictures in formats that are not read.
const UNREAD_EXTENSIONS: [&str; 16] = [
    "bmp", "dib", "gif", "pgm", "ppm", "pnm", "pam", "pfm", "jp2", "jxl", "exr", "heic", "heif",
    "hif", "avif", "dng",
];
/// Extensions of archives.
const ARCHIVE_EXTENSIONS: [&str; 8] = ["zip", "7z", "rar", "tar", "gz", "tgz", "bz2", "xz"];
/// Extensions of files of measured points.
const POINT_EXTENSIONS: [&str; 3] = ["ply", "las", "laz"];

/// Files of COLMAP's models beside the cameras and the poses, without their extension.
const MODEL_FILES: [&str; 3] = ["points3D", "frames", "rigs"];

/// The beginnings of remedies and lists of what is known, which are left out of reasons.
const REMEDIES: [&str; 3] = [";", ", expected", ": neither of"];

/// A file that is no part of the survey, or several of one kind.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftAside {
    /// The path relative to the searched folder; of several files their pattern.
    pub pattern: String,
    /// Number of files.
    pub count: usize,
    /// The reason.
    pub reason: String,
    /// The parts of a survey that the file would hold, were it not faulty.
    #[serde(skip)]
    faulty: Vec<SurveyPart>,
}

/// The reason why a file is left aside.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct AsideReason {
    text: String,
    faulty: Vec<SurveyPart>,
}

impl<T: Into<String>> From<T> for AsideReason {
    fn from(text: T) -> Self {
        Self {
            text: text.into(),
            faulty: Vec::new(),
        }
    }
}

impl LeftAside {
    /// True for pictures in a format that is not read.
    pub fn is_unread_picture(&self) -> bool {
        is_unread(&self.extension())
    }

    /// True for archives, which may hold pictures.
    pub fn is_archive(&self) -> bool {
        ARCHIVE_EXTENSIONS.contains(&&*self.extension())
    }

    /// True for a file that was recognised as poses, but is faulty.
    pub fn is_faulty_pose_file(&self) -> bool {
        self.faulty.contains(&SurveyPart::Poses)
    }

    /// True for a file that was recognised as a calibration, but is faulty.
    pub fn is_faulty_calibration(&self) -> bool {
        self.faulty.contains(&SurveyPart::Calibration)
    }

    /// The extension in lower case.
    fn extension(&self) -> String {
        let extension = Path::new(&self.pattern).extension().unwrap_or_default();
        extension.to_string_lossy().to_lowercase()
    }

    /// Files with their reasons; those of one folder with the same extension and reason are one.
    pub(super) fn grouped(files: Vec<(PathBuf, AsideReason)>) -> Vec<Self> {
        let mut groups: BTreeMap<(PathBuf, String, AsideReason), Vec<PathBuf>> = BTreeMap::new();
        for (file, reason) in files {
            let folder = file.parent().unwrap_or(Path::new("")).to_owned();
            let extension = file.extension().unwrap_or_default();
            let extension = extension.to_string_lossy().into_owned();
            let group = groups.entry((folder, extension, reason)).or_default();
            group.push(file);
        }
        let group = |(key, files): ((PathBuf, String, AsideReason), Vec<PathBuf>)| {
            let (folder, extension, reason) = key;
            let pattern = match files.as_slice() {
                [file] => slashed(file),
                _ if extension.is_empty() => slashed(&folder.join("*")),
                _ => slashed(&folder.join(format!("*.{extension}"))),
            };
            Self {
                pattern,
                count: files.len(),
                reason: reason.text,
                faulty: reason.faulty,
            }
        };
        groups.into_iter().map(group).collect()
    }
}

/// True for the extension, in lower case, of pictures in a format that is not read.
fn is_unread(extension: &str) -> bool {
    UNREAD_EXTENSIONS.contains(&extension) || RAW_EXTENSIONS.contains(&extension)
}

/// The reason why a file is left aside that neither is a picture or a video nor was tried as
/// calibration or poses. `file` is relative to `folder`, `extension` in lower case.
pub(super) fn reason_by_name(folder: &Path, file: &Path, extension: &str) -> String {
    let path = folder.join(file);
    if is_unread(extension)
        && let Some(format) = UnreadFormat::of(&path)
    {
        return format!("{} is not read; {}", format.name(), format.remedy(&path));
    }
    if POINT_EXTENSIONS.contains(&extension) {
        let name = slashed(file);
        return format!("measured points: points = \"{name}\" under [tunnel] takes them");
    }
    if let Some(reason) = part_of_model(&path) {
        return reason;
    }
    match extension {
        "gcsv" => "a log of a gyro: tunnelstitch gyro makes poses of it".to_owned(),
        "db3" => "a recording of ROS 2 in SQLite: ros2 bag convert makes MCAP of it".to_owned(),
        _ if ARCHIVE_EXTENSIONS.contains(&extension) => {
            "an archive: unpack it, and run this again".to_owned()
        }
        "xlsx" | "xls" | "ods" | "numbers" => {
            "a workbook of a spreadsheet: save the sheet as CSV".to_owned()
        }
        "rtf" | "doc" | "docx" | "odt" | "pdf" => {
            "a document, not a table: save its text as .txt or .csv".to_owned()
        }
        "npy" | "npz" | "mat" | "pkl" | "h5" | "parquet" => {
            "arrays of another program: write them as text, as numpy.savetxt does".to_owned()
        }
        _ => "by its name no file of a survey".to_owned(),
    }
}

/// The reason why a file that was tried as calibration or poses is left aside; `refusals` are those
/// of both readers.
pub(super) fn reason_of_text(folder: &Path, file: &Path, refusals: &[Refusal]) -> AsideReason {
    let path = folder.join(file);
    if read_tunnel_frame(&path).is_ok() {
        let name = slashed(file);
        let text =
            format!("a frame of reference: tunnel_frame = \"{name}\" under [poses] takes it");
        return text.into();
    }
    if let Some(reason) = part_of_model(&path) {
        return reason.into();
    }
    let own = printed(&path).to_string();
    let shortened = |refusal: &Refusal| {
        let text = refusal.what.replace(&format!("{own}: "), "");
        let text = text.replace(&format!("{own}:"), "line ");
        let end = REMEDIES.iter().filter_map(|mark| text.find(mark)).min();
        text[..end.unwrap_or(text.len())].to_owned()
    };
    let texts: Vec<String> = refusals.iter().map(shortened).collect();
    let faulty = refusals.iter().filter(|refusal| refusal.is_faulty);
    AsideReason {
        text: texts.join("; "),
        faulty: faulty.map(|refusal| refusal.part).collect(),
    }
}

/// The reason why a file of a COLMAP model is left aside, if it is one beside its cameras.
fn part_of_model(path: &Path) -> Option<String> {
    let stem = path.file_stem()?.to_str()?;
    let cameras = path
        .with_file_name("cameras")
        .with_extension(path.extension()?);
    let is_part = MODEL_FILES.contains(&stem) && cameras.is_file();
    is_part.then(|| "a part of COLMAP's model that is not needed".to_owned())
}

/// A relative path with slashes.
fn slashed(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_one_kind_and_reason_are_one() {
        let file = |path: &str, reason: &str| (PathBuf::from(path), AsideReason::from(reason));
        let files = vec![
            file("d/2.npy", "a"),
            file("d/1.npy", "a"),
            file("d/3.npy", "b"),
            file("4.npy", "a"),
            file("README", "a"),
            file("LICENSE", "a"),
        ];
        let grouped = LeftAside::grouped(files);
        let lines: Vec<(&str, usize)> = (grouped.iter())
            .map(|group| (group.pattern.as_str(), group.count))
            .collect();
        let expected = [("*", 2), ("4.npy", 1), ("d/*.npy", 2), ("d/3.npy", 1)];
        assert_eq!(lines, expected);
    }
}
