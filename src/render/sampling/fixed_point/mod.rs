//! Sums of 8-bit samples under a kernel, in whole numbers.
//!
//! Two taps along each axis: with the phases s, t in 1/128 px, `Σ = Σ_ij w_i(s) w_j(t) I_ij` with
//! `w = (128 − s, s)`, exact, in units of 2⁻¹⁴.
//!
//! More: weights in units of 2⁻¹⁴ ([`Kernel::integers`]). Rows are summed first, the first and the
//! last two of every four taps by themselves (a, b); these are cut to units of 2⁻⁶ and then summed
//! down the columns: `Σ = Σ_j w_j (⌊a_j/2⁸⌋ + ⌊b_j/2⁸⌋)`, in units of 2⁻²⁰. What cutting takes
//! away, half a unit of a and of b each in the mean, is given back at the end.
//!
//! The same numbers come out of vectors (AVX2) and of the plain loops of [`scalar`], to the bit:
//! nothing is rounded but by the cut.
//!
//! | subject | file |
//! | --- | --- |
//! | units of weights and sums | [`format`] |
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

pub use dispatch::{block, lit_block, pixels, sums, values};
pub use format::{missing, scale};
pub use inputs::{Block, LitBlock, PARTS, Part, Patch, Places, Source, reach};
