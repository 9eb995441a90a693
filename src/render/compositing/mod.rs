//! From frames over a tile to the tile's pixels.
//!
//! | subject | file |
//! | --- | --- |
//! | options | [`options`] |
//! | frame of each node of a grid, light levelled out between them | [`seam_grid`], [`seam_selection`], [`multi_band_blending`] |
//! | both together, and the parts that frames have in a row | [`seams`], [`frame_shares`] |
//! | weighted sums along a row | [`accumulator`] |
//! | tile drawn from the best frame, from the mean or from the median | [`best_view`], [`tile_renderer`] |
//! | wall solved from all frames, finer than any of them | [`super_resolution`] |
//! | rows of tiles as they are handed on | [`band`] |

pub mod accumulator;
pub mod band;
pub mod best_view;
pub mod frame_shares;
pub mod multi_band_blending;
pub mod options;
pub mod seam_grid;
pub mod seam_selection;
pub mod seams;
pub mod super_resolution;
pub mod tile_renderer;
