//! Files of points that a scanner or a depth camera has measured: PLY, LAS and LAZ, PCD, and text.
//!
//! [`read_points`] chooses the reader by the name of the file and hands over one point after
//! another, so that memory does not grow with the file (but for compressed PCD, which is one
//! block). One file per format:
//!
//! | format | variants | source |
//! | --- | --- | --- |
//! | [`ply`] | text, binary of both byte orders; properties `x`, `y`, `z` of the element `vertex` | G. Turk, "The PLY polygon file format", 1994 |
//! | [`las`] | LAS 1.0 to 1.4, LAZ | ASPRS, "LAS specification 1.4 R15", 2019 |
//! | [`pcd`] | `ascii`, `binary`, `binary_compressed`; fields `x`, `y`, `z` | Point Cloud Library, "The PCD file format" |
//! | [`xyz`] | lines `x y z …`, separated by spaces, tabs, commas or semicolons | |
//!
//! Coordinates are metres. What is not finite is an error, except the points of PLY and PCD whose
//! three coordinates are all NaN: programs write these where a sensor has measured nothing.

mod error;
mod las;
mod lzf;
mod pcd;
mod ply;
mod point_visitor;
mod reader;
#[cfg(test)]
mod tests;
mod xyz;

pub use error::PointsError;
pub use point_visitor::PointCount;
pub use reader::read_points;
