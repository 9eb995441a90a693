//! Cross-sections of tunnels.
//!
//! Coordinates `(x, z)` in metres, the axis at the origin, z upwards to twelve o'clock. The outline
//! is convex, closed, and runs from the z axis (`s = 0`) towards x, parametrised by its length `s`.

mod ellipse;
mod outline;
mod piecewise;
mod round;
#[cfg(test)]
mod tests;

pub use ellipse::Ellipse;
pub use outline::{OutlineHit, OutlinePoint, Section, angle_rad, s_at_m};
pub use piecewise::{OutlinePiece, PiecewiseOutline};
pub use round::CircleOutline;
