//! The functions of the wall's shape at a tile.

use nalgebra::Vector3;

/// A function of the shape at a tile.
#[derive(Clone, Copy, Debug)]
pub struct TileFunction {
    /// Its block, among the slots of the block of the wall.
    pub index: usize,
    /// Its coefficient in the block.
    pub component: usize,
    /// Its value at the tile's centre.
    pub value: f64,
}

/// The shape's functions at a tile.
#[derive(Clone, Debug)]
pub struct TileShape {
    /// Unit normal of the nominal wall at the tile's centre.
    pub normal: Vector3<f64>,
    /// The functions that are not zero there, by ascending block.
    pub functions: Vec<TileFunction>,
}
