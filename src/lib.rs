//! Photometric trajectory repair and metric panoramas for tunnels, sewers and pipes.

#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod atomic;
pub mod camera;
pub mod cli;
pub mod evaluate;
pub mod frames;
pub mod progress;
pub mod refine;
pub mod render;
pub mod surface;
pub mod survey;
#[cfg(test)]
mod test_wall;
pub mod trajectory;
