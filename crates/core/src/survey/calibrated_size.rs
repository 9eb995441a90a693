//! Calibrations of pictures of another size than the frames.

use crate::frames::FrameFile;
use std::path::Path;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::files::printed;

/// Factors of the size, in either direction, from which on pictures were scaled; nearer ones may
/// be those of pictures that were cropped a little.
const MIN_RESIZE_FACTOR: f64 = 1.2;

/// The camera of frames whose sides have one ratio to those of the calibration, as after scaling,
/// with the warning that says so; None if a frame has the calibration's size, or the sides do not
/// go together.
pub(super) fn scaled_to_frames(
    calibrated: &Camera,
    frames: &[FrameFile],
    file: &Path,
) -> Option<(Camera, String)> {
    let own = (calibrated.width, calibrated.height);
    let mut sizes = frames.iter().filter_map(|frame| frame.size().ok());
    let (width, height) = sizes.next()?;
    if (width, height) == own || sizes.any(|size| size == own) {
        return None;
    }
    let camera = scaled(calibrated, [width, height])?;
    let sentence = format!(
        "{}: a calibration of {} × {} px for frames of {width} × {height} px; it is scaled by \
         {:.4} with them, which is wrong if they were cropped, or taken in another mode of the \
         camera: then give the calibration of these frames",
        printed(file),
        own.0,
        own.1,
        f64::from(width) / f64::from(own.0)
    );
    Some((camera, sentence))
}

/// The camera of pictures of another size, if they are its own but for their scale.
pub(super) fn scaled(calibrated: &Camera, size: [u32; 2]) -> Option<Camera> {
    let factor = f64::from(size[0]) / f64::from(calibrated.width);
    let is_scaled = factor.max(1.0 / factor) >= MIN_RESIZE_FACTOR;
    calibrated.scaled_to(size).filter(|_| is_scaled)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_the_same_shape_are_scaled_and_others_are_not() {
        let dir = tempfile::tempdir().unwrap();
        let frame = |(k, [width, height]): (usize, [u32; 2])| {
            let path = dir.path().join(format!("{k}.png"));
            image::GrayImage::new(width, height).save(&path).unwrap();
            FrameFile::picture(k, path)
        };
        let calibrated = Camera::from_vertical_fov(400, 300, 1.0);
        let scaled = |sizes: &[[u32; 2]]| {
            let frames: Vec<_> = sizes.iter().copied().enumerate().map(frame).collect();
            scaled_to_frames(&calibrated, &frames, Path::new("lens.json"))
        };
        // A ray through the same place of the picture.
        let (half, said) = scaled(&[[200, 150]; 2]).unwrap();
        assert!((half.fx - 0.5 * calibrated.fx).abs() < 1e-9 && (half.cx - 99.5).abs() < 1e-9);
        assert!(
            said.contains("lens.json: a calibration of 400 × 300 px"),
            "{said}"
        );
        // Rounded to whole pixels.
        assert!(scaled(&[[133, 100]]).is_some());
        for other in [
            &[[400, 300]][..],
            &[[200, 150], [400, 300]],
            &[[200, 140]],
            &[[300, 400]],
            &[[390, 292]],
            &[],
        ] {
            assert!(scaled(other).is_none(), "{other:?}");
        }
    }
}
