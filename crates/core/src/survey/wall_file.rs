//! Common parts of the files of a wall that lie beside poses: shape.json and masked.json.

use super::error::SurveyError;
use serde::de::DeserializeOwned;
use std::path::Path;
use tunnelstitch_geometry::files::limits::MAX_WALL_BYTES;
use tunnelstitch_geometry::files::read_text;
use tunnelstitch_geometry::surface::WallPoint;

/// Largest difference between the perimeter of a file and that of the tunnel, relative.
const MAX_PERIMETER_ERROR: f64 = 1e-6;

/// Reads a JSON file of `what`; `check` returns what is wrong with it.
///
/// # Errors
/// [`SurveyError::Value`] that names the file and what is wrong.
pub fn read_wall_file<T: DeserializeOwned>(
    path: &Path,
    what: &str,
    check: impl FnOnce(&T) -> Result<(), String>,
) -> Result<T, SurveyError> {
    let value = |what: String| SurveyError::Value {
        path: path.to_owned(),
        what,
    };
    let text = read_text(path, MAX_WALL_BYTES)
        .map_err(|error| value(format!("cannot read {what}: {error}")))?;
    let file: T = serde_json::from_str(&text).map_err(|error| value(error.to_string()))?;
    check(&file).map_err(value)?;
    Ok(file)
}

/// Checks the name and version of a format; returns what is wrong.
pub fn check_format(format: &str, expected: &str) -> Result<(), String> {
    match format == expected {
        true => Ok(()),
        false => Err(format!("format is {format:?}; it must be {expected:?}")),
    }
}

/// Checks that `what`, of the perimeter `own_m`, is of the tunnel of the given perimeter, metres;
/// returns what is wrong.
pub fn check_perimeter(own_m: f64, tunnel_m: f64, what: &str) -> Result<(), String> {
    let ratios = 1.0 - MAX_PERIMETER_ERROR..1.0 + MAX_PERIMETER_ERROR;
    match ratios.contains(&(own_m / tunnel_m)) {
        true => Ok(()),
        false => Err(format!(
            "perimeter_m is {own_m}, that of the tunnel {tunnel_m}; {what} is of another tunnel"
        )),
    }
}

/// Checks the origin of a lattice; returns what is wrong.
pub fn check_origin(origin: WallPoint) -> Result<(), String> {
    match origin.s_m.is_finite() && origin.h_m.is_finite() {
        true => Ok(()),
        false => Err("origin is not finite".to_owned()),
    }
}
