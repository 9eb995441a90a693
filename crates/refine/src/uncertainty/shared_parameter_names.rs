//! Names and kinds of the shared parameters.

use crate::parameters::calibration::SHARED_PARAMETERS;

/// The kind of a shared parameter, which decides its unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ParameterKind {
    /// A focal length, estimated as a logarithm.
    Focal,
    /// A pixel coordinate.
    Pixel,
    /// A number without unit.
    Plain,
    /// A time.
    Time,
    /// The radius of the tunnel, estimated as a logarithm.
    Radius,
    /// A tilt of the tunnel's axis.
    Tilt,
    /// An offset of the tunnel's axis.
    Offset,
    /// A curvature of the tunnel.
    Curvature,
}

/// The names of the shared parameters in the report and their kinds, in the order of κ.
pub const PARAMETERS: [(&str, ParameterKind); SHARED_PARAMETERS] = [
    ("focal", ParameterKind::Focal),
    ("cx", ParameterKind::Pixel),
    ("cy", ParameterKind::Pixel),
    ("k1", ParameterKind::Plain),
    ("k2", ParameterKind::Plain),
    ("radius", ParameterKind::Radius),
    ("axis_tilt_x", ParameterKind::Tilt),
    ("axis_tilt_z", ParameterKind::Tilt),
    ("axis_offset_x", ParameterKind::Offset),
    ("axis_offset_z", ParameterKind::Offset),
    ("readout", ParameterKind::Time),
    ("curvature_x", ParameterKind::Curvature),
    ("curvature_z", ParameterKind::Curvature),
];
