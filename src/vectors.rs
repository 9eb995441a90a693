//! Loops compiled for the widest vectors of the processor that runs them.

use pulp::{Arch, Simd, WithSimd};

/// Does `work` with the code compiled for this processor's vector instructions.
///
/// Write it as `wide(#[inline(always)] || …)`, and mark what it calls `#[inline(always)]` as well: only what is inlined
/// is compiled anew. The numbers are the same on every processor: vectors change neither the order of operations nor
/// their rounding, and nothing is contracted to a fused multiply–add.
#[inline(always)]
pub fn wide<R>(work: impl FnMut() -> R) -> R {
    Arch::new().dispatch(Wide(work))
}

struct Wide<F>(F);

impl<R, F: FnMut() -> R> WithSimd for Wide<F> {
    type Output = R;

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, _: S) -> R {
        (self.0)()
    }
}
