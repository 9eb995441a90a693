//! Wall point that a pixel of a frame shows.

use crate::layout::placement::Placement;
use nalgebra::Vector2;
use tunnelstitch_core::frames::Mask;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{Hit, Surface, SurfaceError};

/// Error of a frame's pixel that shows no point of the wall.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FramePixelError {
    /// The pixel is outside the frame.
    #[error("no pixel {u},{v}; they are 0 to {max_u} and 0 to {max_v}")]
    Outside {
        /// Column.
        u: f64,
        /// Row.
        v: f64,
        /// Last column.
        max_u: u32,
        /// Last row.
        max_v: u32,
    },
    /// The mask hides the pixel.
    #[error("at {u},{v} the mask of the frames (frames.mask in survey.toml) hides the wall")]
    Masked {
        /// Column.
        u: f64,
        /// Row.
        v: f64,
    },
    /// The lens projects nothing there.
    #[error("the lens shows nothing at {u},{v}")]
    NoRay {
        /// Column.
        u: f64,
        /// Row.
        v: f64,
    },
    /// The ray does not hit the wall.
    #[error(transparent)]
    Surface(#[from] SurfaceError),
}

/// Finds the point of the wall that pixel `(u, v)` of a placed frame shows: where its ray
/// `x_w(t) = t_wc + R_wc (o(v) + t d(u, v))` hits the wall.
///
/// # Errors
/// [`FramePixelError`].
pub fn hit_of_pixel(
    surface: &dyn Surface,
    camera: &Camera,
    mask: Option<&Mask>,
    placement: &Placement,
    [u, v]: [f64; 2],
) -> Result<Hit, FramePixelError> {
    let pose = &placement.pose;
    let camera = placement.camera(camera);
    if !camera.is_in_image(&Vector2::new(u, v), 0.0) {
        return Err(FramePixelError::Outside {
            u,
            v,
            max_u: camera.width - 1,
            max_v: camera.height - 1,
        });
    }
    if mask.is_some_and(|mask| !mask.is_clear(u as f32, v as f32, 0.0)) {
        return Err(FramePixelError::Masked { u, v });
    }
    let ray = camera.ray(u, v).ok_or(FramePixelError::NoRay { u, v })?;
    let start = pose.to_world(&camera.origin(v));
    Ok(surface.hit(&start, &(pose.r_wc * ray))?)
}
