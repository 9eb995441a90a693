//! Projection of a tile into a frame.

use crate::samples::footprints::MIN_RESOLVED_SHARE;
use crate::samples::observer::Observer;
use crate::tiles::grid::{SIDE, WallGrid};
use nalgebra::{Vector2, Vector3};
use tunnelstitch_core::frames::{CameraLight, PyramidMask};
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::trajectory::Pose;

/// Area of a tile between its outermost samples, in samples.
const SAMPLES_BETWEEN_CORNERS: f64 = ((SIDE - 1) * (SIDE - 1)) as f64;

/// Least distance of a tile from the image's border and from masked pixels, pixels: the cubic
/// kernel of interpolation reads one pixel beyond the two that a position lies between.
const MIN_BORDER_DISTANCE_PX: f64 = 1.0;

/// A tile in the image of a frame.
pub struct TileProjection {
    /// Its centre, pixels.
    centre: Vector2<f64>,
    /// See [`Observer::pixels`].
    pixels: f64,
}

/// Projects the tile with these corners into a frame at `pose`; None if the frame does not observe
/// all of it, or too obliquely.
pub fn project_tile(
    grid: &WallGrid,
    camera: &Camera,
    mask: Option<&PyramidMask>,
    pose: &Pose,
    corners: &[Vector3<f64>; 4],
) -> Option<TileProjection> {
    let pixel = |x_w: &Vector3<f64>| {
        camera
            .project(&pose.to_camera(x_w))
            .filter(|pixel| camera.is_in_image(pixel, MIN_BORDER_DISTANCE_PX))
    };
    let (a, b) = (pixel(&corners[0])?, pixel(&corners[1])?);
    let (c, d) = (pixel(&corners[2])?, pixel(&corners[3])?);
    // Half the cross product of the diagonals; the corners come row by row.
    let area = 0.5 * (d - a).perp(&(c - b)).abs();
    let pixels = area / SAMPLES_BETWEEN_CORNERS;
    if pixels < MIN_RESOLVED_SHARE * grid.density.powi(-2) {
        return None;
    }
    let centre = 0.25 * (a + b + c + d);
    if let Some(mask) = mask {
        let distances = [a, b, c, d].map(|corner| (corner - centre).amax());
        let reach = distances
            .iter()
            .fold(MIN_BORDER_DISTANCE_PX, |most, distance| {
                most.max(distance + MIN_BORDER_DISTANCE_PX)
            });
        if !mask.is_clear(centre.x as f32, centre.y as f32, reach as f32) {
            return None;
        }
    }
    Some(TileProjection { centre, pixels })
}

impl TileProjection {
    /// A frame, the one of index `k` among those of the visibility and of `index` in the survey, as
    /// an observer of the tile.
    pub fn observer(
        &self,
        k: usize,
        index: usize,
        camera: &Camera,
        light: Option<&CameraLight>,
    ) -> Observer {
        let shade = light.map_or(1.0, |light| light.at_level(index, &self.centre, camera));
        Observer {
            frame: k as u32,
            pixels: self.pixels as f32,
            shade: shade as f32,
        }
    }
}
