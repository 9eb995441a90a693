//! Textures of the simulated wall: its grey levels under even light, filled row by row.
//!
//! Each texture is a file of its own behind the trait `WallTexture`.

pub(super) mod brick;
pub(super) mod concrete;
pub(super) mod image_file;
pub(super) mod open;
pub(super) mod slanted_edge;
pub(super) mod wall_texture;
