//! All frames of a survey in memory.

use super::{Picture, RenderError};
use crate::camera::Pinhole;
use crate::frames::{FrameFile, load_colour};
use crate::progress::Progress;
use rayon::prelude::*;

/// The frames of a survey, all grey or all colour, with the camera that took them.
#[derive(Clone, Debug)]
pub struct FrameStack {
    camera: Pinhole,
    pictures: Vec<Picture>,
}

/// How many times frames of resolution `native` may be halved before they are coarser than a canvas of
/// `px_per_metre`: a canvas much coarser than the frames would otherwise pick single pixels out of them.
pub fn level_for(camera: &Pinhole, native_px_per_metre: f64, px_per_metre: f64) -> usize {
    let mut level = 0;
    while native_px_per_metre * 0.5f64.powi(level as i32 + 1) >= px_per_metre
        && camera.width.min(camera.height) >> (level + 1) >= 16
    {
        level += 1;
    }
    level
}

impl FrameStack {
    /// Decodes every frame (in parallel) and halves it `level` times. If any frame has colour, all are held
    /// in colour.
    ///
    /// # Errors
    /// A frame that is missing, damaged or of another size than the calibration's; the first in the order
    /// of the files.
    pub fn load(
        files: &[FrameFile],
        camera: &Pinhole,
        level: usize,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        progress.start("frames", files.len());
        let decoded: Vec<Result<Picture, RenderError>> = files
            .par_iter()
            .map(|file| {
                let mut picture =
                    Picture::from_decoded(load_colour(file, camera.width, camera.height)?);
                for _ in 0..level {
                    picture = picture.halved();
                }
                progress.advance(1);
                Ok(picture)
            })
            .collect();
        progress.finish();
        let pictures = decoded.into_iter().collect::<Result<Vec<_>, _>>()?;
        Ok(Self::from_pictures(camera.at_level(level), pictures))
    }

    /// Frames that are in memory already, with the camera that took them.
    ///
    /// # Panics
    /// If a picture is not as large as the camera's.
    pub fn from_pictures(camera: Pinhole, mut pictures: Vec<Picture>) -> Self {
        for picture in &pictures {
            let size = (picture.width() as u32, picture.height() as u32);
            assert_eq!(size, (camera.width, camera.height), "size of a frame");
        }
        if pictures.iter().any(|picture| picture.channels() == 3) {
            pictures = pictures.into_iter().map(Picture::into_colour).collect();
        }
        Self { camera, pictures }
    }

    /// The camera of the pictures as they are held (halved as they are).
    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// The pictures, in the order of the frames.
    pub fn pictures(&self) -> &[Picture] {
        &self.pictures
    }

    /// Samples a pixel: 1 (grey) or 3 (colour).
    pub fn channels(&self) -> usize {
        self.pictures.first().map_or(1, Picture::channels)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_halved_only_for_coarse_canvases() {
        let camera = Pinhole::from_vertical_fov(640, 480, 1.0);
        for (px_per_metre, level) in [
            (150.0, 0),
            (101.0, 0),
            (99.0, 1),
            (51.0, 1),
            (50.0, 2),
            (0.1, 4),
        ] {
            assert_eq!(level_for(&camera, 200.0, px_per_metre), level);
        }
    }

    #[test]
    fn one_colour_frame_makes_all_colour() {
        let camera = Pinhole::from_vertical_fov(2, 2, 1.0);
        let grey = Picture::new(2, 2, 1, vec![7; 4]);
        let colour = Picture::new(2, 2, 3, vec![9; 12]);
        let stack = FrameStack::from_pictures(camera, vec![grey, colour]);
        assert_eq!(stack.channels(), 3);
        assert!((stack.pictures()[0].grey(0.5, 0.5) - 7.0).abs() < 1e-4);
    }
}
