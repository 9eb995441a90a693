//! One square tile of the wall: samples, texture, residuals and their moments.
//!
//! ```text
//! WallGrid ─> TilePoints ─┐
//! SampledFrame (image, camera, estimate) ─┴─> TileWorkspace ─┬─> texture S, weights ω
//! NoiseModel, Denoiser ──────────────────────────────────────┴─> TileMoments (g_i, w̄_i, M, cost)
//! ```
//!
//! | file | subject |
//! | --- | --- |
//! | [`tile`] | the objective of the estimator; residuals and moments of a tile |
//! | [`texture`] | mean, median and robust mean of the frames; variance at every sample |
//! | [`tile_moments`], [`tile_statistics`] | moments; misfits, mean values, residual counts |
//! | [`workspace`], [`tile_arrays`] | values of a tile's frames; sums over a tile |
//! | [`grid`], [`interpolation`], [`frame_samples`] | lattice of samples; values of a frame there |
//! | [`sample_kernels`], [`lanes`] | loops that project and interpolate the samples; vectors |
//! | [`residual_weighting`], [`denoising`] | noise model and loss; Wiener filter of the texture |

pub mod denoising;
pub mod frame_samples;
pub mod grid;
pub mod interpolation;
pub mod lanes;
pub mod residual_weighting;
#[cfg(test)]
mod roofline;
pub mod sample_kernels;
pub mod texture;
pub mod tile;
pub mod tile_arrays;
pub mod tile_moments;
pub mod tile_statistics;
pub mod workspace;
