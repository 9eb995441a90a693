//! Finding and decoding frames.

use image::{ColorType, DynamicImage, ImageDecoder};
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
    /// A mask is unreadable or none.
    #[error("{}: {what}", path.display())]
    Mask {
        /// The file.
        path: PathBuf,
        /// What is wrong with it, and the remedy.
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

impl FrameFile {
    /// The picture's name without its folder.
    pub fn name(&self) -> String {
        let name = self.path.file_name().unwrap_or_default();
        name.to_string_lossy().into_owned()
    }
}

/// The files that match `pattern` (glob syntax, relative to `folder`), sorted by name, but for the mask.
///
/// # Errors
/// A malformed pattern, an unreadable folder, no match.
pub fn list(
    folder: &Path,
    pattern: &str,
    mask: Option<&Path>,
) -> Result<Vec<FrameFile>, FrameError> {
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
        if !path.is_dir() && Some(path.as_path()) != mask {
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

/// What the pixels of a frame are, by its file's header.
///
/// # Errors
/// A missing or unknown file.
pub fn colour_type(file: &FrameFile) -> Result<ColorType, FrameError> {
    let fail = |what: String| FrameError::Decode {
        index: file.index,
        path: file.path.clone(),
        what,
    };
    let reader = image::ImageReader::open(&file.path)
        .and_then(image::ImageReader::with_guessed_format)
        .map_err(|error| fail(error.to_string()))?;
    let decoder = reader
        .into_decoder()
        .map_err(|error| fail(error.to_string()))?;
    Ok(decoder.color_type())
}

/// True if a JPEG file holds its end-of-image marker (the decoder fills what is missing with grey and
/// says nothing). Padding after the marker is allowed.
fn jpeg_is_complete(bytes: &[u8]) -> bool {
    let end = bytes.len().saturating_sub(4096);
    bytes[end..].windows(2).any(|pair| pair == [0xff, 0xd9])
}
