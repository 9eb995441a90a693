//! Pixels of `sensor_msgs/Image`.

use image::{DynamicImage, ImageBuffer};
use tunnelstitch_geometry::recordings::RawPicture;

/// Channels of a pixel in the order of a picture's bytes, and the bytes of each.
struct PixelLayout {
    /// Positions of grey, or of red, green and blue, among the channels.
    colours: &'static [usize],
    channels: usize,
    depth: usize,
}

/// The layout of an encoding (`sensor_msgs/image_encodings`). `8UC3` names no colours; OpenCV,
/// whose name it is, has blue first.
///
/// # Errors
/// An encoding that is not read, with the remedy.
fn layout(encoding: &str) -> Result<PixelLayout, String> {
    let (colours, channels, depth): (&[usize], usize, usize) = match encoding {
        "mono8" | "8UC1" => (&[0], 1, 1),
        "mono16" | "16UC1" => (&[0], 1, 2),
        "rgb8" => (&[0, 1, 2], 3, 1),
        "bgr8" | "8UC3" => (&[2, 1, 0], 3, 1),
        "rgba8" => (&[0, 1, 2], 4, 1),
        "bgra8" => (&[2, 1, 0], 4, 1),
        bayer if bayer.starts_with("bayer_") => {
            return Err(format!(
                "pictures of the encoding {bayer} have one colour a pixel, and are not read; \
                 record what image_proc makes of them (image_mono, or the one with colours)"
            ));
        }
        other => {
            return Err(format!(
                "pictures of the encoding {other:?} are not read; record or convert them as mono8, \
                 mono16, rgb8, bgr8, rgba8 or bgra8"
            ));
        }
    };
    Ok(PixelLayout {
        colours,
        channels,
        depth,
    })
}

/// Makes a picture of the pixels of a message, without the alpha channel.
///
/// # Errors
/// An encoding that is not read; fewer bytes than the rows have, in words.
pub(super) fn decode(raw: &RawPicture<'_>) -> Result<DynamicImage, String> {
    let layout = layout(raw.encoding)?;
    let (width, height, step) = (raw.width as usize, raw.height as usize, raw.step as usize);
    let pixel = layout.channels * layout.depth;
    let row = width.saturating_mul(pixel);
    // The last row may be without the bytes that fill up the others.
    let last = step.saturating_mul(height.saturating_sub(1));
    if width == 0 || height == 0 || step < row || last.saturating_add(row) > raw.data.len() {
        return Err(format!(
            "{width} × {height} pixels of {pixel} bytes and rows of {step} bytes are not in the \
             {} bytes of the picture",
            raw.data.len()
        ));
    }
    let rows = raw.data.chunks(step).take(height);
    let pixels = rows.flat_map(|bytes| bytes[..row].chunks_exact(pixel));
    let (width, height) = (raw.width, raw.height);
    let picture = if layout.depth == 2 {
        let number = match raw.is_big_endian {
            true => u16::from_be_bytes,
            false => u16::from_le_bytes,
        };
        let values = pixels.map(|pair| number([pair[0], pair[1]])).collect();
        ImageBuffer::from_raw(width, height, values).map(DynamicImage::ImageLuma16)
    } else if layout.colours.len() == 1 {
        let values = pixels.map(|pixel| pixel[0]).collect();
        ImageBuffer::from_raw(width, height, values).map(DynamicImage::ImageLuma8)
    } else {
        let colours = layout.colours;
        let values = pixels.flat_map(|pixel| colours.iter().map(|k| pixel[*k]));
        ImageBuffer::from_raw(width, height, values.collect()).map(DynamicImage::ImageRgb8)
    };
    picture.ok_or_else(|| "its size is not that of its pixels".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn raw<'a>(encoding: &'a str, step: u32, data: &'a [u8]) -> RawPicture<'a> {
        RawPicture {
            height: 2,
            width: 1,
            encoding,
            is_big_endian: false,
            step,
            data,
        }
    }

    #[test]
    fn channels_are_put_into_order_and_alpha_is_dropped() {
        let data = [1, 2, 3, 4, 5, 6, 7, 8];
        for (encoding, step, expected) in [
            ("rgb8", 4, [1, 2, 3, 5, 6, 7]),
            ("bgr8", 4, [3, 2, 1, 7, 6, 5]),
            ("8UC3", 3, [3, 2, 1, 6, 5, 4]),
            ("rgba8", 4, [1, 2, 3, 5, 6, 7]),
            ("bgra8", 4, [3, 2, 1, 7, 6, 5]),
        ] {
            let picture = decode(&raw(encoding, step, &data)).unwrap();
            assert_eq!(picture.into_rgb8().into_raw(), expected, "{encoding}");
        }
    }

    #[test]
    fn grey_values_have_eight_or_sixteen_bits() {
        // The last row is not filled up.
        let grey = decode(&raw("mono8", 3, &[1, 0, 0, 2])).unwrap();
        assert_eq!(
            grey,
            ImageBuffer::from_raw(1, 2, vec![1u8, 2])
                .map(DynamicImage::ImageLuma8)
                .unwrap()
        );
        let data = [1, 2, 3, 4];
        let little = raw("16UC1", 2, &data);
        let big = RawPicture {
            is_big_endian: true,
            encoding: "mono16",
            ..little
        };
        for (raw, expected) in [(little, [0x201, 0x403]), (big, [0x102, 0x304])] {
            let picture = decode(&raw).unwrap();
            assert_eq!(picture.as_luma16().unwrap().as_raw(), &expected);
        }
    }

    #[test]
    fn other_encodings_and_missing_bytes_are_named() {
        let said = decode(&raw("bayer_rggb8", 1, &[0; 2])).unwrap_err();
        assert!(
            said.contains("bayer_rggb8") && said.contains("image_proc"),
            "{said}"
        );
        let said = decode(&raw("yuv422", 2, &[0; 4])).unwrap_err();
        assert!(said.contains("yuv422") && said.contains("mono8"), "{said}");
        for (step, bytes) in [(1, 1), (0, 2), (u32::MAX, 2)] {
            let said = decode(&raw("mono8", step, &[0; 2][..bytes])).unwrap_err();
            assert!(said.contains("1 × 2 pixels"), "{said}");
        }
    }
}
