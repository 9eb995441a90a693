//! The size of the pictures, for files that do not state it.

use super::error::ParseError;

/// Width and height of the pictures, pixels, if anything tells them.
pub type PictureSize<'a> = &'a dyn Fn() -> Option<[u32; 2]>;

/// The size of the pictures.
///
/// # Errors
/// None is known.
pub fn needed(size: PictureSize) -> Result<[u32; 2], ParseError> {
    size().ok_or_else(|| {
        ParseError::new(
            "this file has no size of its pictures, and there is no picture to take it from: name \
             the frames under [frames], or write a camera.json with the size",
        )
    })
}
