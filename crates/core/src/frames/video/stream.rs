//! A video with random access to its pictures.

use super::decoder::Decoder;
use super::info::VideoInfo;
use super::probe;
use crate::frames::error::FrameError;
use image::{ColorType, DynamicImage};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Largest number of pictures that are decoded sequentially instead of jumping.
const MAX_SKIPPED_PICTURES: usize = 48;

/// A video, decoded on demand.
///
/// Pictures are rotated as for display and numbered from 0 in the order of their times. Colour
/// becomes RGB and grey stays grey, with 8 bits or, if the video has more, 16.
#[derive(Debug)]
pub struct Video {
    info: VideoInfo,
    /// Idle decoders, the most recently used one last.
    idle: Mutex<Vec<Decoder>>,
}

impl Video {
    /// Reads the properties of a video without decoding pictures.
    ///
    /// # Errors
    /// [`FrameError::Video`]: `ffprobe` is missing; a file that is not a video, has no pictures, is
    /// cut off or interlaced, or is displayed with a rotation other than a multiple of 90°.
    pub fn open(path: &Path) -> Result<Self, FrameError> {
        let info = probe::probe(path).map_err(|what| FrameError::Video {
            path: path.to_owned(),
            what,
        })?;
        Ok(Self {
            info,
            idle: Mutex::default(),
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.info.path
    }

    /// Width and height of the pictures, pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.info.layout.width, self.info.layout.height)
    }

    /// Colour type of the pixels.
    pub fn colour(&self) -> ColorType {
        self.info.layout.colour
    }

    /// Number of pictures.
    pub fn pictures(&self) -> usize {
        self.info.moments.len()
    }

    /// Rotation of the displayed pictures against the sensor's, degrees. If it is not 0, rows of
    /// pixels are not rows of the sensor.
    pub fn rotation_deg(&self) -> i32 {
        self.info.rotation_deg
    }

    /// A complaint of `ffprobe` that does not keep the file from being read.
    pub fn warning(&self) -> Option<&str> {
        self.info.warning.as_deref()
    }

    /// The time of a picture, seconds.
    pub fn time_s(&self, picture: usize) -> f64 {
        self.info.time_s(picture)
    }

    /// Decodes picture number `picture`; may be called from several threads at once.
    ///
    /// # Errors
    /// The error of `ffmpeg` if the video is damaged there.
    pub fn decode(&self, picture: usize) -> Result<DynamicImage, String> {
        let mut decoder = match self.take_near(picture) {
            Some(decoder) => decoder,
            None => Decoder::start(&self.info, picture)?,
        };
        let bytes = match decoder.advance(&self.info, picture) {
            Ok(bytes) => bytes,
            // Some files cannot be entered at every key picture; decode from the start.
            Err(_) => {
                decoder = Decoder::start(&self.info, 0)?;
                decoder.advance(&self.info, picture)?
            }
        };
        self.put_back(decoder);
        let picture = self.info.layout.picture(bytes);
        picture.ok_or_else(|| "ffmpeg gave a picture of another size".to_owned())
    }

    /// Takes the idle decoder nearest before the picture, if it is faster than a new one.
    fn take_near(&self, picture: usize) -> Option<Decoder> {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        let (at, next) = idle
            .iter()
            .map(Decoder::next)
            .enumerate()
            .filter(|(_, next)| *next <= picture)
            .max_by_key(|(_, next)| *next)?;
        let between = &self.info.moments[next..=picture];
        let near =
            between.len() <= MAX_SKIPPED_PICTURES || !between.iter().any(|moment| moment.key);
        near.then(|| idle.remove(at))
    }

    /// Keeps a decoder for the next picture; at most one per thread, the oldest is dropped.
    fn put_back(&self, decoder: Decoder) {
        let mut idle = self.idle.lock().unwrap_or_else(PoisonError::into_inner);
        if decoder.next() < self.pictures() {
            idle.push(decoder);
        }
        let most = rayon::current_num_threads().max(1);
        let gone = (idle.len() > most).then(|| idle.remove(0));
        drop(idle);
        drop(gone);
    }
}
