//! Calibration files: the program's own format (JSON or TOML), OpenCV's YAML, ROS's camera_info,
//! Kalibr's camchain, the YAML of camodocal, VINS-Fusion and ORB-SLAM, COLMAP's cameras.txt and
//! cameras.bin, nerfstudio's transforms.json, the files of OpenSfM, OpenMVG, Meshroom, Metashape,
//! Bundler, RealityCapture and Pix4D, Basalt's JSON, Gyroflow's lens profiles and OCamCalib's
//! calib_results.txt.
//!
//! | file | recognised by | lens | centre of the first pixel |
//! | --- | --- | --- | --- |
//! | own | `.json`, `.toml` | [`native`] | `pixel_centre` |
//! | OpenCV, EuRoC, RealSense, Open3D | `.yaml`, `.yml`, `.json`, `.toml`, `.xml`; a matrix (`rows`, `cols`, `data`, or rows) named `camera_matrix` or similar, or `fx`, `fy`, `cx`, `cy`; size from the pictures if it has none | 4, 5 or 8 coefficients; fisheye if `fisheye_model: 1` | (0, 0) |
//! | ROS | as OpenCV, with `distortion_model` | `plumb_bob`, `rational_polynomial`, `equidistant` | (0, 0) |
//! | Kalibr | `.yaml` with `cam0:` | pinhole with `radtan`, `equidistant`, `fov`, `none`; `omni` with `radtan`, `none`; `ds`; `eucm` | (0, 0) |
//! | camodocal | `.yaml` with `model_type` | `PINHOLE`, `MEI`, `KANNALA_BRANDT` | (0, 0) |
//! | ORB-SLAM2, ORB-SLAM3 | `.yaml` with `Camera.fx` or `Camera1.fx` | `PinHole`, `KannalaBrandt8`, `Rectified` | (0, 0) |
//! | COLMAP | `.txt`, `.bin` | PINHOLE … FULL_OPENCV, the fisheyes, THIN_PRISM_FISHEYE, FOV, EUCM | (½, ½) |
//! | OCamCalib | `.txt` with five lines of numbers | polynomial | (0, 0) |
//! | OpenSfM, OpenDroneMap | `.json` that is a list with `cameras`, or has cameras with `projection_type` | `perspective`, `simple_radial`, `radial`, `brown`, `fisheye`, `fisheye_opencv` | normalised |
//! | OpenMVG | `.json` with `sfm_data_version` | `pinhole`, `pinhole_radial_k1`, `pinhole_radial_k3`, `pinhole_brown_t2`, `fisheye` | (0, 0) |
//! | Meshroom | `.json`, `.sfm` with `version` and `intrinsics` | pinhole with `radialk1`, `radialk3`, `brown`, `fisheye`, `none` | (0, 0) |
//! | Metashape | `.xml` with a `chunk`, or a `calibration` alone | `frame`, `fisheye` | (½, ½) |
//! | Bundler | `.out` that begins with `# Bundle file` | f, k1, k2; size from the pictures | (0, 0) |
//! | RealityCapture | `.csv` with a comment `#name,…,f,…` | Brown 3, with or without tangential; size from the pictures | (½, ½) |
//! | Pix4D | `.txt` that begins with `fileName imageWidth imageHeight`; `.cam`, size from the pictures | perspective | (½, ½) |
//! | Basalt | `.json` with `value0` | `pinhole`, `ds`, `eucm`, `ucm`, `kb4`, `fov` | (0, 0) |
//! | Gyroflow | `.json` with `fisheye_params` and `calib_dimension` | `opencv_fisheye`, `opencv_standard` | (0, 0) |
//! | Record3D | `metadata`, a JSON with `K`, `w`, `h` and `poses` | no distortion | (0, 0) |
//! | recording | `.mcap`, `.bag` | `plumb_bob`, `rational_polynomial`, `equidistant` of its CameraInfo | (0, 0) |
//! | nerfstudio, instant-ngp | `.json` with `fl_x`, `camera_angle_x` or `frames` | PINHOLE, OPENCV, OPENCV_FISHEYE | (½, ½) |

mod basalt;
mod bundler;
mod camodocal;
mod coefficients;
mod colmap;
mod colmap_binary;
#[cfg(test)]
mod colmap_binary_tests;
mod error;
mod gyroflow;
mod kalibr;
mod lens_keys;
mod meshroom;
mod metashape;
mod named_entries;
mod native;
mod nerfstudio;
mod ocamcalib;
mod opencv;
mod opencv_xml;
mod openmvg;
mod opensfm;
mod orbslam;
mod per_picture;
mod picture_size;
mod pix4d;
mod read;
mod realitycapture;
mod record3d;
mod recorded;
mod selection;
#[cfg(test)]
mod tests;
mod unknown;
mod value_tree;
#[cfg(test)]
mod wide_angle_tests;
mod words;

pub use error::CalibrationError;
pub use native::format_calibration;
pub use read::{read_calibration, read_calibration_of, stated_readout_ms};
