//! The properties of a video, as its header and its list of packets give them.

use image::{ColorType, DynamicImage, ImageBuffer};
use std::path::PathBuf;

/// The time of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Moment {
    /// Its time in ticks of the stream.
    pub ticks: i64,
    /// True for a key picture, at which decoding can start.
    pub key: bool,
}

/// The properties of a video.
#[derive(Debug)]
pub struct VideoInfo {
    /// The file.
    pub path: PathBuf,
    /// Size and pixels of the pictures.
    pub layout: PixelLayout,
    /// The pictures' times, in order.
    pub moments: Vec<Moment>,
    /// Duration of a tick of the moments' times, seconds, as a fraction.
    pub tick_s: [i64; 2],
    /// Rotation of the displayed picture against the sensor's, degrees.
    pub rotation_deg: i32,
    /// A complaint of `ffprobe` that does not keep the file from being read.
    pub warning: Option<String>,
}

impl VideoInfo {
    /// The time of a picture, seconds.
    pub fn time_s(&self, picture: usize) -> f64 {
        self.seconds(self.moments[picture].ticks as f64)
    }

    /// Converts ticks to seconds.
    pub fn seconds(&self, ticks: f64) -> f64 {
        ticks * self.tick_s[0] as f64 / self.tick_s[1] as f64
    }
}

/// Size and colour type of the pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelLayout {
    pub width: u32,
    pub height: u32,
    pub colour: ColorType,
}

impl PixelLayout {
    /// The pixel format in `ffmpeg`'s notation.
    pub fn ffmpeg_name(&self) -> &'static str {
        match self.colour {
            ColorType::L8 => "gray",
            ColorType::L16 => "gray16le",
            ColorType::Rgb16 => "rgb48le",
            _ => "rgb24",
        }
    }

    pub fn bytes(&self) -> usize {
        let pixels = self.width as usize * self.height as usize;
        pixels * usize::from(self.colour.bytes_per_pixel())
    }

    /// Creates a picture from its bytes in the format [`PixelLayout::ffmpeg_name`].
    pub fn picture(&self, bytes: Vec<u8>) -> Option<DynamicImage> {
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

/// The error text of a program that cannot be started.
pub fn start_error(program: &str, error: &std::io::Error) -> String {
    match error.kind() {
        std::io::ErrorKind::NotFound => format!(
            "videos are read by the program {program}, which is not installed; install ffmpeg \
             (apt install ffmpeg, brew install ffmpeg, \
             winget install ffmpeg), or extract the pictures elsewhere and set frames.images"
        ),
        _ => format!("cannot start {program}: {error}"),
    }
}
