//! Reading and validation of calibration files.

use super::error::{CalibrationError, ParseError, ParseErrorKind};
use super::picture_size::PictureSize;
use super::unknown::unknown_calibration;
use super::{
    basalt, bundler, camodocal, colmap, colmap_binary, gyroflow, kalibr, meshroom, metashape,
    native, nerfstudio, ocamcalib, opencv, opencv_xml, openmvg, opensfm, orbslam, pix4d,
    realitycapture, record3d, recorded, value_tree,
};
use crate::camera::projection::Camera;
use crate::files::limits::MAX_CALIBRATION_BYTES;
use crate::files::{BinaryFile, decode_text, read_regular};
use crate::recordings::is_recording;
use serde_json::Value;
use std::path::Path;

/// Smallest width and height of an image, pixels.
const MIN_IMAGE_SIDE_PX: u32 = 16;
/// Smallest and largest focal length, sides of the image. A fisheye of 360° has 0.16 at the least,
/// a telephoto lens of half a degree 100.
const FOCAL_SIDES: [f64; 2] = [0.05, 100.0];
/// Smallest visible fraction of the image; below it, the coefficients are assumed to be wrong.
const MIN_VISIBLE_FRACTION: f64 = 0.5;

/// Reads a calibration file of any supported format (see the table in the module's documentation).
/// `name` selects the camera if the file holds several (`cam1`, a COLMAP id, the topic of a
/// recording, a picture).
///
/// # Errors
/// An unreadable file; an unknown, missing or impossible entry, with its line where it is known; a
/// lens model that is not supported; several cameras and no name; a file that does not state the
/// size of the pictures ([`read_calibration_of`]).
pub fn read_calibration(path: &Path, name: Option<&str>) -> Result<Camera, CalibrationError> {
    read_calibration_of(path, name, &|| None)
}

/// Reads a calibration file as [`read_calibration`] does; `picture_size` gives width and height of
/// the pictures, pixels, and is asked only for files that do not state them (Bundler,
/// RealityCapture, Pix4D's `.cam`, some of OpenCV and ORB-SLAM).
///
/// # Errors
/// Those of [`read_calibration`]; a size that is needed and not known.
pub fn read_calibration_of(
    path: &Path,
    name: Option<&str>,
    picture_size: PictureSize,
) -> Result<Camera, CalibrationError> {
    let content = |error: ParseError| {
        let ParseError { line, what, kind } = error;
        let path = path.to_owned();
        match kind {
            ParseErrorKind::Content => CalibrationError::Content { path, line, what },
            ParseErrorKind::OtherKind => CalibrationError::OtherKind { path, what },
            ParseErrorKind::Several(names) => CalibrationError::Several { path, names, what },
        }
    };
    let unreadable = |source| CalibrationError::Read {
        path: path.to_owned(),
        source,
    };
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let extension = extension.to_lowercase();
    if extension == "bin" {
        let mut file = BinaryFile::open(path).map_err(unreadable)?;
        let camera = colmap_binary::read(&mut file, name);
        return camera.and_then(validate).map_err(content);
    }
    if is_recording(path) {
        let camera = recorded::camera(&recorded::read_info(path, name)?);
        return camera.and_then(validate).map_err(content);
    }
    let bytes = read_regular(path, MAX_CALIBRATION_BYTES).map_err(unreadable)?;
    let text = decode_text(&bytes).map_err(|what| {
        content(ParseError::new(format!(
            "the file {what}; give the calibration itself"
        )))
    })?;
    parse(&text, &extension, name, picture_size)
        .and_then(validate)
        .map_err(content)
}

/// The readout time of a rolling shutter that a calibration file states beside the camera
/// (Gyroflow's lens profiles do), milliseconds: from the first row to the last, negative in the
/// other direction. `None` if there is none, or no such file.
pub fn stated_readout_ms(path: &Path) -> Option<f64> {
    let bytes = read_regular(path, MAX_CALIBRATION_BYTES).ok()?;
    let tree = value_tree::parse_json(&decode_text(&bytes).ok()?).ok()?;
    gyroflow::is_profile(&tree)
        .then(|| gyroflow::readout_ms(&tree))
        .flatten()
}

fn parse(
    text: &str,
    extension: &str,
    name: Option<&str>,
    size: PictureSize,
) -> Result<Camera, ParseError> {
    match extension {
        "yaml" | "yml" => {
            let tree = value_tree::parse_yaml(text)?;
            if kalibr::is_camchain(&tree) {
                kalibr::read(&tree, name)
            } else if camodocal::is_camodocal(&tree) {
                camodocal::read(&tree)
            } else if orbslam::is_settings(&tree) {
                orbslam::read(&tree, name, size)
            } else {
                opencv::read(&tree, size)
            }
        }
        "txt" if pix4d::is_picture_list(text) => pix4d::read_pictures(text, name),
        "txt" if ocamcalib::is_ocamcalib(text) => ocamcalib::read(text),
        "txt" if colmap::has_no_model(text) => Err(unknown_calibration("")),
        "txt" => colmap::read(text, name),
        "out" if bundler::is_bundle(text) => bundler::read(text, name, size),
        "csv" if realitycapture::is_table(text) => realitycapture::read(text, name, size),
        "cam" if pix4d::is_cam(text) => pix4d::read_cam(text, name, size),
        "out" | "csv" | "cam" => Err(unknown_calibration("")),
        "toml" => match toml::from_str::<Value>(text) {
            Ok(tree) if is_of_others(&tree) => opencv::read(&tree, size),
            _ => native::read_toml(text),
        },
        "xml" if !text.contains("<opencv_storage") => metashape::read(text, name),
        "xml" => opencv::read(&opencv_xml::parse_storage(text)?, size),
        _ if extension != "json" && !text.trim_start().starts_with(['{', '[']) => {
            Err(unknown_calibration(""))
        }
        _ => match value_tree::parse_json(text) {
            Ok(tree) if nerfstudio::is_transforms(&tree) => nerfstudio::read(&tree, name, size),
            Ok(tree) if record3d::is_metadata(&tree) => record3d::read(&tree),
            Ok(tree) if gyroflow::is_profile(&tree) => gyroflow::read(&tree),
            Ok(tree) if opensfm::is_reconstruction(&tree) => opensfm::read(&tree, name),
            Ok(tree) if opensfm::is_camera_models(&tree) => opensfm::named_camera(&tree, name),
            Ok(tree) if openmvg::is_sfm_data(&tree) => openmvg::read(&tree, name),
            Ok(tree) if meshroom::is_sfm(&tree) => meshroom::read(&tree, name),
            Ok(tree) if basalt::is_basalt(&tree) => basalt::read(&tree, name),
            Ok(tree) if is_of_others(&tree) => opencv::read(&tree, size),
            Ok(tree) if !native::is_native(&tree) => Err(unknown_calibration("")),
            _ => native::read_json(text),
        },
    }
}

/// True for the camera of another program: its numbers have other names than in this program's own
/// files, or the model has none.
fn is_of_others(tree: &Value) -> bool {
    opencv::has_camera(tree) && !native::has_all_keys(tree)
}

/// Rejects impossible camera parameters.
fn validate(camera: Camera) -> Result<Camera, ParseError> {
    if camera.width < MIN_IMAGE_SIDE_PX || camera.height < MIN_IMAGE_SIDE_PX {
        return Err(ParseError::new(format!(
            "width and height are {} × {}; they must be the frames' size in pixels, at least \
             {MIN_IMAGE_SIDE_PX} each",
            camera.width, camera.height
        )));
    }
    let sides = [
        ("fx", camera.fx, camera.width),
        ("fy", camera.fy, camera.height),
    ];
    for (name, value, side_px) in sides {
        if !(value.is_finite() && value > 0.0) {
            return Err(ParseError::new(format!(
                "{name} is {value}; a focal length in pixels is positive"
            )));
        }
        let [least, most] = FOCAL_SIDES.map(|sides| sides * f64::from(side_px));
        if !(least..=most).contains(&value) {
            return Err(ParseError::new(format!(
                "{name} is {value}; for {side_px} px it must lie between {least} and {most}, in \
                 pixels, not in metres or millimetres"
            )));
        }
    }
    for (name, value) in [("cx", camera.cx), ("cy", camera.cy)] {
        if !value.is_finite() {
            return Err(ParseError::new(format!(
                "{name} is {value}; it must be a number"
            )));
        }
    }
    let shown = camera.visible_fraction();
    if shown < MIN_VISIBLE_FRACTION {
        return Err(ParseError::new(format!(
            "the distortion folds the picture back on itself: only {:.0} % of it is shown; check \
             its coefficients and their order, and that fx and fy are in pixels",
            100.0 * shown
        )));
    }
    Ok(camera)
}
