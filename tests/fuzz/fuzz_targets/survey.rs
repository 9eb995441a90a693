//! survey.toml, with the files of a small survey beside it.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tunnelstitch::survey::Survey;
use tunnelstitch_fuzz::small_survey;

fuzz_target!(|data: &[u8]| {
    let path = small_survey().join("fuzzed.toml");
    std::fs::write(&path, data).unwrap();
    if let Ok(survey) = Survey::open(&path) {
        assert_eq!(survey.initial.len(), survey.frames.len());
        let _ = survey.pose_convention_variants(2);
    }
});
