//! Small pictures of all frames, for exposure and seams.

use super::picture::Picture;
use super::picture_cache::PictureCache;
use super::pixel_format::PixelFormat;
use super::point_batch::PointBatch;
use crate::error::RenderError;
use crate::layout::canvas::Canvas;
use crate::layout::placement::{Placement, native_px_per_metre};
use crate::warp::projection::{LocalPoints, LocalProjection};
use tunnelstitch_core::progress::Progress;
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::numerics::kernel::{Interpolation, Kernel};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Surface;

/// Small 16-bit pictures of all frames.
#[derive(Clone, Debug)]
pub struct Thumbnails {
    cameras: Cameras,
    full: Cameras,
    scale: f32,
    pictures: Vec<Picture>,
    bilinear: Kernel,
}

impl Thumbnails {
    /// Makes thumbnails whose pixels are means of `2^level × 2^level` pixels of the frames.
    ///
    /// Frames that are not in memory are decoded and dropped again.
    ///
    /// # Errors
    /// A frame that is missing, damaged or of another size than the calibration's; the first of
    /// them.
    pub fn of(
        frames: &PictureCache,
        level: usize,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        progress.start("thumbnails", frames.len());
        let pictures: Vec<Result<Picture, RenderError>> = (0..frames.len()).par_map(|frame| {
            let small = match frames.picture(frame) {
                Some(picture) => picture.thumbnail(level),
                None => frames.decode(frame)?.thumbnail(level),
            };
            progress.advance(1);
            Ok(small)
        });
        progress.finish();
        let cameras = frames.cameras();
        Ok(Self {
            cameras: cameras.at_level(level),
            full: cameras.clone(),
            scale: (1 << level) as f32,
            bilinear: Kernel::new(Interpolation::Bilinear, 1.0),
            pictures: pictures.into_iter().collect::<Result<Vec<_>, _>>()?,
        })
    }

    /// Level at which frames, as they are held, are about as fine as `grid`.
    ///
    /// # Errors
    /// As [`native_px_per_metre`].
    pub fn level(
        surface: &dyn Surface,
        frames: &PictureCache,
        placements: &[Placement],
        grid: &Canvas,
    ) -> Result<usize, RenderError> {
        let cameras = frames.cameras();
        let poses = placements.iter().map(|placement| &placement.pose);
        let native = native_px_per_metre(surface, cameras, poses)?;
        let most = cameras.shorter_side().max(16).ilog2() - 4;
        let level = (native / grid.px_per_metre).log2().round();
        Ok(level.clamp(0.0, f64::from(most)) as usize)
    }

    /// Memory of the thumbnails of `frames` frames of the given size, pixels; bytes.
    pub fn bytes(size: [u32; 2], level: usize, channels: usize, frames: usize) -> u64 {
        let [width, height] = size.map(|side| u64::from(side >> level));
        2 * width * height * (channels * frames) as u64
    }

    /// Samples a pixel: 1 or 3.
    pub fn channels(&self) -> usize {
        self.pictures.first().map_or(1, |p| p.format().channels)
    }

    /// The cameras of the thumbnails.
    pub fn cameras(&self) -> &Cameras {
        &self.cameras
    }

    /// The cameras of the frames.
    pub fn full_cameras(&self) -> &Cameras {
        &self.full
    }

    /// Width and height of the frames, pixels.
    pub fn full_size(&self) -> (usize, usize) {
        self.full.size().map(|side| side as usize).into()
    }

    /// Pixels of a frame along each side of a thumbnail's.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Coordinate on a frame of one on its thumbnail: `2^l t + (2^l − 1)/2`.
    #[inline(always)]
    pub fn full(&self, t: f32) -> f32 {
        self.scale * t + 0.5 * (self.scale - 1.0)
    }

    /// Channels and depth.
    pub fn format(&self) -> PixelFormat {
        PixelFormat {
            channels: self.channels(),
            deep: true,
        }
    }

    /// Prepares the thumbnail of a frame for sampling at `points`.
    pub fn view<'a>(
        &'a self,
        frame: usize,
        placement: &Placement,
        points: &'a LocalPoints,
    ) -> ThumbnailView<'a> {
        ThumbnailView {
            projection: LocalProjection::new(
                &placement.camera(self.cameras.of(frame)),
                &placement.pose,
                &points.origin,
            ),
            picture: &self.pictures[frame],
            bilinear: &self.bilinear,
            points,
        }
    }
}

/// A thumbnail, prepared for sampling at points of the wall.
pub struct ThumbnailView<'a> {
    projection: LocalProjection,
    picture: &'a Picture,
    bilinear: &'a Kernel,
    points: &'a LocalPoints,
}

impl ThumbnailView<'_> {
    /// Samples `count` of the points from index `start`: their pixels, and the values there,
    /// bilinear.
    pub fn look_at(&self, batch: &mut PointBatch, start: usize, count: usize) {
        batch.project(&self.projection, self.points, start, count);
        batch.sample(self.picture, self.bilinear, 0..count);
    }
}
