//! The wall's surface, row by row.

use super::brick::BrickWall;
use super::concrete::ConcreteWall;
use super::picture::PictureWall;
use super::target::TargetWall;
use super::{SimulateError, Wall};

/// Grey levels of an evenly lit wall.
pub(super) trait Texture: Send + Sync {
    /// Fills one row of texels once around: texel k is the mean over the square of `texel_m` around
    /// `(s, h) = ((k + ½) texel_m, h_m)`, metres.
    fn row(&self, h_m: f64, texel_m: f64, row: &mut [f32]);
}

/// The texture of a wall of the given perimeter (metres).
///
/// # Errors
/// [`SimulateError::Texture`] for a picture that cannot be used.
pub(super) fn texture(
    wall: &Wall,
    seed: u64,
    perimeter_m: f64,
) -> Result<Box<dyn Texture>, SimulateError> {
    Ok(match wall {
        Wall::Brick => Box::new(BrickWall::unique(seed, perimeter_m)),
        Wall::TiledBrick => Box::new(BrickWall::tiled(seed, perimeter_m)),
        Wall::Concrete => Box::new(ConcreteWall::new(seed, perimeter_m)),
        Wall::Target => Box::new(TargetWall::new(perimeter_m)),
        Wall::Texture { path, width_m } => {
            Box::new(PictureWall::open(path, *width_m, perimeter_m)?)
        }
    })
}
