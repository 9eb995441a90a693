//! Calibration files of every kind; the first byte chooses the ending of the name.
#![no_main]

use libfuzzer_sys::fuzz_target;

const ENDINGS: [&str; 4] = ["json", "toml", "yaml", "txt"];

fuzz_target!(|data: &[u8]| {
    let Some((first, content)) = data.split_first() else {
        return;
    };
    let ending = ENDINGS[usize::from(*first) % ENDINGS.len()];
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(format!("camera.{ending}"));
    std::fs::write(&path, content).unwrap();
    if let Ok(camera) = tunnelstitch::camera::read_calibration(&path, None) {
        // What is read is a camera that can be used and written.
        let _ = camera.border(4, 0.5);
        let text = tunnelstitch::camera::format_calibration(&camera);
        let own = folder.path().join("own.json");
        std::fs::write(&own, text).unwrap();
        assert_eq!(tunnelstitch::camera::read_calibration(&own, None).unwrap(), camera);
    }
});
