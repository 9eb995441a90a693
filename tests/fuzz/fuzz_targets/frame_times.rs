//! Times of frames, with and without the frames.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tunnelstitch::survey::{Survey, read_frame_times};
use tunnelstitch_fuzz::{file, small_survey};

fuzz_target!(|data: &[u8]| {
    let (_folder, path) = file("times.txt", data);
    if let Ok(times) = read_frame_times(&path) {
        assert!(times.iter().all(|time| time.is_finite()));
        let _ = Survey::open_with(small_survey(), |survey| survey.frames.times = Some(path));
    }
});
