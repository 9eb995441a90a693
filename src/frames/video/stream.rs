//! A video with random access to its pictures.

use super::decoder::Decoder;
use super::info::VideoInfo;
use super::probe;
use crate::frames::error::FrameError;
use image::{ColorType, DynamicImage};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// Pictures that are rather decoded on the way than jumped over.
const MAX_SKIPPED_PICTURES: usize = 48;

/// A video whose pictures are decoded on demand.
///
/// Pictures are as players show them, turned as the file says, and numbered from 0 in the order of
/// their times. Colour becomes RGB and grey stays grey, of 8 bits or, where the video has more, 16.
#[derive(Debug)]
pub struct Video {
    info: VideoInfo,
    /// Decoders between two pictures, the one used last at the end.
    idle: Mutex<Vec<Decoder>>,
}

impl Video {
    /// Looks into a video; no picture is decoded.
    ///
    /// # Errors
    /// [`FrameError::Video`]: `ffprobe` is missing; a file that is no video, has no pictures, is
    /// cut off or interlaced, or is to be turned by other than right angles.
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

    /// What the pixels are.
    pub fn colour(&self) -> ColorType {
        self.info.layout.colour
    }

    /// Number of pictures.
    pub fn pictures(&self) -> usize {
        self.info.moments.len()
    }

    /// By how much pictures are turned from how the sensor read them, degrees: rows are then not
    /// what was read at once.
    pub fn rotation_deg(&self) -> i32 {
        self.info.rotation_deg
    }

    /// What is odd about the file but does not keep it from being read.
    pub fn warning(&self) -> Option<&str> {
        self.info.warning.as_deref()
    }

    /// The time of a picture, seconds.
    pub fn time_s(&self, picture: usize) -> f64 {
        self.info.time_s(picture)
    }

    /// Decodes picture number `picture`; several threads may ask at once.
    ///
    /// # Errors
    /// What `ffmpeg` says of a video that is damaged there.
    pub fn decode(&self, picture: usize) -> Result<DynamicImage, String> {
        let mut decoder = match self.take_near(picture) {
            Some(decoder) => decoder,
            None => Decoder::start(&self.info, picture)?,
        };
        let bytes = match decoder.advance(&self.info, picture) {
            Ok(bytes) => bytes,
            // Some files cannot be entered everywhere: the whole way is sure.
            Err(_) => {
                decoder = Decoder::start(&self.info, 0)?;
                decoder.advance(&self.info, picture)?
            }
        };
        self.put_back(decoder);
        let picture = self.info.layout.picture(bytes);
        picture.ok_or_else(|| "ffmpeg gave a picture of another size".to_owned())
    }

    /// The decoder that has the fewest pictures to go, if it is sooner there than a new one.
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

    /// Keeps a decoder for the next picture: one a thread, and the oldest goes.
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
