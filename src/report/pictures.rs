//! Pictures of a report: strips of the panoramas and thumbnails of frames.

use super::error::ReportError;
use super::model::{PanoramaStrips, Strip, Thumbnail};
use crate::evaluate::{ComparedPanorama, ComparedPanoramas};
use crate::frames::load_colour;
use crate::render::{Canvas, Layout};
use crate::survey::Survey;
use image::codecs::jpeg::JpegEncoder;
use image::imageops::{self, FilterType};
use image::{DynamicImage, ImageResult, Rgb, RgbImage};
use std::collections::BTreeMap;

/// Name of the folder beside `report.json` that holds the pictures.
pub const PICTURES: &str = "report_pictures";

/// JPEG files by their names in [`PICTURES`].
pub type Pictures = BTreeMap<String, Vec<u8>>;

/// Largest number of pixels of a panorama.
const MAX_PANORAMA_PIXELS: f64 = 4e6;
/// Largest side of a strip, pixels.
const MAX_STRIP_PX: u32 = 4096;
/// Largest number of thumbnails.
const MAX_THUMBNAILS: usize = 24;
/// Width of a thumbnail, pixels.
const THUMBNAIL_WIDTH_PX: u32 = 320;
/// Colour where no frame sees the wall.
const HOLE_COLOUR: Rgb<u8> = Rgb([158, 170, 194]);
/// JPEG quality of panoramas and of thumbnails.
const QUALITY: [u8; 2] = [82, 75];

/// Cuts the panoramas into strips. A panorama that is longer than wide is turned, with the chainage
/// to the right.
///
/// # Errors
/// [`ReportError::Encode`].
pub fn panoramas(
    canvas: &Canvas,
    drawings: &ComparedPanoramas,
    pictures: &mut Pictures,
) -> Result<PanoramaStrips, ReportError> {
    let layout = if canvas.rows > canvas.columns {
        Layout::ChainageRight
    } else {
        Layout::ThetaRight
    };
    let pixels = canvas.pixels() as f64;
    let mut scale = (MAX_PANORAMA_PIXELS / pixels).sqrt().min(1.0);
    // A panorama that is not turned is a single strip.
    if layout == Layout::ThetaRight {
        scale = scale.min(f64::from(MAX_STRIP_PX) / f64::from(canvas.columns));
    }
    let mut strips = |which: &str, drawing: &ComparedPanorama| {
        let image = drawing.panorama.clone().into_image(layout);
        cut(which, &shrink(&fill_holes(&image), scale), pictures)
    };
    Ok(PanoramaStrips {
        layout,
        px_per_metre: canvas.px_per_metre * scale,
        chainage_m: canvas.chainage_m(),
        baseline: strips("baseline", &drawings.baseline)?,
        refined: strips("refined", &drawings.refined)?,
        truth: match &drawings.truth {
            Some(truth) => Some(strips("truth", truth)?),
            None => None,
        },
    })
}

/// Fills the holes of a picture with a colour.
fn fill_holes(image: &DynamicImage) -> RgbImage {
    let source = image.to_rgba8();
    RgbImage::from_fn(source.width(), source.height(), |x, y| {
        match source.get_pixel(x, y).0 {
            [.., 0] => HOLE_COLOUR,
            [red, green, blue, _] => Rgb([red, green, blue]),
        }
    })
}

/// Scales a picture down; scales of 1 and more keep it.
fn shrink(image: &RgbImage, scale: f64) -> RgbImage {
    let side = |length: u32| ((f64::from(length) * scale).round() as u32).max(1);
    if scale < 1.0 {
        let (width, height) = (side(image.width()), side(image.height()));
        imageops::resize(image, width, height, FilterType::Triangle)
    } else {
        image.clone()
    }
}

/// Cuts a picture into strips of nearly equal width, none wider than [`MAX_STRIP_PX`].
fn cut(which: &str, image: &RgbImage, pictures: &mut Pictures) -> Result<Vec<Strip>, ReportError> {
    let (width, height) = image.dimensions();
    let pieces = width.div_ceil(MAX_STRIP_PX).max(1);
    let edge = |k: u32| (u64::from(width) * u64::from(k) / u64::from(pieces)) as u32;
    let mut strips = Vec::new();
    for k in 0..pieces {
        let file = match pieces {
            1 => format!("{which}.jpg"),
            _ => format!("{which}-{:02}.jpg", k + 1),
        };
        let piece = imageops::crop_imm(image, edge(k), 0, edge(k + 1) - edge(k), height);
        let piece = piece.to_image();
        pictures.insert(file.clone(), jpeg(&file, &piece, QUALITY[0])?);
        strips.push(Strip {
            file,
            width: piece.width(),
            height,
        });
    }
    Ok(strips)
}

/// Makes thumbnails of the first `flagged` frames.
///
/// # Errors
/// A frame that cannot be read or encoded.
pub fn thumbnails(
    survey: &Survey,
    flagged: &[usize],
    pictures: &mut Pictures,
) -> Result<Vec<Thumbnail>, ReportError> {
    let [width, height] = survey.cameras.size();
    let scale = (f64::from(THUMBNAIL_WIDTH_PX) / f64::from(width)).min(1.0);
    let shown = flagged.iter().take(MAX_THUMBNAILS);
    shown
        .filter_map(|frame| Some((*frame, survey.frames.get(*frame)?)))
        .map(|(frame, source)| {
            let picture = shrink(&load_colour(source, width, height)?.to_rgb8(), scale);
            let file = format!("frame-{frame:06}.jpg");
            pictures.insert(file.clone(), jpeg(&file, &picture, QUALITY[1])?);
            Ok(Thumbnail {
                frame,
                file,
                width: picture.width(),
                height: picture.height(),
            })
        })
        .collect()
}

/// Encodes a picture as JPEG.
fn jpeg(name: &str, image: &RgbImage, quality: u8) -> Result<Vec<u8>, ReportError> {
    encode_picture(name, |bytes| {
        image.write_with_encoder(JpegEncoder::new_with_quality(bytes, quality))
    })
}

/// Encodes the picture `name`.
pub(super) fn encode_picture(
    name: &str,
    encode: impl FnOnce(&mut Vec<u8>) -> ImageResult<()>,
) -> Result<Vec<u8>, ReportError> {
    let mut bytes = Vec::new();
    match encode(&mut bytes) {
        Ok(()) => Ok(bytes),
        Err(source) => Err(ReportError::Encode {
            name: name.to_owned(),
            source,
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The pieces, laid side by side, are the picture.
    #[test]
    fn a_long_picture_is_cut_without_loss_or_overlap() {
        let image = RgbImage::from_fn(10_000, 40, |x, _| Rgb([(x / 40) as u8; 3]));
        let mut pictures = Pictures::new();
        let strips = cut("refined", &image, &mut pictures).unwrap();
        assert_eq!(strips.len(), 3);
        assert_eq!(pictures.len(), 3);
        let mut left = 0;
        for strip in &strips {
            assert!(strip.width <= MAX_STRIP_PX && strip.height == 40);
            let decoded = image::load_from_memory(&pictures[&strip.file]).unwrap();
            let middle = decoded.to_rgb8().get_pixel(strip.width / 2, 20).0[0];
            let expected = (left + strip.width / 2) / 40;
            assert!(u32::from(middle).abs_diff(expected) <= 2);
            left += strip.width;
        }
        assert_eq!(left, 10_000);
    }

    #[test]
    fn holes_are_coloured_and_shrinking_keeps_the_proportions() {
        let mut image = image::GrayAlphaImage::from_pixel(400, 100, image::LumaA([40, 255]));
        image.put_pixel(3, 3, image::LumaA([0, 0]));
        let picture = fill_holes(&image.into());
        assert_eq!(*picture.get_pixel(3, 3), HOLE_COLOUR);
        assert_eq!(picture.get_pixel(9, 9).0, [40; 3]);
        assert_eq!(shrink(&picture, 0.25).dimensions(), (100, 25));
        assert_eq!(shrink(&picture, 1.0), picture);
    }
}
