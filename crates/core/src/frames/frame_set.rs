//! The frames of a survey with their common mask.

use super::frame_file::FrameFile;
use super::mask::Mask;
use image::DynamicImage;
use std::ops::Deref;
use std::sync::Arc;

/// The frames of a survey, in order, and their common [`Mask`], if any.
#[derive(Clone, Debug, Default)]
pub struct FrameSet {
    files: Vec<FrameFile>,
    mask: Option<Arc<Mask>>,
}

impl FrameSet {
    /// Creates a set of frames with a common mask.
    pub fn new(files: Vec<FrameFile>, mask: Option<Mask>) -> Self {
        Self {
            files,
            mask: mask.map(Arc::new),
        }
    }

    /// Frames that are pictures in memory.
    pub fn in_memory(pictures: impl IntoIterator<Item = DynamicImage>) -> Self {
        let numbered = pictures.into_iter().enumerate();
        let files = numbered.map(|(index, picture)| FrameFile::in_memory(index, picture));
        Self::new(files.collect(), None)
    }

    /// The common mask.
    pub fn mask(&self) -> Option<&Arc<Mask>> {
        self.mask.as_ref()
    }

    /// Also hides the pixels of `mask`.
    pub fn hide(&mut self, mask: &Mask) {
        let united = match &self.mask {
            Some(own) => own.union(mask),
            None => mask.clone(),
        };
        self.mask = Some(Arc::new(united));
    }

    /// The frames of the given indices, renumbered.
    pub fn only(&self, indices: &[usize]) -> Self {
        let chosen = indices.iter().filter_map(|k| self.files.get(*k));
        let numbered = chosen.enumerate().map(|(index, file)| FrameFile {
            index,
            ..file.clone()
        });
        Self {
            files: numbered.collect(),
            mask: self.mask.clone(),
        }
    }

    /// The first `most` frames.
    pub fn first(&self, most: usize) -> Self {
        Self {
            files: self.files.iter().take(most).cloned().collect(),
            mask: self.mask.clone(),
        }
    }
}

impl From<Vec<FrameFile>> for FrameSet {
    fn from(files: Vec<FrameFile>) -> Self {
        Self::new(files, None)
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
