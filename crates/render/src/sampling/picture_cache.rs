//! Frames of a survey, as many in memory as are needed.

use super::picture::Picture;
use super::pixel_format::PixelFormat;
use crate::error::RenderError;
use tunnelstitch_core::frames::{FrameFile, FrameSet, PyramidMask, colour_type, load_colour};
use tunnelstitch_core::progress::Progress;
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Cache of a survey's frames, all in one format, with the cameras that took them.
///
/// Frames are decoded by [`PictureCache::load`] and stay until there is no room. A frame that is
/// decoded again is identical.
#[derive(Clone, Debug)]
pub struct PictureCache {
    cameras: Cameras,
    format: PixelFormat,
    files: FrameSet,
    /// Width and height of the files' pictures.
    full_size: [u32; 2],
    level: usize,
    compressed: bool,
    pictures: Vec<Option<Picture>>,
}

/// Largest share of their pictures' bytes at which files count as compressed.
const MAX_COMPRESSED_SHARE: f64 = 0.9;

/// Halvings of frames of resolution `native_px_per_metre`, whose shorter side has `side` pixels,
/// before they are coarser than a canvas of `px_per_metre`: a canvas much coarser than the frames
/// would otherwise pick single pixels out of them.
pub fn level_for(side: u32, native_px_per_metre: f64, px_per_metre: f64) -> usize {
    let mut level = 0;
    while native_px_per_metre * 0.5f64.powi(level as i32 + 1) >= px_per_metre
        && side >> (level + 1) >= 16
    {
        level += 1;
    }
    level
}

impl PictureCache {
    /// Opens frames on disk, to be halved `level` times. None is decoded yet; their headers give
    /// the format: colour if any frame has colour, 16 bits if any has.
    ///
    /// # Errors
    /// A frame that is missing or is no picture; the first in the order of the files.
    pub fn open(
        files: &FrameSet,
        cameras: impl Into<Cameras>,
        level: usize,
    ) -> Result<Self, RenderError> {
        let cameras = cameras.into();
        let formats: Vec<Result<PixelFormat, RenderError>> =
            files.par_map(|file| Ok(PixelFormat::of(colour_type(file)?)));
        let mut format = PixelFormat {
            channels: 1,
            deep: false,
        };
        for found in formats {
            format = format.and(found?);
        }
        let mut cache = Self {
            full_size: cameras.size(),
            cameras: cameras.at_level(level),
            format,
            files: files.clone(),
            level,
            compressed: false,
            pictures: vec![None; files.len()],
        };
        cache.compressed = cache.has_compressed_files();
        Ok(cache)
    }

    fn has_compressed_files(&self) -> bool {
        let bytes = |file: &FrameFile| {
            if file.shared_file().is_some() {
                0
            } else {
                std::fs::metadata(&file.path).map_or(0, |file| file.len())
            }
        };
        let files: u64 = self.files.iter().map(bytes).sum();
        let pictures = self.full_frame_bytes() * self.len() as u64;
        files as f64 <= MAX_COMPRESSED_SHARE * pictures as f64
    }

    /// Wraps frames that are in memory already, with the cameras that took them.
    ///
    /// # Panics
    /// If a picture is not as large as the camera's.
    pub fn from_pictures(cameras: impl Into<Cameras>, pictures: Vec<Picture>) -> Self {
        let cameras = cameras.into();
        let mut format = PixelFormat {
            channels: 1,
            deep: false,
        };
        for picture in &pictures {
            let size = [picture.width() as u32, picture.height() as u32];
            assert_eq!(size, cameras.size(), "size of a frame");
            format = format.and(picture.format());
        }
        let widened = pictures.into_iter().map(|p| Some(p.widened(format)));
        Self {
            full_size: cameras.size(),
            cameras,
            format,
            files: FrameSet::default(),
            level: 0,
            compressed: false,
            pictures: widened.collect(),
        }
    }

    /// Decodes those of `frames` that are not in memory yet (in parallel). Others stay while all
    /// take no more than `room` bytes; those that come last in `later`, the frames in the order in
    /// which they are needed again, are evicted first.
    ///
    /// # Errors
    /// A frame that is missing, damaged or of another size than the calibration's; the first of
    /// them.
    pub fn load(
        &mut self,
        frames: &[usize],
        later: &[usize],
        room: u64,
    ) -> Result<(), RenderError> {
        let missing: Vec<usize> = frames
            .iter()
            .copied()
            .filter(|frame| self.pictures[*frame].is_none())
            .collect();
        self.evict(frames, later, room, missing.len());
        let decoded: Vec<Result<Picture, RenderError>> =
            missing.par_map(|frame| self.decode(*frame));
        for (frame, picture) in missing.iter().zip(decoded) {
            self.pictures[*frame] = Some(picture?);
        }
        Ok(())
    }

    fn evict(&mut self, frames: &[usize], later: &[usize], room: u64, coming: usize) {
        let most = (room / self.frame_bytes().max(1)) as usize;
        let mut keep = vec![false; self.pictures.len()];
        let held = self.pictures.iter().filter(|p| p.is_some()).count();
        let mut excess = (held + coming).saturating_sub(most);
        for frame in frames {
            keep[*frame] = true;
        }
        if excess == 0 {
            return;
        }
        // Those that are not needed any more, then those that are needed last.
        let mut needed = keep.clone();
        for frame in later {
            needed[*frame] = true;
        }
        let useless = (0..self.pictures.len()).filter(|frame| !needed[*frame]);
        for frame in useless.chain(later.iter().rev().copied()) {
            if excess > 0 && !keep[frame] && self.pictures[frame].take().is_some() {
                excess -= 1;
            }
        }
    }

    /// Decodes a frame without keeping it.
    ///
    /// # Errors
    /// As [`load_colour`].
    pub fn decode(&self, frame: usize) -> Result<Picture, RenderError> {
        if let Some(picture) = &self.pictures[frame] {
            return Ok(picture.clone());
        }
        let [width, height] = self.full_size;
        let decoded = load_colour(&self.files[frame], width, height)?;
        let mask = self.files.masks().of(frame).cloned().map(PyramidMask::new);
        let mut picture = Picture::from_decoded(decoded)
            .widened(self.format)
            .masked(mask);
        for _ in 0..self.level {
            picture = picture.halved();
        }
        Ok(picture)
    }

    /// Decodes all frames.
    ///
    /// # Errors
    /// As [`PictureCache::load`].
    pub fn load_all(&mut self, progress: &dyn Progress) -> Result<(), RenderError> {
        let all: Vec<usize> = (0..self.len()).collect();
        self.prefetch(&all, progress)
    }

    /// Decodes `frames`, before they are needed.
    ///
    /// # Errors
    /// As [`PictureCache::load`].
    pub fn prefetch(
        &mut self,
        frames: &[usize],
        progress: &dyn Progress,
    ) -> Result<(), RenderError> {
        progress.start("frames", frames.len());
        for chunk in frames.chunks(8 * rayon::current_num_threads().max(1)) {
            self.load(chunk, &[], u64::MAX)?;
            progress.advance(chunk.len());
        }
        progress.finish();
        Ok(())
    }

    /// Cameras of the pictures in memory (halved as they are).
    pub fn cameras(&self) -> &Cameras {
        &self.cameras
    }

    /// Picture of a frame, if it is in memory.
    pub fn picture(&self, frame: usize) -> Option<&Picture> {
        self.pictures[frame].as_ref()
    }

    /// Number of frames.
    pub fn len(&self) -> usize {
        self.pictures.len()
    }

    /// True without any frame.
    pub fn is_empty(&self) -> bool {
        self.pictures.is_empty()
    }

    /// True if files are smaller than their pictures, so that decoding a frame takes more time than
    /// reading it and keeping frames is worth the memory.
    pub fn is_compressed(&self) -> bool {
        self.compressed
    }

    /// Channels and depth of all frames.
    pub fn format(&self) -> PixelFormat {
        self.format
    }

    /// Memory of one frame at its file's size, bytes.
    pub fn full_frame_bytes(&self) -> u64 {
        let [width, height] = self.full_size.map(u64::from);
        width * height * self.format.pixel_bytes(false) as u64
    }

    /// Memory of one frame, bytes.
    pub fn frame_bytes(&self) -> u64 {
        let [width, height] = self.cameras.size().map(u64::from);
        width * height * self.format.pixel_bytes(false) as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::camera::Camera;

    #[test]
    fn frames_are_halved_only_for_coarse_canvases() {
        let camera = Camera::from_vertical_fov(640, 480, 1.0);
        for (px_per_metre, level) in [
            (150.0, 0),
            (101.0, 0),
            (99.0, 1),
            (51.0, 1),
            (50.0, 2),
            (0.1, 4),
        ] {
            assert_eq!(level_for(camera.shorter_side(), 200.0, px_per_metre), level);
        }
    }

    #[test]
    fn one_colour_frame_makes_all_colour() {
        let camera = Camera::from_vertical_fov(2, 2, 1.0);
        let grey = Picture::new(2, 2, 1, vec![7u8; 4]);
        let colour = Picture::new(2, 2, 3, vec![9u8; 12]);
        let cache = PictureCache::from_pictures(camera, vec![grey, colour]);
        assert_eq!(cache.format().channels, 3);
        assert_eq!(
            cache.picture(0),
            Some(&Picture::new(2, 2, 3, vec![7u8; 12]))
        );
    }

    #[test]
    fn what_is_needed_last_goes_first_and_comes_back_the_same() {
        let folder = tempfile::tempdir().unwrap();
        let files: Vec<FrameFile> = (0..4)
            .map(|index| {
                let path = folder.path().join(format!("{index}.png"));
                let grey = image::GrayImage::from_pixel(16, 16, image::Luma([index as u8]));
                grey.save(&path).unwrap();
                FrameFile::picture(index, path)
            })
            .collect();
        let camera = Camera::from_vertical_fov(16, 16, 1.0);
        let mut cache = PictureCache::open(&files.into(), camera, 0).unwrap();
        let held = |cache: &PictureCache| -> Vec<usize> {
            (0..4).filter(|k| cache.picture(*k).is_some()).collect()
        };
        let room = 3 * cache.frame_bytes();
        cache.load(&[0, 1, 2], &[3, 2, 0], room).unwrap();
        assert_eq!(held(&cache), [0, 1, 2]);
        // 1 is not needed any more, 2 sooner than 0.
        cache.load(&[3], &[2, 0], room).unwrap();
        assert_eq!(held(&cache), [0, 2, 3]);
        cache.load(&[1], &[3, 2, 0], room).unwrap();
        assert_eq!(held(&cache), [1, 2, 3]);
        let before = cache.picture(2).cloned();
        cache.load(&[0, 1, 3], &[], 0).unwrap();
        assert_eq!(held(&cache), [0, 1, 3]);
        assert_eq!(cache.decode(2).ok(), before);
    }

    #[test]
    fn files_as_large_as_their_pictures_are_not_packed() {
        let folder = tempfile::tempdir().unwrap();
        let camera = Camera::from_vertical_fov(64, 64, 1.0);
        for (name, compressed) in [("frame.png", true), ("frame.tif", false)] {
            let path = folder.path().join(name);
            image::GrayImage::new(64, 64).save(&path).unwrap();
            let files = vec![FrameFile::picture(0, path)].into();
            let cache = PictureCache::open(&files, camera, 0).unwrap();
            assert_eq!(cache.is_compressed(), compressed, "{name}");
        }
    }
}
