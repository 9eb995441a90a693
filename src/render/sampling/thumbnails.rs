//! All frames, small: enough to find out how they were exposed and where they agree.

use super::picture::Picture;
use super::picture_cache::FrameStack;
use super::pixel_format::PixelFormat;
use super::point_batch::Run;
use crate::camera::Camera;
use crate::numerics::kernel::{Interpolation, Kernel};
use crate::progress::Progress;
use crate::render::error::RenderError;
use crate::render::layout::canvas::Canvas;
use crate::render::layout::placement::{Placement, native_px_per_metre};
use crate::render::warp::projection::{Look, Points};
use crate::surface::Surface;
use rayon::prelude::*;

/// Small 16-bit pictures of all frames.
#[derive(Clone, Debug)]
pub struct Thumbnails {
    camera: Camera,
    full_size: (usize, usize),
    scale: f32,
    pictures: Vec<Picture>,
    bilinear: Kernel,
}

impl Thumbnails {
    /// Thumbnails whose pixels are means of `2^level × 2^level` pixels of the frames.
    ///
    /// Frames that are not held are decoded and let go again.
    ///
    /// # Errors
    /// A frame that is missing, damaged or of another size than the calibration's; the first of
    /// them.
    pub fn of(
        frames: &FrameStack,
        level: usize,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        progress.start("thumbnails", frames.len());
        let pictures: Vec<Result<Picture, RenderError>> = (0..frames.len())
            .into_par_iter()
            .map(|frame| {
                let small = match frames.picture(frame) {
                    Some(picture) => picture.thumbnail(level),
                    None => frames.decode(frame)?.thumbnail(level),
                };
                progress.advance(1);
                Ok(small)
            })
            .collect();
        progress.finish();
        let camera = frames.camera();
        Ok(Self {
            camera: camera.at_level(level),
            full_size: (camera.width as usize, camera.height as usize),
            scale: (1 << level) as f32,
            bilinear: Kernel::new(Interpolation::Bilinear, 1.0),
            pictures: pictures.into_iter().collect::<Result<Vec<_>, _>>()?,
        })
    }

    /// The level at which frames, as they are held, are about as fine as `grid`.
    ///
    /// # Errors
    /// As [`native_px_per_metre`].
    pub fn level(
        surface: &dyn Surface,
        frames: &FrameStack,
        placements: &[Placement],
        grid: &Canvas,
    ) -> Result<usize, RenderError> {
        let camera = frames.camera();
        let poses = placements.iter().map(|placement| &placement.pose);
        let native = native_px_per_metre(surface, camera, poses)?;
        let most = camera.shorter_side().max(16).ilog2() - 4;
        let level = (native / grid.px_per_metre).log2().round();
        Ok(level.clamp(0.0, f64::from(most)) as usize)
    }

    /// Memory of the thumbnails of `frames` frames of the given camera, bytes.
    pub fn bytes(camera: &Camera, level: usize, channels: usize, frames: usize) -> u64 {
        let small = camera.at_level(level);
        let pixels = u64::from(small.width) * u64::from(small.height);
        2 * pixels * (channels * frames) as u64
    }

    /// Samples a pixel: 1 or 3.
    pub fn channels(&self) -> usize {
        self.pictures.first().map_or(1, |p| p.format().channels)
    }

    /// The camera of the thumbnails.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Width and height of the frames, pixels.
    pub fn full_size(&self) -> (usize, usize) {
        self.full_size
    }

    /// Pixels of a frame along each side of a thumbnail's.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// The coordinate on a frame of one on its thumbnail: `2^l t + (2^l − 1)/2`.
    #[inline(always)]
    pub fn full(&self, t: f32) -> f32 {
        self.scale * t + 0.5 * (self.scale - 1.0)
    }

    /// What the pixels are.
    pub fn format(&self) -> PixelFormat {
        PixelFormat {
            channels: self.channels(),
            deep: true,
        }
    }

    /// The thumbnail of a frame, ready to be looked at from `points`.
    pub fn view<'a>(
        &'a self,
        frame: usize,
        placement: &Placement,
        points: &'a Points,
    ) -> ThumbnailView<'a> {
        ThumbnailView {
            look: Look::new(
                &placement.camera(&self.camera),
                &placement.pose,
                &points.origin,
            ),
            picture: &self.pictures[frame],
            bilinear: &self.bilinear,
            points,
        }
    }
}

/// A thumbnail, ready to be looked at from points of the wall.
pub struct ThumbnailView<'a> {
    look: Look,
    picture: &'a Picture,
    bilinear: &'a Kernel,
    points: &'a Points,
}

impl ThumbnailView<'_> {
    /// Looks at `count` of the points from index `start`: where they appear, and the values there,
    /// bilinear.
    pub fn look_at(&self, run: &mut Run, start: usize, count: usize) {
        run.project(&self.look, self.points, start, count);
        run.sample(self.picture, self.bilinear, 0..count);
    }
}
