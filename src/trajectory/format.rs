//! The formats of pose files.

use super::axes::{CameraAxes, Direction};
use serde::{Deserialize, Serialize};

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
