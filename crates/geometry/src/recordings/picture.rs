//! Images: `sensor_msgs/Image` and `sensor_msgs/CompressedImage`.

use super::stamp::Header;
use super::topic::{MessageKind, Wire};

/// An image of a recording.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RecordedPicture<'a> {
    /// Pixels.
    Raw(RawPicture<'a>),
    /// A picture file.
    Compressed(CompressedPicture<'a>),
}

/// `sensor_msgs/Image`: `height`, `width`, `encoding`, `is_bigendian`, `step`, `data`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawPicture<'a> {
    /// Height, pixels.
    pub height: u32,
    /// Width, pixels.
    pub width: u32,
    /// Name of the pixels' channels, their order and bits (`sensor_msgs/image_encodings`).
    pub encoding: &'a str,
    /// True if numbers of several bytes have their highest first.
    pub is_big_endian: bool,
    /// Bytes from one row to the next.
    pub step: u32,
    /// The rows.
    pub data: &'a [u8],
}

/// `sensor_msgs/CompressedImage`: `format`, `data`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompressedPicture<'a> {
    /// The format, such as `jpeg` or `rgb8; png compressed bgr8`.
    pub format: &'a str,
    /// The picture file.
    pub data: &'a [u8],
}

impl<'a> RecordedPicture<'a> {
    /// Reads a message of a topic of images.
    ///
    /// # Errors
    /// A message that ends too early, or is no image, in words.
    pub fn read(message: &'a [u8], (kind, wire): (MessageKind, Wire)) -> Result<Self, String> {
        let mut fields = wire.fields(message)?;
        Header::read(&mut fields, wire)?;
        match kind {
            MessageKind::Image => {
                let (height, width) = (fields.u32()?, fields.u32()?);
                Ok(Self::Raw(RawPicture {
                    height,
                    width,
                    encoding: fields.text()?,
                    is_big_endian: fields.u8()? != 0,
                    step: fields.u32()?,
                    data: fields.byte_list()?,
                }))
            }
            MessageKind::CompressedImage => Ok(Self::Compressed(CompressedPicture {
                format: fields.text()?,
                data: fields.byte_list()?,
            })),
            _ => Err("a message that is no image".to_owned()),
        }
    }
}
