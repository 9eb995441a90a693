//! The pictures: loading, grey values, pyramids, writing.

mod cache;
mod contrast;
mod grey;
mod load;
mod mask;
mod noise;
mod pyramid;
mod set;
mod shading;
mod stored;
mod video;
mod write;

pub use cache::FrameCache;
pub use contrast::{LocalContrast, local_contrast, usual};
pub use grey::GreyImage;
pub use load::{FrameError, FrameFile, colour_type, list, load_colour};
pub use mask::{HalvedMask, Mask};
pub(crate) use noise::MAD_TO_SIGMA;
pub use noise::{noise_at_level, noise_sigma};
pub use pyramid::Pyramid;
pub use set::FrameSet;
pub use shading::{Shading, TERMS as SHADING_TERMS, terms as shading_terms};
pub use stored::StoredFrame;
pub use video::Video;
pub use write::{FormatError, JPEG_LIMIT_PX, JPEG_QUALITY, PictureFormat, write_picture};
