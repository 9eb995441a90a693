//! Calibration files: the program's own format (JSON or TOML), OpenCV's YAML, ROS's camera_info,
//! Kalibr's camchain, COLMAP's cameras.txt and nerfstudio's transforms.json.
//!
//! | file | recognised by | lens | centre of the first pixel |
//! | --- | --- | --- | --- |
//! | own | `.json`, `.toml` | [`native`] | `pixel_centre` |
//! | OpenCV | `.yaml`, `.yml`; a matrix with `rows`, `cols`, `data` named `camera_matrix` or similar | 4, 5 or 8 coefficients; fisheye if `fisheye_model: 1` | (0, 0) |
//! | ROS | as OpenCV, with `distortion_model` | `plumb_bob`, `rational_polynomial`, `equidistant` | (0, 0) |
//! | Kalibr | `.yaml` with `cam0:` | `radtan`, `equidistant`, `none` | (0, 0) |
//! | COLMAP | `.txt` | PINHOLE … FULL_OPENCV, the fisheyes | (½, ½) |
//! | nerfstudio | `.json` with `fl_x` or `frames` | PINHOLE, OPENCV, OPENCV_FISHEYE | (½, ½) |

mod coefficients;
mod colmap;
mod error;
mod kalibr;
mod native;
mod nerfstudio;
mod opencv;
mod read;
mod selection;
#[cfg(test)]
mod tests;
mod value_tree;

pub use error::CalibrationError;
pub use native::format_calibration;
pub use read::read_calibration;
