//! From frames over a tile to the tile's pixels.
//!
//! | subject | file |
//! | --- | --- |
//! | options | [`options`] |
//! | grid of nodes, and the frame of each | [`seam_grid`], [`seam_selection`] |
//! | differences of light between frames | [`multi_band_blending`] |
//! | all of it together, and shares of frames in a row | [`seams`], [`frame_shares`] |
//! | weighted sums along a row | [`accumulator`] |
//! | tile drawn from the best frame, the mean or the median | [`best_view`], [`tile_renderer`] |
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
