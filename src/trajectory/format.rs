//! The formats that poses are kept in, and which one a file is.

use super::convention::{CameraAxes, Direction};

use super::colmap;
use super::error::PoseError;
use super::{csv, euroc, kitti, text, tum};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A format of a file of poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum PoseFormat {
    /// `time tx ty tz qx qy qz qw`.
    Tum,
    /// The twelve numbers of a 3 × 4 matrix.
    Kitti,
    /// Named columns.
    Csv,
    /// COLMAP's text model: a folder with images.txt, or that file.
    Colmap,
    /// nerfstudio's transforms.json.
    Nerfstudio,
    /// EuRoC's csv of a body's poses; read only.
    Euroc,
}

impl PoseFormat {
    /// The format of a text, by what it holds.
    ///
    /// # Errors
    /// A text that is none of them, named with what was found.
    pub(crate) fn detect(path: &Path, text: &str) -> Result<Self, PoseError> {
        if text.trim_start().starts_with('{') {
            return Ok(Self::Nerfstudio);
        }
        let Some((number, line)) = text::lines(text).next() else {
            // Only comments: COLMAP's say what they are about.
            return Err(PoseError::file(path, "holds no poses"));
        };
        if csv::is_header(line) {
            return Ok(Self::Csv);
        }
        if euroc::is_line(line) {
            return Ok(Self::Euroc);
        }
        if colmap::is_line(line) {
            return Ok(Self::Colmap);
        }
        let words: Vec<&str> = line.split_whitespace().collect();
        let numbers = words
            .iter()
            .filter(|word| word.parse::<f64>().is_ok())
            .count();
        match (numbers, words.len()) {
            // A line too long or too short is the business of the format it is nearest to.
            (12, 12) => Ok(Self::Kitti),
            (most, all) if most >= 5 && all <= 9 => Ok(Self::Tum),
            _ => Err(PoseError::line(
                path,
                number,
                format!(
                    "neither of TUM (`{}`), KITTI (`{}`), CSV (`{}` named in the first line), COLMAP, nerfstudio nor EuRoC; \
                     if it is one of them, name it with --pose-format (poses.format in survey.toml)",
                    tum::FORM,
                    kitti::FORM,
                    csv::FORM
                ),
            )),
        }
    }

    /// The format's own direction of poses.
    pub fn direction(self) -> Direction {
        match self {
            Self::Colmap => Direction::WorldToCamera,
            _ => Direction::CameraToWorld,
        }
    }

    /// The format's own axes of a camera.
    pub fn axes(self) -> CameraAxes {
        match self {
            Self::Nerfstudio => CameraAxes::OpenGl,
            _ => CameraAxes::OpenCv,
        }
    }
}
