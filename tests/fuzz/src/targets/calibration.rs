//! Calibration files of every kind; the first byte selects the extension.

use super::super::file;
use tunnelstitch::camera::{
    ColmapCamera, format_calibration, read_calibration, read_calibration_of,
};

const ENDINGS: [&str; 9] = [
    "json", "toml", "yaml", "txt", "bin", "xml", "out", "csv", "cam",
];

/// Reads the input.
pub fn run(data: &[u8]) {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let ending = ENDINGS[usize::from(*first) % ENDINGS.len()];
    let (_folder, path) = file(&format!("camera.{ending}"), content);
    let _ = read_calibration(&path, Some("cam0"));
    if let Ok(camera) = read_calibration_of(&path, None, &|| Some([640, 480])) {
        // A camera that was read can be used and written.
        let _ = camera.border(4, 0.5);
        let _ = ColmapCamera::of(&camera).map(|colmap| colmap.cameras_txt());
        let (_folder, own) = file("own.json", format_calibration(&camera).as_bytes());
        assert_eq!(read_calibration(&own, None).unwrap(), camera);
    }
}
