//! Frames of the test wall as pictures of 8 bits.

use crate::sampling::picture::Picture;
use crate::sampling::picture_cache::PictureCache;
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
    let (width, height) = (wall.camera.width as usize, wall.camera.height as usize);
    let samples = wall.samples(change).into_iter();
    let pictures = samples.map(|samples| Picture::new(width, height, 1, samples));
    PictureCache::from_pictures(wall.camera, pictures.collect())
}
