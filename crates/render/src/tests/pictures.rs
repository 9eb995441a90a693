//! Frames of the test wall as pictures of 8 bits.

use crate::sampling::picture::Picture;
use crate::sampling::picture_cache::PictureCache;
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_core::test_wall::TestWall;

/// The frames of a wall as 8-bit pictures.
pub fn pictures(wall: &TestWall) -> PictureCache {
    changed_pictures(wall, |_, _, _, value| value)
}

/// The frames of a wall as 8-bit pictures, each pixel changed by `change(frame, u, v, value)`.
pub fn changed_pictures(
    wall: &TestWall,
    change: impl Fn(usize, usize, usize, f32) -> f32,
) -> PictureCache {
    let picture = |(k, frame): (usize, GreyImage)| {
        let width = frame.width();
        let value = |(at, v): (usize, &f32)| change(k, at % width, at / width, *v).round() as u8;
        let data: Vec<u8> = frame.data().iter().enumerate().map(value).collect();
        Picture::new(width, frame.height(), 1, data)
    };
    let pictures = wall.frames().into_iter().enumerate().map(picture);
    PictureCache::from_pictures(wall.camera, pictures.collect())
}
