//! Output of ffprobe. `tests/fuzz/stand_in` must come first in PATH: its ffprobe prints the content
//! of the file.

use super::super::file;
use std::sync::Once;
use tunnelstitch::frames::Video;

static STOOD_IN: Once = Once::new();
const SOUND: &[u8] = br#"{"packets": [{"pts": 0, "flags": "K_"}],
 "streams": [{"width": 64, "height": 48, "pix_fmt": "yuv420p", "time_base": "1/600"}]}"#;

/// Reads the input.
pub fn run(data: &[u8]) {
    let open = |bytes: &[u8]| {
        let (_folder, path) = file("video.mp4", bytes);
        Video::open(&path)
    };
    STOOD_IN.call_once(|| {
        assert!(
            open(SOUND).is_ok(),
            "put tests/fuzz/stand_in first into PATH"
        )
    });
    if let Ok(video) = open(data) {
        assert!((0..video.pictures()).all(|picture| video.time_s(picture).is_finite()));
    }
}
