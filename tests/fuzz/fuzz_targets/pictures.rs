//! Pictures: as a frame, as a mask, and as a wall's texture.
#![no_main]

use libfuzzer_sys::fuzz_target;
use tunnelstitch::frames::{FrameFile, Mask, colour_type, load_colour};
use tunnelstitch_fuzz::file;

fuzz_target!(|data: &[u8]| {
    let (_folder, path) = file("picture", data);
    let frame = FrameFile::picture(0, path.clone());
    let _ = colour_type(&frame);
    if let Ok((width, height)) = frame.size() {
        let _ = Mask::read(&path, width.min(64), height.min(64));
    }
    if let Ok(picture) = load_colour(&frame, 8, 6) {
        assert_eq!((picture.width(), picture.height()), (8, 6));
    }
});
