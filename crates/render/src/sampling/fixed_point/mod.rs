//! Sums of 8-bit samples under a kernel, in whole numbers.
//!
//! Two taps along each axis: with the phases s, t in 1/128 px, `Σ = Σ_ij w_i(s) w_j(t) I_ij` with
//! `w = (128 − s, s)`, exact, in units of 2⁻¹⁴.
//!
//! More taps: weights in units of 2⁻¹⁴
//! ([`tunnelstitch_geometry::numerics::kernel::Kernel::integer_weights_at`]). Rows are summed
//! first, the first and the last two of every four taps separately (a, b); these sums are truncated
//! to units of 2⁻⁶ and then summed down the columns: `Σ = Σ_j w_j (⌊a_j/2⁸⌋ + ⌊b_j/2⁸⌋)`, in units
//! of 2⁻²⁰. The mean loss by truncation, half a unit of a and of b each, is added at the end.
//!
//! Vectors (AVX2) and the plain loops of [`scalar`] give identical numbers: nothing is rounded
//! except by the truncation.
//!
//! | subject | file |
//! | --- | --- |
//! | units of weights and sums | [`mod@format`] |
//! | what is sampled: points, rows of a patch, blocks of one or several frames | [`inputs`] |
//! | choice of the code for the processor and the kernel | [`dispatch`] |
//! | plain loops, and vectors | [`scalar`], [`avx2`] |

#[cfg(target_arch = "x86_64")]
mod avx2;
mod dispatch;
mod format;
mod inputs;
mod scalar;
#[cfg(test)]
mod tests;

pub use dispatch::{draw_blended_block, draw_block, sample_values, sum_samples, write_pixels};
pub use format::{missing, scale};
pub use inputs::{
    BlendPart, BlendedBlock, KernelPositions, MAX_BLEND_PARTS, PatchBlock, PictureSamples,
    SampledPatch, reach,
};
