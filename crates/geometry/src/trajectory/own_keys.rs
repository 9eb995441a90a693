//! Keys of poses in JSON and YAML of people's own, and the values under them.

use serde_json::Value;

/// Matrices of the motion from camera to world, or, where nothing says so, of a pose.
pub(super) const MATRICES: &[&str] = &[
    "matrix",
    "t",
    "pose",
    "transform",
    "transformation",
    "transformationmatrix",
    "extrinsic",
    "extrinsics",
    "camerapose",
    "c2w",
    "cam2world",
    "camtoworld",
    "camera2world",
    "cameratoworld",
    "twc",
    "tworldcam",
    "tworldcamera",
];
/// Matrices of the motion from world to camera.
pub(super) const INVERSE_MATRICES: &[&str] = &[
    "w2c",
    "world2cam",
    "worldtocam",
    "world2camera",
    "worldtocamera",
    "tcw",
    "tcamworld",
    "tcameraworld",
];
/// Positions.
pub(super) const POSITIONS: &[&str] = &["position", "translation", "location", "t", "xyz", "pos"];
/// Rotations.
pub(super) const ROTATIONS: &[&str] = &[
    "quaternion",
    "quaternionwxyz",
    "quaternionxyzw",
    "orientation",
    "orientationwxyz",
    "orientationxyzw",
    "rotation",
    "rotationmatrix",
    "quat",
    "quatwxyz",
    "quatxyzw",
    "q",
    "qwxyz",
    "qxyzw",
    "r",
    "rot",
];
/// Names of frames.
pub(super) const NAMES: &[&str] = &[
    "image",
    "imagename",
    "imagepath",
    "file",
    "filename",
    "filepath",
    "frame",
    "framename",
    "name",
    "photo",
    "path",
    "img",
];
/// Times.
pub(super) const TIMES: &[&str] = &["timestamp", "time", "stamp", "times", "timestamps"];
/// Numbers of frames.
pub(super) const COUNTERS: &[&str] = &["frame", "index", "frameindex", "frameid", "id"];
/// Components of a position.
pub(super) const XYZ: &[&[&str]] = &[&["x", "tx", "px"], &["y", "ty", "py"], &["z", "tz", "pz"]];
/// Components of a quaternion.
pub(super) const WXYZ: &[&[&str]] = &[&["w", "qw"], &["x", "qx"], &["y", "qy"], &["z", "qz"]];
/// Components of a quaternion beside those of a position.
pub(super) const INLINE_WXYZ: &[&[&str]] = &[&["qw"], &["qx"], &["qy"], &["qz"]];

/// A value with its key, of which small letters and digits are left.
pub(super) struct Keyed<'a> {
    /// The key.
    pub key: String,
    /// The value.
    pub value: &'a Value,
}

/// The first entry of an object under one of the names.
pub(super) fn find<'a>(value: &'a Value, names: &[&str]) -> Option<Keyed<'a>> {
    let entries = value.as_object()?.iter();
    let mut keyed = entries.map(|(key, value)| Keyed {
        key: plain(key),
        value,
    });
    keyed.find(|entry| names.contains(&entry.key.as_str()))
}

/// A key in small letters, without signs between its words.
fn plain(key: &str) -> String {
    let signs = key.chars().filter(|c| c.is_ascii_alphanumeric());
    signs.map(|c| c.to_ascii_lowercase()).collect()
}

/// The text under one of the names.
pub(super) fn text(value: &Value, names: &[&str]) -> Option<String> {
    find(value, names)?.value.as_str().map(str::to_owned)
}

/// The number under one of the names.
pub(super) fn number(value: &Value, names: &[&str]) -> Option<f64> {
    find(value, names)?.value.as_f64()
}

/// The number or text under one of the names, as it is written.
pub(super) fn word(value: &Value, names: &[&str]) -> Option<String> {
    match find(value, names)?.value {
        Value::String(text) => Some(text.clone()),
        Value::Number(number) => Some(number.to_string()),
        _ => None,
    }
}

/// The numbers of a list, or of a list of rows; None if anything else is in it.
pub(super) fn numbers(value: &Value) -> Option<Vec<f64>> {
    let rows = value.as_array()?.iter().map(|item| match item {
        Value::Array(row) => row.iter().map(Value::as_f64).collect(),
        other => other.as_f64().map(|number| vec![number]),
    });
    Some(rows.collect::<Option<Vec<Vec<f64>>>>()?.concat())
}

/// The numbers of an object under names, one of each list.
pub(super) fn components(value: &Value, names: &[&[&str]]) -> Option<Vec<f64>> {
    names.iter().map(|names| number(value, names)).collect()
}

/// The numbers of a list, or the components of an object.
pub(super) fn numbers_or_components(value: &Value, names: &[&[&str]]) -> Option<Vec<f64>> {
    numbers(value).or_else(|| components(value, names))
}
