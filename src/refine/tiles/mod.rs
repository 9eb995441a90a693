//! One square tile of the wall: its samples, the frames' values there, texture, residuals and their moments.

pub mod denoising;
pub mod frame_samples;
pub mod grid;
pub mod interpolation;
pub mod residual_weighting;
pub mod tile;
