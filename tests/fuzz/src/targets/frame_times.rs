//! Times of frames, with and without the frames.

use super::super::{file, small_survey};
use tunnelstitch::survey::{Survey, read_frame_times};

/// Reads the input.
pub fn run(data: &[u8]) {
    let (_folder, path) = file("times.txt", data);
    if let Ok(times) = read_frame_times(&path) {
        assert!(times.iter().all(|time| time.is_finite()));
        let _ = Survey::open_with(small_survey(), |survey| survey.frames.times = Some(path));
    }
}
