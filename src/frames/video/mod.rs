//! Frames out of a video, by the programs `ffprobe` and `ffmpeg`.
//!
//! `ffprobe` lists the pictures' times without decoding any ([`probe`]); `ffmpeg` decodes them into
//! a pipe ([`decoder`]): nothing is written to disk. A decoder runs forwards and is cheap to go on
//! with; a jump starts another at the key picture before. A picture is the one asked for because it
//! has that one's time, which the decoder tells with each.

mod decoder;
mod probe;

use super::FrameError;
use decoder::Decoder;
use image::{ColorType, DynamicImage, ImageBuffer};
use probe::Moment;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

/// Pictures that are rather decoded on the way than jumped over.
const NEAR: usize = 48;

/// A video whose pictures are decoded on demand.
///
/// Pictures are as players show them, turned as the file says, and numbered from 0 in the order of
/// their times. Colour becomes RGB and grey stays grey, of 8 bits or, where the video has more, 16.
#[derive(Debug)]
pub struct Video {
    path: PathBuf,
    format: Format,
    moments: Vec<Moment>,
    /// Ticks of the moments' times, seconds.
    tick_s: [i64; 2],
    rotation_deg: i32,
    /// What is odd but does not keep it from being read.
    warning: Option<String>,
    /// Decoders between two pictures, the one used last at the end.
    idle: Mutex<Vec<Decoder>>,
}

/// What the pictures are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Format {
    width: u32,
    height: u32,
    colour: ColorType,
}

impl Format {
    /// As `ffmpeg` calls it.
    fn pixels(&self) -> &'static str {
        match self.colour {
            ColorType::L8 => "gray",
            ColorType::L16 => "gray16le",
            ColorType::Rgb16 => "rgb48le",
            _ => "rgb24",
        }
    }

    fn bytes(&self) -> usize {
        let pixels = self.width as usize * self.height as usize;
        pixels * usize::from(self.colour.bytes_per_pixel())
    }

    /// A picture of its bytes, as [`Format::pixels`] has them.
    fn picture(&self, bytes: Vec<u8>) -> Option<DynamicImage> {
        let (width, height) = (self.width, self.height);
        let words = |bytes: &[u8]| -> Vec<u16> {
            let pairs = bytes.chunks_exact(2);
            pairs
                .map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
                .collect()
        };
        Some(match self.colour {
            ColorType::L8 => DynamicImage::ImageLuma8(ImageBuffer::from_raw(width, height, bytes)?),
            ColorType::L16 => {
                DynamicImage::ImageLuma16(ImageBuffer::from_raw(width, height, words(&bytes))?)
            }
            ColorType::Rgb16 => {
                DynamicImage::ImageRgb16(ImageBuffer::from_raw(width, height, words(&bytes))?)
            }
            _ => DynamicImage::ImageRgb8(ImageBuffer::from_raw(width, height, bytes)?),
        })
    }
}

/// What is said where a program is missing.
fn missing(program: &str, error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => format!(
            "videos are read by the program {program}, which is not installed; install ffmpeg (apt install ffmpeg, brew install ffmpeg, \
             winget install ffmpeg), or take the pictures out elsewhere and give frames.images"
        ),
        _ => format!("cannot start {program}: {error}"),
    }
}

impl Video {
    /// Looks into a video; no picture is decoded.
    ///
    /// # Errors
    /// [`FrameError::Video`]: `ffprobe` is missing; a file that is no video, has no pictures, is
    /// cut off or interlaced, or is to be turned by other than right angles.
    pub fn open(path: &Path) -> Result<Self, FrameError> {
        probe::probe(path).map_err(|what| FrameError::Video {
            path: path.to_owned(),
            what,
        })
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Width and height of the pictures, pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.format.width, self.format.height)
    }

    /// What the pixels are.
    pub fn colour(&self) -> ColorType {
        self.format.colour
    }

    /// Number of pictures.
    pub fn pictures(&self) -> usize {
        self.moments.len()
    }

    /// By how much pictures are turned from how the sensor read them, degrees: rows are then not
    /// what was read at once.
    pub fn rotation_deg(&self) -> i32 {
        self.rotation_deg
    }

    /// What is odd about the file but does not keep it from being read.
    pub fn warning(&self) -> Option<&str> {
        self.warning.as_deref()
    }

    /// The time of a picture, seconds.
    pub fn time_s(&self, picture: usize) -> f64 {
        self.seconds(self.moments[picture].ticks as f64)
    }

    fn seconds(&self, ticks: f64) -> f64 {
        ticks * self.tick_s[0] as f64 / self.tick_s[1] as f64
    }

    /// Decodes picture number `picture`; several threads may ask at once.
    ///
    /// # Errors
    /// What `ffmpeg` says of a video that is damaged there.
    pub fn decode(&self, picture: usize) -> Result<DynamicImage, String> {
        let mut decoder = match self.take_near(picture) {
            Some(decoder) => decoder,
            None => Decoder::start(self, picture)?,
        };
        let bytes = match decoder.advance(self, picture) {
            Ok(bytes) => bytes,
            // Some files cannot be entered everywhere: the whole way is sure.
            Err(_) => {
                decoder = Decoder::start(self, 0)?;
                decoder.advance(self, picture)?
            }
        };
        self.put_back(decoder);
        let picture = self.format.picture(bytes);
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
        let between = &self.moments[next..=picture];
        let near = between.len() <= NEAR || !between.iter().any(|moment| moment.key);
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
