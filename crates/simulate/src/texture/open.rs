//! Selection of the texture of a wall.

use crate::error::SimulateError;
use crate::options::Wall;
use crate::texture::brick::BrickWall;
use crate::texture::concrete::ConcreteWall;
use crate::texture::image_file::ImageWall;
use crate::texture::slanted_edge::SlantedEdgeWall;
use crate::texture::wall_texture::WallTexture;

/// Opens the texture of a wall of the given perimeter (metres).
///
/// # Errors
/// [`SimulateError::Texture`] for an image that cannot be used.
pub(crate) fn open_texture(
    wall: &Wall,
    seed: u64,
    perimeter_m: f64,
) -> Result<Box<dyn WallTexture>, SimulateError> {
    Ok(match wall {
        Wall::Brick => Box::new(BrickWall::unique(seed, perimeter_m)),
        Wall::TiledBrick => Box::new(BrickWall::tiled(seed, perimeter_m)),
        Wall::Concrete => Box::new(ConcreteWall::new(seed, perimeter_m)),
        Wall::Target => Box::new(SlantedEdgeWall::new(perimeter_m)),
        Wall::Texture { path, width_m } => Box::new(ImageWall::open(path, *width_m, perimeter_m)?),
    })
}
