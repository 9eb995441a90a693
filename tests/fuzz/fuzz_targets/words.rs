//! Options with a syntax of their own.
#![no_main]

use libfuzzer_sys::fuzz_target;
use std::path::Path;
use tunnelstitch::progress::Silent;
use tunnelstitch::simulate::{BadFrames, SimulateOptions, write_survey};
use tunnelstitch::trajectory::gyro::Orientation;

fuzz_target!(|text: &str| {
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
});
