//! The choice of a reader by the name of the file.

use super::error::PointsError;
use super::point_visitor::{PointCount, PointVisitor};
use super::{las, pcd, ply, xyz};
use nalgebra::Vector3;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;
use tunnelstitch_geometry::files::{is_standard_input, open_regular};

/// Reads a file of points, in the order of the file: `visit` gets one after another, metres. The
/// extension decides about the format: `ply`, `las`, `laz`, `pcd`, or `xyz`, `txt`, `csv`, `asc`
/// and `pts` for text, which standard input has.
///
/// # Errors
/// [`PointsError`] that names the file, the line or the point, and the remedy: another extension, a
/// file without points, cut off or damaged, coordinates that are not finite.
pub fn read_points(
    path: &Path,
    visit: &mut dyn FnMut(Vector3<f64>),
) -> Result<PointCount, PointsError> {
    let extension = path.extension().unwrap_or_default();
    let extension = match is_standard_input(path) {
        true => "txt".to_owned(),
        false => extension.to_string_lossy().to_ascii_lowercase(),
    };
    let mut visitor = PointVisitor::new(path, visit);
    match extension.as_str() {
        "ply" => ply::read(&mut open(path)?, &mut visitor)?,
        "las" | "laz" => las::read(open(path)?, &mut visitor)?,
        "pcd" => {
            let bytes = file_size(path)?;
            pcd::read(&mut open(path)?, bytes, &mut visitor)?;
        }
        "xyz" | "txt" | "csv" | "asc" | "pts" => xyz::read(&mut open(path)?, &mut visitor)?,
        _ => {
            return Err(PointsError::file(
                path,
                "is no file of points by its name; supported are .ply, .las, .laz, .pcd, and text \
                 with x y z in each line as .xyz, .txt, .csv, .asc or .pts",
            ));
        }
    }
    let count = visitor.count;
    if count.read == 0 {
        return Err(PointsError::file(path, "has no points"));
    }
    Ok(count)
}

/// Opens a file for reading.
fn open(path: &Path) -> Result<BufReader<File>, PointsError> {
    let file = open_regular(path);
    let file = file.map_err(|error| PointsError::file(path, format!("cannot be read: {error}")))?;
    Ok(BufReader::with_capacity(1 << 18, file))
}

/// Size of a file, bytes.
fn file_size(path: &Path) -> Result<u64, PointsError> {
    let data = std::fs::metadata(path);
    let data = data.map_err(|error| PointsError::file(path, format!("cannot be read: {error}")))?;
    Ok(data.len())
}
