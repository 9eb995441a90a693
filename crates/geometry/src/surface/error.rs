//! Errors of tunnel shapes: impossible sizes, and rays or cameras that do not fit the tunnel.

/// An error of a tunnel's shape, or of a ray or camera in it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// The camera's centre is not inside the tunnel.
    #[error(
        "the camera is {distance_m:.3} m off the axis, outside the tunnel (the wall is at \
         {wall_m:.3} m)"
    )]
    CameraOutside {
        /// Distance of the camera from the axis, metres.
        distance_m: f64,
        /// Distance of the wall from the axis in that direction, metres.
        wall_m: f64,
    },
    /// The ray runs along the axis and never meets the wall.
    #[error("the ray runs along the tunnel's axis and meets no wall")]
    Parallel,
    /// The vanishing point of the axis lies within the image.
    #[error(
        "the image contains the vanishing point of the tunnel's axis, so that its view has no \
             end"
    )]
    LooksAlongTheAxis,
    /// The wall that a ray meets is beyond the camera's range.
    #[error("the wall is {range_m:.3} m away, beyond camera.max_range_m = {max_range_m:.3} m")]
    BeyondRange {
        /// Distance of the wall, metres.
        range_m: f64,
        /// Range of the camera, metres.
        max_range_m: f64,
    },
    /// The image's centre lies outside the lens's field of view.
    #[error(
        "the image's centre is outside the lens's field of view, according to the principal point \
         and max_angle_deg"
    )]
    NotShown,
    /// The ray or the camera's position is not a number.
    #[error("the camera's position or viewing direction is not finite")]
    NotFinite,
    /// A size of the section is impossible.
    #[error("{name} is {size_m} m; it must be a positive number of metres, from 0.001 to 100000")]
    Size {
        /// Name of the size in `survey.toml`.
        name: &'static str,
        /// The size given, metres.
        size_m: f64,
    },
    /// A horseshoe without walls.
    #[error(
        "a horseshoe {width_m} m wide and {height_m} m high has no floor; its height must be more \
         than half its width"
    )]
    NoWalls {
        /// Width, metres.
        width_m: f64,
        /// Height, metres.
        height_m: f64,
    },
    /// A centreline that no tunnel can follow.
    #[error("the centreline: {what}")]
    Centreline {
        /// The problem.
        what: String,
    },
}

/// Sizes of a section, metres; beyond them, numbers lose the digits that a pixel needs.
pub const SIZES_M: std::ops::RangeInclusive<f64> = 1e-3..=1e5;

/// Rejects a size that is not positive, or beyond [`SIZES_M`].
pub(super) fn check_size(name: &'static str, size_m: f64) -> Result<(), SurfaceError> {
    if SIZES_M.contains(&size_m) {
        Ok(())
    } else {
        Err(SurfaceError::Size { name, size_m })
    }
}
