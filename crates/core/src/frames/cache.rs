//! A cache of decoded frames with bounded memory.

use super::error::FrameError;
use super::frame_file::FrameFile;
use super::frame_set::FrameSet;
use super::grey::GreyImage;
use super::light::{CameraLight, Light};
use super::local_normalisation::normalise_locally;
use super::masks::Masks;
use super::pyramid::Pyramid;
use super::stored_frame::StoredFrame;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

/// Fraction of the memory used for pyramids if not all of them fit; the rest holds stored frames.
const PYRAMID_MEMORY_FRACTION: f64 = 0.25;
/// Bytes of a pyramid per pixel: four, a third more for the coarser levels, and the contrast of one
/// level.
const PYRAMID_BYTES_PER_PIXEL: f64 = 6.0;

/// A cache of the grey pyramids of a survey's frames, decoded on demand.
///
/// If not all pyramids fit, the most recently used ones are kept, and as many other frames as fit
/// in the form of [`StoredFrame`], from which a pyramid is quickly built. The set of stored frames
/// does not change until it is released: a survey is processed from end to end repeatedly, so that
/// the least recently used frame is needed next.
///
/// Results do not depend on the state of the cache: decoding is deterministic.
#[derive(Debug)]
pub struct FrameCache {
    source: Source,
    levels: usize,
    light: RwLock<Light>,
    /// Largest number of pyramids.
    room: usize,
    shelf: Mutex<RecentPyramids>,
    stored: Mutex<StoredFrames>,
}

#[derive(Debug)]
enum Source {
    /// With width and height of the pictures, pixels.
    Files(FrameSet, [u32; 2]),
    Memory(Vec<Arc<Pyramid>>, Masks),
}

/// The most recently used pyramids.
#[derive(Debug, Default)]
struct RecentPyramids {
    kept: HashMap<usize, (u64, Arc<Pyramid>)>,
    clock: u64,
}

/// Frames in the form of their files.
#[derive(Debug, Default)]
struct StoredFrames {
    kept: HashMap<usize, Arc<StoredFrame>>,
    /// Remaining memory, bytes.
    room: usize,
}

impl FrameCache {
    /// Creates a cache of the `frames`, pictures of `size` (width and height, pixels), with
    /// `levels` pyramid levels each, in at most `bytes` of memory, but at least one pyramid.
    pub fn new(frames: &FrameSet, size: [u32; 2], levels: usize, bytes: usize) -> Self {
        let pixels = f64::from(size[0]) * f64::from(size[1]);
        let pyramids =
            |share: f64| (share * bytes as f64 / (PYRAMID_BYTES_PER_PIXEL * pixels)) as usize;
        let (room, stored) = if pyramids(1.0) >= frames.len() {
            (frames.len(), 0)
        } else {
            (
                pyramids(PYRAMID_MEMORY_FRACTION),
                ((1.0 - PYRAMID_MEMORY_FRACTION) * bytes as f64) as usize,
            )
        };
        Self {
            source: Source::Files(frames.clone(), size),
            levels,
            light: RwLock::default(),
            room: room.max(1),
            shelf: Mutex::default(),
            stored: Mutex::new(StoredFrames {
                kept: HashMap::new(),
                room: stored,
            }),
        }
    }

    /// Creates a cache of pyramids that are in memory already.
    pub fn of_pyramids(pyramids: impl IntoIterator<Item = impl Into<Arc<Pyramid>>>) -> Self {
        let pyramids = pyramids.into_iter().map(Into::into);
        Self::in_memory(pyramids.collect(), Masks::NONE)
    }

    /// Pictures that are black all over in place of `frames`, of `size` (width and height at any
    /// pyramid level of theirs), with their masks; nothing is read.
    pub fn blank(frames: &FrameSet, size: [u32; 2]) -> Self {
        let [width, height] = size.map(|side| side as usize);
        let black = GreyImage::new(width, height, vec![0.0; width * height]);
        let black = Arc::new(Pyramid::new(black, 1));
        Self::in_memory(vec![black; frames.len()], frames.masks().clone())
    }

    fn in_memory(pyramids: Vec<Arc<Pyramid>>, masks: Masks) -> Self {
        Self {
            levels: 1,
            light: RwLock::default(),
            room: pyramids.len(),
            shelf: Mutex::default(),
            stored: Mutex::default(),
            source: Source::Memory(pyramids, masks),
        }
    }

    /// Number of frames.
    pub fn frames(&self) -> usize {
        match &self.source {
            Source::Files(frames, _) => frames.len(),
            Source::Memory(pyramids, _) => pyramids.len(),
        }
    }

    /// The frames' masks.
    pub fn masks(&self) -> &Masks {
        match &self.source {
            Source::Files(frames, _) => frames.masks(),
            Source::Memory(_, masks) => masks,
        }
    }

    /// Largest number of pyramids held at once.
    pub fn pyramid_capacity(&self) -> usize {
        self.room
    }

    /// Treatment of the frames' light.
    pub fn light(&self) -> Light {
        let light = self.light.read();
        light.unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The light by which frames are divided.
    pub fn camera_light(&self) -> Option<Arc<CameraLight>> {
        match self.light() {
            Light::Shaded(light) => Some(light),
            Light::Even | Light::Normalised => None,
        }
    }

    /// Position of the lamp in the camera's frame, metres, if frames are divided by its light.
    pub fn lamp_m(&self) -> Option<[f64; 3]> {
        let light = self.camera_light()?;
        let (lamp, _) = light.lamp.as_ref()?;
        Some((lamp.position * lamp.reach_m).into())
    }

    /// Sets the treatment of the frames' light and drops the cached pyramids.
    pub fn set_light(&self, light: Light) {
        let mut present = self.light.write().unwrap_or_else(PoisonError::into_inner);
        *present = light;
        lock(&self.shelf).kept.clear();
    }

    /// Drops what there is no room for of all frames, pyramids and stored frames: those of the end
    /// of a survey are not needed at its beginning, and a few of many save little.
    pub fn release(&self) {
        if self.room < self.frames() {
            lock(&self.shelf).kept.clear();
        }
        let mut stored = lock(&self.stored);
        if stored.kept.len() < self.frames() {
            let kept = std::mem::take(&mut stored.kept);
            stored.room += kept.values().map(|frame| frame.bytes()).sum::<usize>();
        }
    }

    /// The pyramid of a frame in the light that is set; pixels without a value are NaN.
    ///
    /// # Errors
    /// The errors of [`StoredFrame::decode`].
    pub fn get(&self, frame: usize) -> Result<Arc<Pyramid>, FrameError> {
        let (frames, size) = match &self.source {
            Source::Files(frames, size) => (frames, *size),
            Source::Memory(pyramids, _) => return Ok(Arc::clone(&pyramids[frame])),
        };
        {
            let mut shelf = lock(&self.shelf);
            shelf.clock += 1;
            let now = shelf.clock;
            if let Some((used, pyramid)) = shelf.kept.get_mut(&frame) {
                *used = now;
                return Ok(Arc::clone(pyramid));
            }
        }
        // Decoded without holding the lock; if two threads decode the same frame, one result is
        // dropped.
        let mut image = self.stored(&frames[frame], size)?.grey();
        if let Some(mask) = frames.masks().of(frame) {
            mask.blank(&mut image);
        }
        match self.light() {
            Light::Even => {}
            Light::Shaded(light) => light.divide(frame, &mut image),
            Light::Normalised => image = normalise_locally(&image),
        }
        let pyramid = Arc::new(Pyramid::new(image, self.levels));
        let mut shelf = lock(&self.shelf);
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

    /// A frame in the form of its file; kept if there is memory.
    fn stored(
        &self,
        file: &FrameFile,
        [width, height]: [u32; 2],
    ) -> Result<Arc<StoredFrame>, FrameError> {
        if let Some(frame) = lock(&self.stored).kept.get(&file.index) {
            return Ok(Arc::clone(frame));
        }
        let frame = Arc::new(StoredFrame::decode(file, width, height)?);
        let mut store = lock(&self.stored);
        if let Some(left) = store.room.checked_sub(frame.bytes())
            && store.kept.insert(file.index, Arc::clone(&frame)).is_none()
        {
            store.room = left;
        }
        Ok(frame)
    }
}

/// Locks a mutex; a panic of another thread leaves the map valid.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn files(folder: &std::path::Path) -> FrameSet {
        let files: Vec<FrameFile> = (0..5u8)
            .map(|index| {
                let path = folder.join(format!("{index}.png"));
                let picture = image::GrayImage::from_pixel(32, 24, image::Luma([10 + index]));
                picture.save(&path).unwrap();
                FrameFile::picture(usize::from(index), path)
            })
            .collect();
        files.into()
    }

    #[test]
    fn no_more_is_kept_than_there_is_room_for() {
        let folder = tempfile::tempdir().unwrap();
        let files = files(folder.path());
        // Three quarters for three stored frames, the rest for a pyramid.
        let cache = FrameCache::new(&files, [32, 24], 2, 4 * 32 * 24);
        let get = |frame: usize| Ok::<_, FrameError>(cache.get(frame)?.level(0).at(3, 3));
        for frame in [0, 1, 2, 0, 3, 4, 0] {
            assert_eq!(get(frame).unwrap(), 10.0 + frame as f32);
            assert_eq!(lock(&cache.shelf).kept.len(), 1);
        }
        // The first three are not read again.
        for file in files.iter() {
            std::fs::remove_file(&file.path).unwrap();
        }
        for frame in [0, 1, 2] {
            assert_eq!(get(frame).unwrap(), 10.0 + frame as f32);
        }
        assert!(get(3).is_err());
    }

    #[test]
    fn some_of_all_frames_are_released_and_read_again() {
        let folder = tempfile::tempdir().unwrap();
        let files = files(folder.path());
        // Memory for three of five frames, or for all.
        for (frames, left) in [(4, 0), (8, 5)] {
            let cache = FrameCache::new(&files, [32, 24], 1, frames * 32 * 24);
            let get_all = || (0..5).for_each(|k| assert!(cache.get(k).is_ok()));
            let stored = || lock(&cache.stored).kept.len();
            get_all();
            let before = stored();
            cache.release();
            assert_eq!((stored(), lock(&cache.shelf).kept.len()), (left, 0));
            get_all();
            assert_eq!(stored(), before);
        }
    }

    #[test]
    fn a_frame_that_is_gone_is_an_error_that_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let files = files(folder.path());
        std::fs::remove_file(&files[3].path).unwrap();
        let cache = FrameCache::new(&files, [32, 24], 1, 0);
        let error = cache.get(3).unwrap_err().to_string();
        assert!(error.contains("frame 3"), "{error}");
    }
}
