//! Frames on demand, in bounded memory.

use super::{FrameError, FrameFile, Pyramid, Shading, load_grey};
use crate::camera::Pinhole;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

/// The grey pyramids of a survey's frames: decoded when first asked for, kept while there is room.
///
/// Results never depend on what happens to be kept: a frame that is decoded again is the same frame.
#[derive(Debug)]
pub struct FrameCache {
    source: Source,
    levels: usize,
    shading: RwLock<Option<Arc<Shading>>>,
    room: usize,
    shelf: Mutex<Shelf>,
}

#[derive(Debug)]
enum Source {
    Files(Vec<FrameFile>, Pinhole),
    Memory(Vec<Arc<Pyramid>>),
}

#[derive(Debug, Default)]
struct Shelf {
    kept: HashMap<usize, (u64, Arc<Pyramid>)>,
    clock: u64,
}

impl FrameCache {
    /// The frames `files` of `camera`, with `levels` pyramid levels each, in no more than `bytes` of memory (but
    /// always room for one).
    pub fn new(files: &[FrameFile], camera: &Pinhole, levels: usize, bytes: usize) -> Self {
        // Levels add a quarter, a sixteenth … to four bytes a pixel.
        let each = (camera.width as usize * camera.height as usize * 16 / 3).max(1);
        Self {
            source: Source::Files(files.to_vec(), *camera),
            levels,
            shading: RwLock::default(),
            room: (bytes / each).max(1),
            shelf: Mutex::default(),
        }
    }

    /// Frames that are in memory anyway, with whatever levels they have.
    pub fn of_pyramids(pyramids: Vec<Pyramid>) -> Self {
        Self {
            source: Source::Memory(pyramids.into_iter().map(Arc::new).collect()),
            levels: 1,
            shading: RwLock::default(),
            room: 1,
            shelf: Mutex::default(),
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        match &self.source {
            Source::Files(files, _) => files.len(),
            Source::Memory(pyramids) => pyramids.len(),
        }
    }

    /// The shading that frames are divided by.
    pub fn shading(&self) -> Option<Arc<Shading>> {
        let shading = self.shading.read();
        shading.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// From now on, frames are divided by `shading`. What was kept is dropped.
    pub fn set_shading(&self, shading: Shading) {
        let mut present = self.shading.write().unwrap_or_else(PoisonError::into_inner);
        *present = Some(Arc::new(shading));
        self.shelf().kept.clear();
    }

    /// A frame, divided by the shading; pixels without a value are NaN.
    ///
    /// # Errors
    /// As [`load_grey`].
    pub fn get(&self, frame: usize) -> Result<Arc<Pyramid>, FrameError> {
        let (files, camera) = match &self.source {
            Source::Files(files, camera) => (files, camera),
            Source::Memory(pyramids) => return Ok(Arc::clone(&pyramids[frame])),
        };
        {
            let mut shelf = self.shelf();
            shelf.clock += 1;
            let now = shelf.clock;
            if let Some((used, pyramid)) = shelf.kept.get_mut(&frame) {
                *used = now;
                return Ok(Arc::clone(pyramid));
            }
        }
        // Decoded without the lock; if two threads do the same frame at once, one result is dropped.
        let mut image = load_grey(&files[frame], camera.width, camera.height)?;
        if let Some(shading) = self.shading() {
            shading.divide(&mut image);
        }
        let pyramid = Arc::new(Pyramid::new(image, self.levels));
        let mut shelf = self.shelf();
        let now = shelf.clock;
        shelf.kept.insert(frame, (now, Arc::clone(&pyramid)));
        while shelf.kept.len() > self.room {
            let oldest = shelf.kept.iter().min_by_key(|(_, (used, _))| *used);
            let Some(oldest) = oldest.map(|(frame, _)| *frame) else {
                break;
            };
            shelf.kept.remove(&oldest);
        }
        Ok(pyramid)
    }

    fn shelf(&self) -> MutexGuard<'_, Shelf> {
        // A panic while the lock is held leaves a map that is still a map.
        self.shelf.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(folder: &std::path::Path) -> Vec<FrameFile> {
        (0..5u8)
            .map(|index| {
                let path = folder.join(format!("{index}.png"));
                let picture = image::GrayImage::from_pixel(32, 24, image::Luma([10 + index]));
                picture.save(&path).unwrap();
                FrameFile {
                    index: usize::from(index),
                    path,
                }
            })
            .collect()
    }

    #[test]
    fn no_more_is_kept_than_there_is_room_for() {
        let folder = tempfile::tempdir().unwrap();
        let camera = Pinhole::from_vertical_fov(32, 24, 1.0);
        let cache = FrameCache::new(&files(folder.path()), &camera, 2, 2 * 32 * 24 * 16 / 3);
        for frame in [0, 1, 2, 0, 3, 4, 0] {
            let pyramid = cache.get(frame).unwrap();
            assert_eq!(pyramid.level(0).at(3, 3), 10.0 + frame as f32);
            assert!(cache.shelf().kept.len() <= 2);
        }
        assert!(cache.shelf().kept.contains_key(&0));
    }

    #[test]
    fn a_frame_that_is_gone_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let camera = Pinhole::from_vertical_fov(32, 24, 1.0);
        let files = files(folder.path());
        std::fs::remove_file(&files[3].path).unwrap();
        let cache = FrameCache::new(&files, &camera, 1, 0);
        let error = cache.get(3).unwrap_err().to_string();
        assert!(error.contains("frame 3"), "{error}");
    }
}
