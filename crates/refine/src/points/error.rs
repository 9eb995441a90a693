//! Points that do not fit the wall.

/// Measured points that the wall cannot be fitted to.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PointsFitError {
    /// Hardly any point is of the wall that frames see.
    #[error(
        "{file}: {near} of {read} points are of the wall that the frames see, too few for a fit \
         ({beyond} are elsewhere along the tunnel, {off_wall} too far from the wall); give points \
         in the world of the initial poses, in metres"
    )]
    TooFew {
        /// The file.
        file: String,
        /// Its points.
        read: u64,
        /// Those near the wall, after thinning.
        near: usize,
        /// Those elsewhere along the tunnel.
        beyond: u64,
        /// Those too far from the wall.
        off_wall: u64,
    },
    /// The wall of the points is another than the given one.
    #[error(
        "{file}: the wall of the points is up to {off_mm:.0} mm off the given one, more than \
         {most_mm:.0} mm, ten times tunnel.shape_sigma_mm: they have a radius of {radius_m:.3} m, \
         given {given_m:.3} m, and their axis is ({x_mm:.0}, {z_mm:.0}) mm off along x and z, by \
         ({x_tilt:.1}, {z_tilt:.1}) mm more in every metre; correct radius_m or \
         poses.tunnel_frame, or give points in the world of the initial poses"
    )]
    TooFarOff {
        /// The file.
        file: String,
        /// Largest displacement by size and axis, millimetres.
        off_mm: f64,
        /// The limit, millimetres.
        most_mm: f64,
        /// Radius by the points, metres.
        radius_m: f64,
        /// Radius as given, metres.
        given_m: f64,
        /// Offset of the axis along x, millimetres.
        x_mm: f64,
        /// Offset of the axis along z, millimetres.
        z_mm: f64,
        /// Tilt of the axis along x, millimetres per metre.
        x_tilt: f64,
        /// Tilt of the axis along z, millimetres per metre.
        z_tilt: f64,
    },
    /// The equations have no solution.
    #[error(
        "{file}: the equations of the wall's shape have no solution; give more points, or points \
         from all around the section"
    )]
    Singular {
        /// The file.
        file: String,
    },
}
