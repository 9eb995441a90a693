//! Frames of the test wall as pictures of 8 bits, for tests.

use tunnelstitch_core::test_wall::TestWall;
use tunnelstitch_render::{Picture, PictureCache};

/// The frames of a wall as 8-bit pictures.
pub fn pictures(wall: &TestWall) -> PictureCache {
    let (width, height) = (wall.camera.width as usize, wall.camera.height as usize);
    let samples = wall.samples(|_, _, _, value| value).into_iter();
    let pictures = samples.map(|samples| Picture::new(width, height, 1, samples));
    PictureCache::from_pictures(wall.camera, pictures.collect())
}
