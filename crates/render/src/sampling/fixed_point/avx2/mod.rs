//! Sums and pixels eight at a time, with vectors of AVX2.
//!
//! | subject | file |
//! | --- | --- |
//! | reading and summing | [`lanes`] |
//! | weights of a pixel | [`weights`] |
//! | sums under the kernel anywhere, of grey pixels and in colour | [`grey`], [`colour`], [`sums`] |
//! | sums of grey pixels near one another | [`near_grey`] |
//! | sums as pixels | [`pixels`] |
//! | where the kernels of a row of a patch lie, and their sums | [`positions`], [`patch_sums`] |
//! | blocks of a patch, of one frame as it is | [`block`] |
//! | blocks of a patch, of frames with exposure undone | [`blended_block`] |

pub mod blended_block;
pub mod block;
mod colour;
mod grey;
mod lanes;
mod near_grey;
mod patch_sums;
pub mod pixels;
mod positions;
pub mod sums;
mod weights;
