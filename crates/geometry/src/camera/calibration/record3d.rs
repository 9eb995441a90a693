//! Record3D's `metadata`: `w`, `h` and the camera matrix `K`, column by column.

use super::error::ParseError;
use super::value_tree::{needed, numbers, pixels};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use serde_json::Value;

/// True for a file with `K`, `w`, `h` and `poses`.
pub fn is_metadata(tree: &Value) -> bool {
    ["K", "w", "h", "poses"]
        .iter()
        .all(|name| tree.get(name).is_some())
}

/// Reads `w`, `h` and `K`; ARKit's pictures have no distortion.
pub fn read(tree: &Value) -> Result<Camera, ParseError> {
    let [fx, _, _, _, fy, _, cx, cy, _] = numbers(needed(tree, "K")?, "K")?[..] else {
        return Err(ParseError::new("`K` must have nine numbers"));
    };
    let size = [pixels(tree, &["w"])?, pixels(tree, &["h"])?];
    Ok(Camera::at_rest(size, [fx, fy], [cx, cy], Lens::default()))
}
