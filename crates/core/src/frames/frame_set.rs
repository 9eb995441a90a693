//! The frames of a survey with their masks.

use super::frame_file::FrameFile;
use super::mask::Mask;
use super::masks::Masks;
use image::DynamicImage;
use std::ops::Deref;

/// The frames of a survey, in order, and their [`Masks`], if any.
#[derive(Clone, Debug, Default)]
pub struct FrameSet {
    files: Vec<FrameFile>,
    masks: Masks,
}

impl FrameSet {
    /// Creates a set of frames with a common mask, or with those of their cameras.
    pub fn new(files: Vec<FrameFile>, masks: impl Into<Masks>) -> Self {
        Self {
            files,
            masks: masks.into(),
        }
    }

    /// Frames that are pictures in memory.
    pub fn in_memory(pictures: impl IntoIterator<Item = DynamicImage>) -> Self {
        let numbered = pictures.into_iter().enumerate();
        let files = numbered.map(|(index, picture)| FrameFile::in_memory(index, picture));
        Self::new(files.collect(), Masks::NONE)
    }

    /// Adds a frame at the end, numbered by its place.
    pub fn push(&mut self, file: FrameFile) {
        let index = self.files.len();
        self.files.push(file.numbered(index));
    }

    /// The masks.
    pub fn masks(&self) -> &Masks {
        &self.masks
    }

    /// Also hides the pixels of `mask` in all frames.
    pub fn hide(&mut self, mask: &Mask) {
        self.masks.hide(mask);
    }

    /// The frames of the given indices, renumbered.
    pub fn only(&self, indices: &[usize]) -> Self {
        let chosen = indices.iter().filter_map(|k| self.files.get(*k));
        let numbered = chosen.enumerate();
        let numbered = numbered.map(|(index, file)| file.clone().numbered(index));
        Self {
            files: numbered.collect(),
            masks: self.masks.of_frames(indices),
        }
    }

    /// The first `most` frames.
    pub fn first(&self, most: usize) -> Self {
        Self {
            files: self.files.iter().take(most).cloned().collect(),
            masks: self.masks.clone(),
        }
    }
}

impl From<Vec<FrameFile>> for FrameSet {
    fn from(files: Vec<FrameFile>) -> Self {
        Self::new(files, Masks::NONE)
    }
}

impl<'a> IntoIterator for &'a FrameSet {
    type Item = &'a FrameFile;
    type IntoIter = std::slice::Iter<'a, FrameFile>;

    fn into_iter(self) -> Self::IntoIter {
        self.files.iter()
    }
}

impl Deref for FrameSet {
    type Target = [FrameFile];

    fn deref(&self) -> &[FrameFile] {
        &self.files
    }
}
