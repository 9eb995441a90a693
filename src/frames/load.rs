//! Finding and decoding frames.

use super::GreyImage;
use image::DynamicImage;
use std::path::{Path, PathBuf};

/// Why a frame cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FrameError {
    /// The pattern in survey.toml is malformed.
    #[error("frames.images = \"{pattern}\": {what}")]
    Pattern {
        /// The pattern.
        pattern: String,
        /// What is wrong with it.
        what: String,
    },
    /// The pattern matches nothing.
    #[error(
        "frames.images = \"{pattern}\" matches no file; the pattern is relative to survey.toml"
    )]
    NoFrames {
        /// The pattern.
        pattern: String,
    },
    /// A frame is unreadable or damaged.
    #[error("frame {index} ({}): {what}; restore the file, or remove the frame and its pose", path.display())]
    Decode {
        /// Index of the frame in the survey.
        index: usize,
        /// The file.
        path: PathBuf,
        /// What the decoder said.
        what: String,
    },
    /// A frame is not as large as the calibration says.
    #[error(
        "frame {index} ({}): {width} × {height} px, but the calibration is for {expected_width} × {expected_height} px",
        path.display()
    )]
    Size {
        /// Index of the frame in the survey.
        index: usize,
        /// The file.
        path: PathBuf,
        /// Width found.
        width: u32,
        /// Height found.
        height: u32,
        /// Width of the calibration.
        expected_width: u32,
        /// Height of the calibration.
        expected_height: u32,
    },
}

/// A frame on disk.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameFile {
    /// Index of the frame in the survey.
    pub index: usize,
    /// The picture.
    pub path: PathBuf,
}

/// The files that match `pattern` (glob syntax, relative to `folder`), sorted by name.
///
/// # Errors
/// A malformed pattern, an unreadable folder, no match.
pub fn list(folder: &Path, pattern: &str) -> Result<Vec<FrameFile>, FrameError> {
    let fail = |what: String| FrameError::Pattern {
        pattern: pattern.to_owned(),
        what,
    };
    let escaped = glob::Pattern::escape(&folder.to_string_lossy());
    let full = Path::new(&escaped).join(pattern);
    let found = glob::glob(&full.to_string_lossy()).map_err(|error| fail(error.to_string()))?;
    let mut paths = Vec::new();
    for path in found {
        let path = path.map_err(|error| fail(error.to_string()))?;
        if !path.is_dir() {
            paths.push(path);
        }
    }
    paths.sort();
    if paths.is_empty() {
        return Err(FrameError::NoFrames {
            pattern: pattern.to_owned(),
        });
    }
    Ok(paths
        .into_iter()
        .enumerate()
        .map(|(index, path)| FrameFile { index, path })
        .collect())
}

/// Decodes a frame and checks its size.
///
/// # Errors
/// A missing, truncated or unknown file; a size other than `(width, height)`.
pub fn load_colour(file: &FrameFile, width: u32, height: u32) -> Result<DynamicImage, FrameError> {
    let fail = |what: String| FrameError::Decode {
        index: file.index,
        path: file.path.clone(),
        what,
    };
    let bytes = std::fs::read(&file.path).map_err(|error| fail(error.to_string()))?;
    if bytes.starts_with(&[0xff, 0xd8]) && !jpeg_is_complete(&bytes) {
        return Err(fail("the JPEG file is truncated".to_owned()));
    }
    let reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|error| fail(error.to_string()))?;
    let picture = reader.decode().map_err(|error| fail(error.to_string()))?;
    if (picture.width(), picture.height()) != (width, height) {
        return Err(FrameError::Size {
            index: file.index,
            path: file.path.clone(),
            width: picture.width(),
            height: picture.height(),
            expected_width: width,
            expected_height: height,
        });
    }
    Ok(picture)
}

/// True if a JPEG file holds its end-of-image marker (the decoder fills what is missing with grey and
/// says nothing). Padding after the marker is allowed.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    let end = bytes.len().saturating_sub(4096);
    bytes[end..].windows(2).any(|pair| pair == [0xff, 0xd9])
}

/// Decodes a frame to grey levels (0–255, Rec. 709 luma of colour pictures; 16-bit pictures keep their finer steps).
///
/// Full white and full black are NaN: the sensor or the encoder has clipped them, so they only say that the wall is at
/// least as bright or as dark.
///
/// # Errors
/// As [`load_colour`].
pub fn load_grey(file: &FrameFile, width: u32, height: u32) -> Result<GreyImage, FrameError> {
    let mut data: Vec<f32> = match load_colour(file, width, height)? {
        DynamicImage::ImageLuma8(grey) => grey.into_raw().into_iter().map(f32::from).collect(),
        // 65535 = 255 · 257.
        DynamicImage::ImageLuma16(grey) => {
            let values = grey.into_raw().into_iter();
            values.map(|v| f32::from(v) / 257.0).collect()
        }
        other => other
            .to_luma32f()
            .into_raw()
            .into_iter()
            .map(|v| v * 255.0)
            .collect(),
    };
    // Luma of white may be a rounding error short of 255.
    for value in &mut data {
        if *value <= 1e-3 || *value >= 255.0 - 1e-3 {
            *value = f32::NAN;
        }
    }
    Ok(GreyImage::new(width as usize, height as usize, data))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{PictureFormat, write_picture};
    use image::ImageBuffer;

    #[test]
    fn sixteen_bits_keep_their_fractions_of_grey_levels() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.png");
        // Every value there is.
        let all = ImageBuffer::from_fn(256, 256, |u, v| image::Luma([(256 * v + u) as u16]));
        write_picture(&path, &all.into(), PictureFormat::Png).unwrap();
        let grey = load_grey(&FrameFile { index: 0, path }, 256, 256).unwrap();
        let last = grey.data().len() - 1;
        for (value, level) in grey.data().iter().enumerate().take(last).skip(1) {
            assert_eq!((f64::from(*level) * 257.0).round() as usize, value);
        }
        // Black and white are clipped.
        assert!(grey.data()[0].is_nan() && grey.data()[last].is_nan());
        for level in 1..255u16 {
            assert_eq!(grey.data()[usize::from(257 * level)], f32::from(level));
        }
    }
}
