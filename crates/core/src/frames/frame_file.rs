//! Frames as files, as pictures of a video or a recording, or in memory.

use super::counter_overrun;
use super::error::FrameError;
use super::picture_reading::PictureReading;
use super::recorded_images::RecordedImages;
use super::tiff_stack;
use super::unmatched_pattern;
use super::unread_format::UnreadFormat;
use super::video::Video;
use alphanumeric_sort::compare_str;
use image::error::ImageFormatHint;
use image::{DynamicImage, ImageError};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tunnelstitch_geometry::files::{git_lfs_pointer, open_regular, printed};

/// Bytes of a file that tell a pointer of Git LFS.
const POINTER_BYTES: u64 = 64;

/// The place that a frame's pixels come from.
#[derive(Clone, Debug)]
pub(super) enum FrameSource {
    /// A file of its own, [`FrameFile::path`].
    File(PictureReading),
    /// A TIFF file, the place of the page's directory in it, and its reading.
    Page(Arc<Path>, u64, PictureReading),
    /// A video, and the index of the picture.
    Video(Arc<Video>, usize),
    /// A recording, the number of the image, and its reading.
    Recording(Arc<RecordedImages>, usize, PictureReading),
    /// A picture in memory.
    Memory(Arc<DynamicImage>),
}

/// A frame in a file of its own, on a page of a TIFF file, in a video, in a recording, or in
/// memory.
#[derive(Clone, Debug)]
pub struct FrameFile {
    /// Index of the frame in the survey.
    pub index: usize,
    /// Path of the picture, or the video's path followed by the picture's number:
    /// `survey.mp4/000012`; that of a TIFF file likewise by its page, `survey.tif/000012`; the
    /// recording's with the image's number, `survey.mcap#000012`; a name only, for a picture in
    /// memory.
    pub path: PathBuf,
    /// Its pixels.
    pub(super) source: FrameSource,
    /// The folder that its name begins in; its own if it is none of a rig.
    named_from: Option<Arc<Path>>,
}

impl FrameFile {
    /// A frame with a file of its own.
    pub fn picture(index: usize, path: PathBuf) -> Self {
        Self {
            index,
            path,
            source: FrameSource::File(PictureReading::default()),
            named_from: None,
        }
    }

    /// The frame with its picture file or recorded image read as given; no other frame changes.
    pub fn with_reading(mut self, reading: PictureReading) -> Self {
        if let FrameSource::File(own)
        | FrameSource::Page(_, _, own)
        | FrameSource::Recording(_, _, own) = &mut self.source
        {
            *own = reading;
        }
        self
    }

    /// The reading of its picture file or recorded image; None for other frames.
    pub fn reading(&self) -> Option<PictureReading> {
        match &self.source {
            FrameSource::File(reading)
            | FrameSource::Page(_, _, reading)
            | FrameSource::Recording(_, _, reading) => Some(*reading),
            FrameSource::Video(..) | FrameSource::Memory(_) => None,
        }
    }

    /// The pages of the frame's file, if it is a TIFF file with several as large as the first one;
    /// otherwise the frame itself.
    pub fn split_into_pages(self) -> Vec<Self> {
        let directories = if tiff_stack::is_tiff_name(&self.path) {
            tiff_stack::directories(&self.path)
        } else {
            Vec::new()
        };
        if directories.len() < 2 {
            return vec![self];
        }
        let stack: Arc<Path> = self.path.into();
        let reading = PictureReading::default();
        let page = |(page, directory): (usize, u64)| Self {
            index: page,
            path: stack.join(format!("{page:06}")),
            source: FrameSource::Page(Arc::clone(&stack), directory, reading),
            named_from: None,
        };
        directories.into_iter().enumerate().map(page).collect()
    }

    /// A picture of a video, numbered from 0.
    pub fn in_video(index: usize, video: &Arc<Video>, picture: usize) -> Self {
        Self {
            index,
            path: video.path().join(format!("{picture:06}")),
            source: FrameSource::Video(Arc::clone(video), picture),
            named_from: None,
        }
    }

    /// An image of a recording, numbered from 0.
    pub fn in_recording(index: usize, images: &Arc<RecordedImages>, image: usize) -> Self {
        let reading = PictureReading::default();
        Self {
            index,
            path: images.name(image),
            source: FrameSource::Recording(Arc::clone(images), image, reading),
            named_from: None,
        }
    }

    /// A picture in memory, grey or colour of 8 or 16 bits; messages call it by its index.
    pub fn in_memory(index: usize, picture: DynamicImage) -> Self {
        Self {
            index,
            path: PathBuf::from(format!("frame-{index:06}")),
            source: FrameSource::Memory(Arc::new(picture)),
            named_from: None,
        }
    }

    /// The file that contains the frame.
    pub fn file(&self) -> &Path {
        match &self.source {
            FrameSource::Video(video, _) => video.path(),
            FrameSource::Recording(images, ..) => images.path(),
            FrameSource::Page(stack, ..) => stack,
            FrameSource::File(_) | FrameSource::Memory(_) => &self.path,
        }
    }

    /// True if the frame is in a video.
    pub fn is_in_video(&self) -> bool {
        matches!(self.source, FrameSource::Video(..))
    }

    /// The file, if it contains other frames, too.
    pub fn shared_file(&self) -> Option<&Path> {
        match &self.source {
            FrameSource::Video(video, _) => Some(video.path()),
            FrameSource::Recording(images, ..) => Some(images.path()),
            FrameSource::Page(stack, ..) => Some(stack),
            FrameSource::File(_) | FrameSource::Memory(_) => None,
        }
    }

    /// The format of a picture file, if it is one that is not read.
    pub(super) fn unread_format(&self) -> Option<UnreadFormat> {
        match &self.source {
            FrameSource::File(_) | FrameSource::Page(..) => UnreadFormat::of(self.file()),
            _ => None,
        }
    }

    /// The error of a frame that cannot be decoded; of a format that is not read it names the
    /// conversion.
    pub(super) fn decode_error(&self, what: String) -> FrameError {
        if let Some(format) = self.unread_format() {
            let what = format!("{} is not read", format.name());
            return self.error(what, &format.remedy(self.file()), false);
        }
        match &self.source {
            FrameSource::File(_) | FrameSource::Page(..) => {
                self.error(what, "restore the file", true)
            }
            FrameSource::Recording(..) => self.error(what, "restore the recording", true),
            FrameSource::Video(..) => self.error(what, "restore the file", false),
            FrameSource::Memory(_) => self.error(what, "leave out the picture and its pose", false),
        }
    }

    /// The error of a picture file that the decoder refuses.
    pub(super) fn picture_error(&self, error: &ImageError) -> FrameError {
        let is_empty = std::fs::metadata(self.file())
            .is_ok_and(|metadata| metadata.is_file() && metadata.len() == 0);
        if let Some(pointer) = self.git_lfs_pointer() {
            return self.decode_error(format!("it {pointer}"));
        }
        match error {
            _ if is_empty => self.decode_error("the file is empty".to_owned()),
            ImageError::Unsupported(error) if error.format_hint() == ImageFormatHint::Unknown => {
                self.decode_error("it is no picture of a known format".to_owned())
            }
            ImageError::Unsupported(_) if self.unread_format().is_none() => {
                let remedy = "convert the frames to PNG of 8 or 16 bits";
                self.error(error.to_string(), remedy, true)
            }
            other => self.decode_error(other.to_string()),
        }
    }

    /// Says that a picture file is a pointer of Git LFS, if it is.
    fn git_lfs_pointer(&self) -> Option<&'static str> {
        let file = open_regular(self.file()).ok()?;
        let mut start = Vec::new();
        file.take(POINTER_BYTES).read_to_end(&mut start).ok()?;
        git_lfs_pointer(&start)
    }

    fn error(&self, what: String, remedy: &str, can_be_skipped: bool) -> FrameError {
        FrameError::Decode {
            index: self.index,
            path: self.path.clone(),
            what,
            remedy: remedy.to_owned(),
            can_be_skipped,
        }
    }

    /// The frame with another index.
    pub fn numbered(self, index: usize) -> Self {
        Self { index, ..self }
    }

    /// The frame with a name that begins in `folder`, so that it differs from those of other
    /// cameras.
    pub fn named_from(mut self, folder: &Arc<Path>) -> Self {
        self.named_from = Some(Arc::clone(folder));
        self
    }

    /// The file name of the picture; in a rig, with the folders in which those of its cameras are.
    pub fn name(&self) -> String {
        let folder = self.named_from.as_deref();
        let within = folder.and_then(|folder| self.path.strip_prefix(folder).ok());
        let own = || self.path.file_name().map(Path::new);
        let name = within.or_else(own).unwrap_or(Path::new(""));
        let separator = std::path::MAIN_SEPARATOR;
        name.to_string_lossy().replace(separator, "/")
    }
}

/// Finds a file or folder whose name is not UTF-8, but matches its part of `pattern`, relative to
/// `folder`: listing by patterns passes it over.
fn find_unreadable_name(folder: &Path, pattern: &str) -> Option<PathBuf> {
    let (part, rest) = pattern.split_once('/').unwrap_or((pattern, ""));
    if !part.contains(['*', '?', '[']) {
        return (!rest.is_empty())
            .then(|| find_unreadable_name(&folder.join(part), rest))
            .flatten();
    }
    let is_any_depth = part == "**";
    let matcher = glob::Pattern::new(if is_any_depth { "*" } else { part }).ok()?;
    for entry in std::fs::read_dir(folder).ok()?.flatten() {
        let name = entry.file_name();
        if !matcher.matches(&name.to_string_lossy()) {
            continue;
        }
        let (path, is_folder) = (entry.path(), entry.path().is_dir());
        let is_last = rest.is_empty();
        if name.to_str().is_none() && (is_last != is_folder) {
            return Some(path);
        }
        let inner = if is_any_depth { pattern } else { rest };
        if is_folder
            && !inner.is_empty()
            && let Some(found) = find_unreadable_name(&path, inner)
        {
            return Some(found);
        }
    }
    if is_any_depth && !rest.is_empty() {
        return find_unreadable_name(folder, rest);
    }
    None
}

/// True for a file whose name begins with a dot, such as those that macOS leaves beside others.
fn is_hidden(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default();
    name.as_encoded_bytes().starts_with(b".")
}

/// Lists the files that match `pattern` (glob syntax, relative to `folder`, a backslash taken for a
/// slash), in the natural order of their names (`frame2` before `frame10`), from the first if their
/// counter began anew after its last number (`f9999` before `f0001`), without the mask and without
/// hidden ones, whose names begin with a dot.
///
/// # Errors
/// A malformed pattern, an unreadable folder, no match.
pub fn list_frames(
    folder: &Path,
    pattern: &str,
    mask: Option<&Path>,
) -> Result<Vec<FrameFile>, FrameError> {
    let fail = |what: String| FrameError::Pattern {
        pattern: pattern.to_owned(),
        what,
    };
    let name = folder.to_str().ok_or_else(|| {
        fail(format!(
            "the folder {} has a name that is not UTF-8, by which frames cannot be listed; rename \
             it",
            printed(folder)
        ))
    })?;
    let escaped = glob::Pattern::escape(name);
    let pattern = &pattern.replace('\\', "/");
    let full = Path::new(&escaped).join(pattern);
    let found = glob::glob(&full.to_string_lossy()).map_err(|error| fail(error.to_string()))?;
    let mut paths = Vec::new();
    for path in found {
        let path = path.map_err(|error| fail(error.to_string()))?;
        if !path.is_dir() && Some(path.as_path()) != mask && !is_hidden(&path) {
            paths.push(path);
        }
    }
    if let Some(path) = find_unreadable_name(folder, pattern) {
        return Err(fail(format!(
            "the name of {} is not UTF-8; rename the file",
            printed(&path)
        )));
    }
    // Cameras number on, whatever the capitals; different names never count as equal.
    let lower = |path: &PathBuf| path.to_string_lossy().to_lowercase();
    let mut paths: Vec<(String, PathBuf)> =
        paths.into_iter().map(|path| (lower(&path), path)).collect();
    paths.sort_by(|a, b| compare_str(&a.0, &b.0).then_with(|| a.1.cmp(&b.1)));
    let names: Vec<&str> = paths.iter().map(|(name, _)| name.as_str()).collect();
    let first = counter_overrun::first_place(&names).unwrap_or(0);
    paths.rotate_left(first);
    if paths.is_empty() {
        return Err(FrameError::NoFrames {
            pattern: pattern.to_owned(),
            hint: unmatched_pattern::hint(folder, pattern),
        });
    }
    Ok(paths
        .into_iter()
        .enumerate()
        .map(|(index, (_, path))| FrameFile::picture(index, path))
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_listed_in_natural_order_without_hidden_files() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("frames")).unwrap();
        let files = [
            "f1.png", "f10.png", "f2.png", "f02.png", "._f1.png", "mask.png",
        ];
        for name in files {
            std::fs::write(dir.path().join("frames").join(name), "").unwrap();
        }
        let mask = dir.path().join("frames/mask.png");
        for pattern in ["frames/*.png", r"frames\*.png"] {
            let frames = list_frames(dir.path(), pattern, Some(&mask)).unwrap();
            let names: Vec<String> = frames.iter().map(FrameFile::name).collect();
            assert_eq!(names, ["f1.png", "f2.png", "f02.png", "f10.png"]);
            assert!(frames.iter().enumerate().all(|(k, frame)| frame.index == k));
        }
    }
}
