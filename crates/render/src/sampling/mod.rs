//! Pictures, their values between pixels, and exposure undone.
//!
//! | subject | file |
//! | --- | --- |
//! | samples of 8 and 16 bits, and what pixels consist of | [`sample`], [`pixel_format`] |
//! | decoded picture | [`picture`] |
//! | frames of a survey, as many in memory as are needed | [`picture_cache`] |
//! | up to 128 points: where a frame shows them, and its values there | [`point_batch`] |
//! | sums under a kernel in whole numbers | [`fixed_point`] |
//! | sums under a kernel in single precision | [`floating_point`] |
//! | small pictures of all frames | [`thumbnails`] |
//! | gains, biases and shading | [`photometric_samples`], [`exposure`], [`patch_light`] |
//! | one frame over one tile, sampled with its exposure undone | [`frame_view`] |

pub mod exposure;
pub mod fixed_point;
pub mod floating_point;
pub mod frame_view;
pub mod patch_light;
pub mod photometric_samples;
pub mod picture;
pub mod picture_cache;
pub mod pixel_format;
pub mod point_batch;
pub mod sample;
pub mod thumbnails;
