//! The pictures: loading, grey values, pyramids, writing.

mod grey;
mod load;
mod pyramid;
mod write;

pub use grey::GreyImage;
pub use load::{FrameError, FrameFile, list, load_colour, load_grey};
pub use pyramid::Pyramid;
pub use write::{FormatError, PictureFormat, write_picture};
