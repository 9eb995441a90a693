//! The formats of pose files.

use super::axes::{CameraAxes, Direction};
use serde::{Deserialize, Serialize};

/// The format of a pose file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PoseFormat {
    /// Lines `time tx ty tz qx qy qz qw`.
    Tum,
    /// Lines with the twelve numbers of a 3 × 4 matrix, or a folder with a file for each.
    Kitti,
    /// A table with named columns.
    Csv,
    /// COLMAP's model: a folder with images.txt or images.bin, or that file.
    Colmap,
    /// nerfstudio's transforms.json.
    Nerfstudio,
    /// EuRoC's csv of a body's poses; read only.
    Euroc,
    /// OpenSfM's reconstruction.json; read only.
    Opensfm,
    /// Bundler's bundle.out with its list of names; read only.
    Bundler,
    /// Meshroom's cameras.sfm; read only.
    Meshroom,
    /// OpenMVG's sfm_data.json; read only.
    Openmvg,
    /// Metashape's cameras in XML; read only.
    Metashape,
    /// RealityCapture's CSV of cameras; read only.
    Realitycapture,
    /// Pix4D's calibrated external camera parameters; read only.
    Pix4d,
    /// JSON or YAML of people's own; read only.
    Json,
    /// Record3D's metadata; read only.
    Record3d,
    /// Messages of a recording (MCAP, ROS 1 bag); read only.
    Recording,
}

impl PoseFormat {
    /// The direction of the format's poses.
    pub fn direction(self) -> Direction {
        match self {
            Self::Colmap | Self::Opensfm | Self::Bundler | Self::Meshroom | Self::Openmvg => {
                Direction::WorldToCamera
            }
            _ => Direction::CameraToWorld,
        }
    }

    /// The camera axes of the format.
    pub fn axes(self) -> CameraAxes {
        match self {
            Self::Nerfstudio
            | Self::Bundler
            | Self::Realitycapture
            | Self::Pix4d
            | Self::Record3d => CameraAxes::OpenGl,
            _ => CameraAxes::OpenCv,
        }
    }

    /// True for the programs of structure from motion and for robots, whose world has its origin
    /// and axes anywhere unless the user has placed it.
    pub fn has_arbitrary_world(self) -> bool {
        self.has_no_scale()
            || matches!(
                self,
                Self::Metashape
                    | Self::Realitycapture
                    | Self::Pix4d
                    | Self::Record3d
                    | Self::Recording
            )
    }

    /// True for the programs of structure from motion whose unit of length is arbitrary unless the
    /// user has scaled the model.
    pub fn has_no_scale(self) -> bool {
        matches!(
            self,
            Self::Colmap
                | Self::Nerfstudio
                | Self::Opensfm
                | Self::Bundler
                | Self::Meshroom
                | Self::Openmvg
        )
    }
}
