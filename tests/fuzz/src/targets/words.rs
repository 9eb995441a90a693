//! Options with a syntax of their own.

use std::path::Path;
use tunnelstitch::progress::Silent;
use tunnelstitch::simulate::{BadFrames, SimulateOptions, write_survey};
use tunnelstitch::trajectory::gyro::Orientation;

/// Reads the input.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return;
    };
    if let Ok(orientation) = Orientation::parse(text) {
        let _ = (orientation.to_camera(), orientation.is_mirror());
    }
    if let Ok(bad) = text.parse::<BadFrames>() {
        assert_eq!(bad.to_string().parse::<BadFrames>().unwrap(), bad);
        let options = SimulateOptions {
            frames: 4,
            // Refused after the frames have been read.
            noise_grey: -1.0,
            bad_frames: bad,
            ..SimulateOptions::free()
        };
        assert!(write_survey(&options, Path::new("/dev/null/none"), false, &Silent).is_err());
    }
}
