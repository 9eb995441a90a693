//! The pictures: loading, grey values, pyramids.

mod grey;
mod load;
mod pyramid;

pub use grey::GreyImage;
pub use load::{FrameError, FrameFile, list, load_colour, load_grey};
pub use pyramid::Pyramid;
