//! General numerical tools: medians, window functions, Fourier transforms of rasters, and loops
//! compiled for the processor at hand.
//!
//! | tool | file |
//! | --- | --- |
//! | median of values of which some may be unknown | [`median`] |
//! | weights of the pixels around a point | [`kernel`] |
//! | a function of every element, on all threads | [`parallel`] |
//! | rounding of small numbers without casts | [`rounding`] |
//! | sinc and Hann's window | [`signal`] |
//! | two-dimensional Fourier transforms | [`spectrum`] |
//! | loops compiled for the widest vectors of the processor | [`simd_dispatch`] |

pub mod kernel;
pub mod median;
pub mod parallel;
pub mod rounding;
pub mod signal;
pub mod simd_dispatch;
pub mod spectrum;
