//! Frames of the test wall as pictures of 8 bits, for tests.

use tunnelstitch_core::test_wall::TestWall;
use tunnelstitch_render::{Picture, PictureCache};

/// The frames of a wall as 8-bit pictures.
pub fn pictures(wall: &TestWall) -> PictureCache {
    let frames = wall.frames().into_iter().map(|frame| {
        let samples: Vec<u8> = frame
            .data()
            .iter()
            .map(|value| value.round() as u8)
            .collect();
        Picture::new(frame.width(), frame.height(), 1, samples)
    });
    PictureCache::from_pictures(wall.camera, frames.collect())
}
