//! Frames: reading, grey images, pyramids, masks, static pixels, noise and writing of pictures.

mod cache;
mod combing;
mod counter_overrun;
mod decode;
mod error;
mod exif_time;
mod frame_file;
mod frame_set;
mod grey;
mod hash;
mod lamp;
mod light;
mod local_contrast;
mod local_normalisation;
mod mask;
mod masks;
mod noise;
mod picture_decoder;
mod picture_end;
mod picture_reading;
mod pyramid;
mod recorded_images;
mod recorded_pixels;
mod shading;
mod static_pixels;
mod stored_frame;
mod tiff_stack;
mod unmatched_pattern;
mod unread_format;
mod used_bits;
mod video;
mod windows;
mod write;

pub use cache::FrameCache;
pub use combing::{CombAxis, comb_ratio};
pub use decode::{colour_type, load_colour};
pub use error::FrameError;
pub use frame_file::{FrameFile, list_frames};
pub use frame_set::FrameSet;
pub use grey::GreyImage;
pub use hash::hash_frames;
pub use lamp::{Falloff, Lamp, TERMS as LAMP_TERMS};
pub use light::{CameraLight, Light};
pub use local_contrast::{LocalContrast, local_contrast, mask_outliers};
pub use local_normalisation::normalise_locally;
pub use mask::{Mask, PyramidMask};
pub use masks::Masks;
pub use noise::{NoiseMeasurement, PictureNoise, noise_at_level, noise_sigma};
pub use picture_decoder::open_picture;
pub use picture_reading::{PictureOrientation, PictureReading};
pub use pyramid::Pyramid;
pub use recorded_images::RecordedImages;
pub use shading::{MeanShading, Shading, TERMS as SHADING_TERMS, terms as shading_terms};
pub use static_pixels::{
    MotionCell, MotionField, StaticPixels, TemporalStatistics, find_static_pixels,
};
pub use stored_frame::StoredFrame;
pub(crate) use unread_format::RAW_EXTENSIONS;
pub use unread_format::UnreadFormat;
pub use used_bits::{UNUSED_UPPER_BITS, brightest_bits};
pub use video::Video;
pub use write::{
    FormatError, JPEG_LIMIT_PX, JPEG_QUALITY, PictureFormat, add_picture, write_picture,
};
