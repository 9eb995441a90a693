//! General numerical tools: medians, inverses, window functions, Fourier transforms of rasters, and
//! loops compiled for the processor at hand.
//!
//! | tool | file |
//! | --- | --- |
//! | median of values of which some may be unknown | [`median`] |
//! | where a function rises, and its inverse there | [`monotone`] |
//! | weights of the pixels around a point | [`kernel`] |
//! | a function of every element, on all threads | [`parallel`] |
//! | rounding of small numbers without casts | [`rounding`] |
//! | sinc and Hann's window | [`signal`] |
//! | quantiles for tests with a rate of false alarms | [`significance`] |
//! | two-dimensional Fourier transforms | [`spectrum`] |
//! | loops compiled for the widest vectors of the processor | [`simd_dispatch`] |

pub mod kernel;
pub mod median;
pub mod monotone;
pub mod parallel;
pub mod rounding;
pub mod signal;
pub mod significance;
pub mod simd_dispatch;
pub mod spectrum;
