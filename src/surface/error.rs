//! Errors of tunnel shapes: impossible sizes, and rays or cameras that do not fit the tunnel.

/// Why a ray or a camera does not go with the tunnel.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// The camera's centre is not inside the tunnel.
    #[error(
        "the camera is {distance_m:.3} m off the axis, outside the tunnel (the wall is at {wall_m:.3} m)"
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
    /// The end of the tunnel lies within the picture.
    #[error("the picture holds the vanishing point of the tunnel's axis, and so wall without end")]
    LooksAlongTheAxis,
    /// The lens shows nothing there.
    #[error(
        "the lens shows nothing in the middle of the picture; check the principal point and max_angle_deg"
    )]
    NotShown,
    /// The ray or the camera's position is not a number.
    #[error("the camera's position or viewing direction is not finite")]
    NotFinite,
    /// A size of the section is impossible.
    #[error("{name} is {size_m} m; it must be a positive number of metres")]
    Size {
        /// Its name in `survey.toml`.
        name: &'static str,
        /// The size given, metres.
        size_m: f64,
    },
    /// A horseshoe without walls.
    #[error(
        "a horseshoe {width_m} m wide and {height_m} m high has no floor; its height must be more than half its width"
    )]
    NoWalls {
        /// Width, metres.
        width_m: f64,
        /// Height, metres.
        height_m: f64,
    },
    /// A centreline that no tunnel follows.
    #[error("the centreline: {what}")]
    Centreline {
        /// What is wrong with it.
        what: String,
    },
}

/// Refuses a size that is not positive and finite.
pub(super) fn check_size(name: &'static str, size_m: f64) -> Result<(), SurfaceError> {
    if size_m.is_finite() && size_m > 0.0 {
        Ok(())
    } else {
        Err(SurfaceError::Size { name, size_m })
    }
}
