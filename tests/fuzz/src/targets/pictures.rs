//! Pictures as frames and as masks.

use super::super::file;
use tunnelstitch::frames::{FrameFile, Mask, UnreadFormat, colour_type, load_colour};

/// Larger ones only cost time.
const MAX_PX: u32 = 1 << 16;

/// Reads the input.
pub fn run(data: &[u8]) {
    let (_folder, path) = file("picture", data);
    let frame = FrameFile::picture(0, path.clone());
    let _ = colour_type(&frame);
    let _ = UnreadFormat::of(&path).map(|format| format.remedy(&path));
    let Ok((width, height)) = frame.size() else {
        return;
    };
    let (width, height) = match width.saturating_mul(height) <= MAX_PX {
        true => (width, height),
        // Refused, before it is decoded.
        false => (8, 6),
    };
    let _ = Mask::read(&path, width, height);
    if let Ok(picture) = load_colour(&frame, width, height) {
        assert_eq!((picture.width(), picture.height()), (width, height));
    }
}
