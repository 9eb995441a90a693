//! Decoding of frames.

use super::error::FrameError;
use super::exif_time::time_s;
use super::frame_file::{FrameFile, FrameSource};
use super::picture_decoder::{Content, Input, decoder, open_input};
use super::picture_end::{is_jpeg, jpeg_is_complete, page_truncation, truncated, truncation};
use super::picture_reading::{PictureOrientation, PictureReading};
use super::recorded_images::{RecordedImage, RecordedImages};
use super::tiff_stack::PageFile;
use image::metadata::Orientation;
use image::{ColorType, DynamicImage, GrayImage, ImageDecoder, ImageError, RgbImage};
use std::io::{self, BufReader};
use std::path::Path;

impl FrameFile {
    /// Width and height, pixels, from the file's header; those of the picture as it is read.
    ///
    /// # Errors
    /// A missing or unknown file.
    pub fn size(&self) -> Result<(u32, u32), FrameError> {
        match &self.source {
            FrameSource::Video(video, _) => Ok(video.size()),
            FrameSource::Memory(picture) => Ok((picture.width(), picture.height())),
            FrameSource::Recording(images, image, reading) => {
                let read = self.recorded(images, *image)?;
                let (size, named) = match read {
                    RecordedImage::Pixels(pixels) => {
                        ((pixels.width(), pixels.height()), Orientation::NoTransforms)
                    }
                    RecordedImage::File(content) => {
                        let mut header = self.content_header(&content)?;
                        (header.dimensions(), orientation(&mut header))
                    }
                };
                Ok(turned_size(size, reading.orientation.turn(named)))
            }
            FrameSource::File(reading) | FrameSource::Page(_, _, reading) => {
                let mut header = self.header()?;
                let turn = reading.orientation.turn(orientation(&mut header));
                Ok(turned_size(header.dimensions(), turn))
            }
        }
    }

    /// Examines the start and the end of the file: a picture of this size, and all of it.
    ///
    /// # Errors
    /// A missing, truncated or unknown file; a size other than `(width, height)`.
    pub fn examine(&self, width: u32, height: u32) -> Result<(), FrameError> {
        self.check_size(self.size()?, (width, height))?;
        let truncation = match &self.source {
            FrameSource::File(_) => truncation(&self.path),
            FrameSource::Page(stack, directory, _) => page_truncation(stack, *directory),
            _ => return Ok(()),
        };
        match truncation {
            Ok(None) => Ok(()),
            Ok(Some(what)) => Err(self.decode_error(what)),
            Err(error) => Err(self.decode_error(error.to_string())),
        }
    }

    /// True unless the end of its picture file is missing, as while it is written.
    pub fn is_whole(&self) -> bool {
        !matches!(self.source, FrameSource::File(_)) || matches!(truncation(&self.path), Ok(None))
    }

    /// Refuses another size than that of the calibration.
    fn check_size(&self, found: (u32, u32), expected: (u32, u32)) -> Result<(), FrameError> {
        if found == expected {
            return Ok(());
        }
        if self.unread_format().is_some() {
            // What was read is a small picture beside the frame.
            return Err(self.decode_error(String::new()));
        }
        Err(FrameError::Size {
            index: self.index,
            path: self.path.clone(),
            width: found.0,
            height: found.1,
            expected_width: expected.0,
            expected_height: expected.1,
        })
    }

    /// The number of the EXIF orientation by which a picture file is to be turned or mirrored for
    /// display, if it is.
    ///
    /// # Errors
    /// A missing or unknown file.
    pub fn exif_orientation(&self) -> Result<Option<u8>, FrameError> {
        let named = match &self.source {
            FrameSource::File(_) | FrameSource::Page(..) => orientation(&mut self.header()?),
            FrameSource::Recording(images, image, _) => match self.recorded(images, *image)? {
                RecordedImage::Pixels(_) => return Ok(None),
                RecordedImage::File(content) => orientation(&mut self.content_header(&content)?),
            },
            FrameSource::Video(..) | FrameSource::Memory(_) => return Ok(None),
        };
        Ok((named != Orientation::NoTransforms).then(|| named.to_exif()))
    }

    /// The time of the exposure in the EXIF data of a picture file, seconds since 1970, of UTC if
    /// they name no zone of time; None if there is none.
    pub fn exif_time_s(&self) -> Option<f64> {
        match &self.source {
            FrameSource::File(_) => time_s(&self.header().ok()?.exif_metadata().ok()??),
            _ => None,
        }
    }

    /// Reads an image of a recording.
    fn recorded(&self, images: &RecordedImages, image: usize) -> Result<RecordedImage, FrameError> {
        images.read(image).map_err(|what| self.decode_error(what))
    }

    /// The decoder of a picture file in a recording after reading its header.
    fn content_header(&self, content: &Content) -> Result<impl ImageDecoder, FrameError> {
        decoder(content.input()).map_err(|error| self.picture_error(&error))
    }

    /// The decoder of a picture file, or a page of one, after reading its header.
    fn header(&self) -> Result<impl ImageDecoder, FrameError> {
        let input = match &self.source {
            FrameSource::Page(stack, directory, _) => page_input(stack, *directory),
            _ => open_input(&self.path),
        };
        let input = input.map_err(ImageError::IoError);
        input
            .and_then(decoder)
            .map_err(|error| self.picture_error(&error))
    }
}

/// The input of a page of a TIFF file.
fn page_input(stack: &Path, directory: u64) -> io::Result<Input> {
    Ok(Input::Page(BufReader::new(PageFile::open(
        stack, directory,
    )?)))
}

/// The EXIF orientation; none if the file has none that can be read.
fn orientation(decoder: &mut impl ImageDecoder) -> Orientation {
    decoder.orientation().unwrap_or(Orientation::NoTransforms)
}

/// The size of a picture after a turn.
fn turned_size((width, height): (u32, u32), turn: Orientation) -> (u32, u32) {
    use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
    match turn {
        Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH => (height, width),
        _ => (width, height),
    }
}

/// Decodes a frame and checks its size.
///
/// # Errors
/// A missing, truncated or unknown file; a size other than `(width, height)`.
pub fn load_colour(file: &FrameFile, width: u32, height: u32) -> Result<DynamicImage, FrameError> {
    let check = |found| file.check_size(found, (width, height));
    let fail = |what: String| file.decode_error(what);
    let reading = match &file.source {
        FrameSource::Video(video, picture) => {
            check(video.size())?;
            return video.decode(*picture).map_err(fail);
        }
        FrameSource::Memory(picture) => {
            check((picture.width(), picture.height()))?;
            return Ok(DynamicImage::clone(picture));
        }
        FrameSource::Recording(images, image, reading) => {
            return match file.recorded(images, *image)? {
                RecordedImage::File(content) => {
                    decode_file(file, &content, reading, (width, height))
                }
                RecordedImage::Pixels(mut picture) => {
                    picture.apply_orientation(reading.orientation.turn(Orientation::NoTransforms));
                    check((picture.width(), picture.height()))?;
                    reading.scale(picture).map_err(fail)
                }
            };
        }
        FrameSource::Page(stack, directory, reading) => {
            let input = || page_input(stack, *directory);
            return decode_input(file, input, reading, (width, height));
        }
        FrameSource::File(reading) => reading,
    };
    let content =
        Content::of(&file.path, width, height).map_err(|error| fail(error.to_string()))?;
    decode_file(file, &content, reading, (width, height))
}

/// Decodes the content of a frame's picture file, and checks its size.
///
/// # Errors
/// The errors of [`load_colour`].
fn decode_file(
    file: &FrameFile,
    content: &Content,
    reading: &PictureReading,
    (width, height): (u32, u32),
) -> Result<DynamicImage, FrameError> {
    let bytes = content.as_ref();
    if is_jpeg(bytes) && !jpeg_is_complete(bytes) {
        return Err(file.decode_error(truncated("JPEG")));
    }
    decode_input(file, || Ok(content.input()), reading, (width, height))
}

/// Decodes what `input` gives, from its start, and checks its size.
///
/// # Errors
/// The errors of [`load_colour`].
fn decode_input(
    file: &FrameFile,
    input: impl Fn() -> io::Result<Input>,
    reading: &PictureReading,
    (width, height): (u32, u32),
) -> Result<DynamicImage, FrameError> {
    let check = |found| file.check_size(found, (width, height));
    let fail = |what: String| file.decode_error(what);
    let open = || input().map_err(|error| fail(error.to_string()));
    if reading.orientation == PictureOrientation::Stored
        && let Some(picture) = plain_tiff(open()?, width, height)
    {
        return Ok(picture);
    }
    let refuse = |error| file.picture_error(&error);
    let mut decoder = decoder(open()?).map_err(refuse)?;
    let turn = reading.orientation.turn(orientation(&mut decoder));
    // Checked before allocating the memory that the header claims.
    check(turned_size(decoder.dimensions(), turn))?;
    let mut picture = DynamicImage::from_decoder(decoder).map_err(refuse)?;
    picture.apply_orientation(turn);
    reading.scale(picture).map_err(fail)
}

/// Decodes an uncompressed TIFF file of this size with 8 bits per channel; None for any other or
/// damaged file. The general decoder makes two intermediate copies.
fn plain_tiff(input: Input, width: u32, height: u32) -> Option<DynamicImage> {
    let mut decoder = tiff::decoder::Decoder::new(input).ok()?;
    if decoder.dimensions().ok()? != (width, height) {
        return None;
    }
    let (colour, layout) = (
        decoder.colortype().ok()?,
        decoder.image_buffer_layout().ok()?,
    );
    let channels = match colour {
        tiff::ColorType::Gray(8) => 1,
        tiff::ColorType::RGB(8) => 3,
        _ => return None,
    };
    let size = width as usize * height as usize * channels;
    let unsigned = layout.sample_format == tiff::tags::SampleFormat::Uint;
    if !unsigned || layout.planes != 1 || layout.complete_len != size {
        return None;
    }
    let mut samples = vec![0; size];
    decoder.read_image_bytes(&mut samples).ok()?;
    match channels {
        1 => GrayImage::from_raw(width, height, samples).map(Into::into),
        _ => RgbImage::from_raw(width, height, samples).map(Into::into),
    }
}

/// The colour type of a frame's pixels, from the file's header.
///
/// # Errors
/// A missing or unknown file.
pub fn colour_type(file: &FrameFile) -> Result<ColorType, FrameError> {
    match &file.source {
        FrameSource::Video(video, _) => Ok(video.colour()),
        FrameSource::Memory(picture) => Ok(picture.color()),
        FrameSource::Recording(images, image, _) => match file.recorded(images, *image)? {
            RecordedImage::Pixels(pixels) => Ok(pixels.color()),
            RecordedImage::File(content) => Ok(file.content_header(&content)?.color_type()),
        },
        FrameSource::File(_) | FrameSource::Page(..) => Ok(file.header()?.color_type()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::mask::Mask;

    /// The beginning of a PNG file whose header claims 60000 × 60000 pixels.
    const BOAST: &[u8] =
        b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\xea`\0\0\xea`\x08\0\0\0\0\xa5\xb9*\x9e\
        \0\0\0\x09IDATx\x9cc\0\0\0\x01\0\x01^\xff}\xf9";

    #[test]
    fn no_room_is_made_for_what_only_a_header_claims() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("boast.png");
        std::fs::write(&path, BOAST).unwrap();
        let frame = FrameFile::picture(0, path.clone());
        assert_eq!(frame.size().unwrap(), (60000, 60000));
        let refused = load_colour(&frame, 32, 24).unwrap_err();
        assert!(matches!(refused, FrameError::Size { .. }), "{refused}");
        let refused = Mask::read(&path, 32, 24).unwrap_err().to_string();
        assert!(refused.contains("60000 × 60000 px"), "{refused}");
    }

    /// The fast path and the general decoder agree for plain, other and truncated TIFF files.
    #[test]
    fn tiff_files_are_the_pictures_they_are() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame.tif");
        let value = |x: u32, y: u32, c: u32| (37 * x + 11 * y + 101 * c) as u8;
        let grey = GrayImage::from_fn(32, 24, |x, y| image::Luma([value(x, y, 0)]));
        let colour =
            RgbImage::from_fn(32, 24, |x, y| image::Rgb([0, 1, 2].map(|c| value(x, y, c))));
        let deep = DynamicImage::from(grey.clone()).to_luma16();
        let pictures = [
            (grey.into(), true),
            (colour.into(), true),
            (deep.into(), false),
        ];
        for (picture, plain) in pictures {
            let picture: DynamicImage = picture;
            picture.save(&path).unwrap();
            let bytes = std::fs::read(&path).unwrap();
            let input = || Content::of(&path, 32, 24).unwrap().input();
            assert_eq!(plain_tiff(input(), 32, 24).is_some(), plain);
            assert!(plain_tiff(input(), 24, 32).is_none());
            let frame = FrameFile::picture(0, path.clone());
            assert_eq!(load_colour(&frame, 32, 24).unwrap(), picture);
            std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
            let refused = load_colour(&frame, 32, 24).unwrap_err();
            assert!(matches!(refused, FrameError::Decode { .. }), "{refused}");
        }
    }
}
