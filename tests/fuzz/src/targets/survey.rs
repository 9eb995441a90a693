//! survey.toml, with the files of a small survey beside it.

use super::super::small_survey;
use tunnelstitch::survey::Survey;

/// Reads the input.
pub fn run(data: &[u8]) {
    let path = small_survey().join("fuzzed.toml");
    std::fs::write(&path, data).unwrap();
    if let Ok(survey) = Survey::open(&path) {
        assert_eq!(survey.initial.len(), survey.frames.len());
        let _ = survey.pose_readings();
    }
}
