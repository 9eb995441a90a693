//! `tunnelstitch project`: writes the cylindrical projection of one photo.

use crate::camera::{Camera, read_calibration};
use crate::cli::arguments::{InterpolationArgument, input_file, positive};
use crate::cli::output::{Failure, RunRecord, Terminal, picture_format, record};
use crate::files::printed;
use crate::frames::{FrameFile, add_picture, load_colour, open_picture};
use crate::persist::atomic::OutputSet;
use crate::render::{Picture, cylinder};
use image::ImageDecoder;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Projects one photo onto a cylinder around the camera.
///
/// Without a calibration, the principal point is the centre of the photo. Pixels that the photo
/// does not cover are transparent; the result is cropped to the covered part.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  tunnelstitch project photo.jpg --fov-deg 60 --out cylinder.png"
)]
pub struct ProjectArguments {
    /// The photo; `-` is standard input.
    #[arg(value_parser = input_file())]
    image: PathBuf,
    /// The result, .png or .tif.
    #[arg(long, short, value_name = "FILE")]
    out: PathBuf,
    /// Vertical field of view of the photo, degrees.
    #[arg(
        long,
        value_name = "DEG",
        default_value_t = 60.0,
        value_parser = field_of_view,
        conflicts_with_all = ["focal_px", "camera"]
    )]
    fov_deg: f64,
    /// Focal length of the photo, pixels, instead of --fov-deg.
    #[arg(long, value_name = "F", value_parser = positive, conflicts_with = "camera")]
    focal_px: Option<f64>,
    /// Calibration file of the camera, instead of --fov-deg.
    #[arg(long, value_name = "FILE", value_parser = input_file())]
    camera: Option<PathBuf>,
    /// Interpolation between the pixels of the photo.
    #[arg(long, value_enum, default_value_t)]
    interpolation: InterpolationArgument,
}

fn field_of_view(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value < 180.0 => Ok(value),
        _ => Err("must lie between 0 and 180 degrees".to_owned()),
    }
}

/// Runs the command.
///
/// # Errors
/// [`Failure`] for an unreadable photo or calibration, a photo of another size than the
/// calibration's, and an output that cannot be written.
pub fn run(
    arguments: &ProjectArguments,
    record: &RunRecord,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let format = picture_format(&arguments.out)?;
    let camera = match &arguments.camera {
        Some(path) => read_calibration(path, None)?,
        None => described_camera(arguments)?,
    };
    let file = FrameFile::picture(0, arguments.image.clone());
    let decoded = load_colour(&file, camera.width, camera.height).map_err(|error| {
        let image = printed(&arguments.image);
        Failure::input(format!("{image}: {}", error.reason()))
    })?;
    let photo = Picture::from_decoded(decoded);
    let result = cylinder::project(&photo, &camera, arguments.interpolation.into());
    let mut outputs = OutputSet::default();
    add_picture(&mut outputs, &arguments.out, &result.image, format)?;
    let inputs = [&arguments.image].into_iter().chain(&arguments.camera);
    let inputs = record::hash_files(inputs.map(AsRef::as_ref))?;
    record.add_to(&mut outputs, &record::path_beside(&arguments.out), &inputs)?;
    outputs.commit()?;
    terminal.say(format!(
        "{}: {} × {} px, first pixel at û = {}, v̂ = {}",
        printed(&arguments.out),
        result.image.width(),
        result.image.height(),
        result.origin_px[0],
        result.origin_px[1]
    ));
    terminal.result(&ProjectReport {
        out: &arguments.out,
        width: result.image.width(),
        height: result.image.height(),
        origin_px: result.origin_px,
    })
}

/// The result, for `--json`.
#[derive(Serialize)]
struct ProjectReport<'a> {
    out: &'a Path,
    width: u32,
    height: u32,
    /// Coordinates û, v̂ of the first pixel on the cylinder, pixels.
    origin_px: [i64; 2],
}

/// The pinhole camera that the arguments describe, for the size of the photo.
fn described_camera(arguments: &ProjectArguments) -> Result<Camera, Failure> {
    let (width, height) = dimensions(&arguments.image)?;
    if width < 2 || height < 2 {
        return Err(Failure::input(format!(
            "{}: {width} × {height} px is too small for a photo",
            printed(&arguments.image)
        )));
    }
    let mut camera = Camera::from_vertical_fov(width, height, arguments.fov_deg.to_radians());
    if let Some(focal_px) = arguments.focal_px {
        (camera.fx, camera.fy) = (focal_px, focal_px);
    }
    Ok(camera)
}

fn dimensions(path: &Path) -> Result<(u32, u32), Failure> {
    let fail = |what: String| Failure::input(format!("{}: {what}", printed(path)));
    let decoder = open_picture(path).map_err(|error| fail(error.to_string()))?;
    Ok(decoder.dimensions())
}
